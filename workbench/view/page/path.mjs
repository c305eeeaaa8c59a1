// Paths of an eye: recorded here, or read from a table as `viewcell walk` reads and writes it (docs/tune-file.md).

const COLUMNS = ["x", "y", "z", "yaw", "pitch", "t"];
const DEGREES = 180 / Math.PI;
// Frames that are recorded of a second, as the papers'.
const RATE = 10;

/** Frames of a table of comma-separated values: point, yaw and pitch [radians], t [s] from the first one on. */
export function readPath(text) {
  const [head, ...lines] = text.trim().split(/\r?\n/).map((line) => line.split(",").map((cell) => cell.trim().replace(/^"|"$/g, "")));
  const places = COLUMNS.map((name) => head.indexOf(name));
  const missing = COLUMNS.filter((_, k) => places[k] < 0);
  if (missing.length) throw new Error(`path: expected the column ${missing[0]}, found ${head.join(", ")}`);
  const frames = lines.map((line) => {
    const [x, y, z, yaw, pitch, t] = places.map((place) => (line[place] ? Number(line[place]) : NaN));
    if (![x, y, z, yaw, pitch, t].every(Number.isFinite)) throw new Error(`path: expected six numbers in a row, found ${line.join(",")}`);
    return { point: [x, y, z], yaw: yaw / DEGREES, pitch: pitch / DEGREES, t };
  });
  if (!frames.length) throw new Error("path: expected at least one frame, found none");
  frames.forEach((frame, k) => {
    if (k && frame.t <= frames[k - 1].t) throw new Error(`path: expected t to ascend, found ${frames[k - 1].t} before ${frame.t}`);
  });
  const begin = frames[0].t;
  for (const frame of frames) frame.t -= begin;
  return frames;
}

/** The same as text; numbers to a tenth of a millimetre, of a hundredth of a degree, and of a millisecond. */
export function writePath(frames) {
  const rows = frames.map(({ point, yaw, pitch, t }) =>
    [...point.map((x) => x.toFixed(4)), (yaw * DEGREES).toFixed(3), (pitch * DEGREES).toFixed(3), t.toFixed(4)].join(","));
  return `${[COLUMNS.join(","), ...rows].join("\n")}\n`;
}

/** Where an eye is at a time: between the frames before and after, the shorter way round. */
export function at(frames, t) {
  const next = frames.findIndex((frame) => frame.t >= t);
  if (next <= 0) return next < 0 ? frames.at(-1) : frames[0];
  const [a, b] = [frames[next - 1], frames[next]];
  const share = (t - a.t) / (b.t - a.t);
  const mix = (x, y) => x + share * (y - x);
  const turn = Math.atan2(Math.sin(b.yaw - a.yaw), Math.cos(b.yaw - a.yaw));
  return { point: a.point.map((x, k) => mix(x, b.point[k])), yaw: a.yaw + share * turn, pitch: mix(a.pitch, b.pitch), t };
}

/** Records where a visitor is, so many times a second. */
export class Recorder {
  constructor(begin) {
    Object.assign(this, { begin, frames: [] });
  }

  tick(visitor, now) {
    const t = (now - this.begin) / 1000;
    if (this.frames.length && t - this.frames.at(-1).t < 1 / RATE) return;
    this.frames.push({ point: [...visitor.point], yaw: visitor.yaw, pitch: visitor.pitch, t });
  }
}
