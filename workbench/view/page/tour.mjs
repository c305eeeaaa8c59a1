// Replay and recording of an eye's path.

import { Recorder, at, readPath, writePath } from "./path.mjs";

export class Tour {
  /** `said(text)` hears what cannot be read. */
  constructor(database, said) {
    Object.assign(this, { database, said });
    this.frames = null;
    this.speed = 1;
  }

  /** Replay a table of a path from its beginning. */
  play(text) {
    try {
      this.frames = readPath(text);
      this.t = 0;
      this.said("");
    } catch (error) {
      this.said(error.message);
    }
  }

  stop() {
    this.frames = null;
  }

  /** Move a visitor along for some seconds; whether a replay is going on. */
  tick(visitor, seconds) {
    if (!this.frames) return false;
    this.t += seconds * this.speed;
    const { point, yaw, pitch } = at(this.frames, this.t);
    Object.assign(visitor, { point: [...point], yaw, pitch, cell: this.database.maze.cellAt(point, visitor.cell) });
    if (this.t >= this.frames.at(-1).t) this.stop();
    return true;
  }

  get recording() {
    return !!this.recorder;
  }

  /** Begin to record, or end it and give what was recorded as a table, null for nothing. */
  record(now) {
    if (!this.recorder) {
      this.recorder = new Recorder(now);
      return null;
    }
    const { frames } = this.recorder;
    this.recorder = null;
    return frames.length ? writePath(frames) : null;
  }
}

/** Hand a text to the user as a file. */
export function download(name, text) {
  const link = Object.assign(document.createElement("a"), {
    href: URL.createObjectURL(new Blob([text], { type: "text/csv" })), download: name,
  });
  link.click();
  URL.revokeObjectURL(link.href);
}
