// Where geometry comes from: it is all here, and only counted as if it were read; or chunks, each a script of its own.

import { loadScript } from "./reasons.mjs";
import { unpacked } from "./unpack.mjs";

// What is counted as read in a second, of a view that is all here [bytes].
const RATE = 20e6;
// Scripts under way at a time.
export const AT_ONCE = 4;

/** Chunks at once, each after the time that reading takes. */
export class Inline {
  constructor(database) {
    this.database = database;
  }

  get streams() {
    return false;
  }

  async bring(chunk) {
    await new Promise((done) => setTimeout(done, (1000 * this.database.chunkBytes(chunk)) / RATE));
  }

  give() {}
}

/** Chunks from files beside the page. */
export class Files {
  constructor(database) {
    this.database = database;
    globalThis.viewcellChunks = new Map();
  }

  get streams() {
    return true;
  }

  /** Bring a chunk into the database. */
  async bring(chunk) {
    await loadScript(`geometry-${chunk}.js`);
    const bytes = await unpacked(globalThis.viewcellChunks.get(chunk));
    globalThis.viewcellChunks.delete(chunk);
    if (bytes.length !== this.database.chunkBytes(chunk)) throw new Error(`geometry-${chunk}.js is not of this view`);
    this.database.parts.set(chunk, bytes);
  }

  /** A chunk is no longer held. */
  give(chunk) {
    this.database.release(chunk);
  }
}
