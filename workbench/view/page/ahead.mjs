// The look-ahead: which cells are in range, what they need, what of it is in memory, and what comes and goes.

import { Memory, lookahead } from "./memory.mjs";
import { rangeCells } from "./range.mjs";
import { AT_ONCE } from "./supply.mjs";

// How fast the eye may move and how long is looked ahead, as `viewcell walk` [m/s, s].
const SPEED = 2;
const AHEAD_S = 1;
// It looks anew when so far from where it last did [m].
const STRIDE = 0.25;
// For how long what was read or released keeps its colour [ms].
const SHOWN_MS = 1500;

export class Ahead {
  /** `arrived()` hears that a chunk has come, `gone(items)` that items are no longer held, `failed(error)` of what did not. */
  constructor(database, supply, capacity, { arrived, gone, failed }) {
    Object.assign(this, { database, supply, arrived, gone, failed });
    this.memory = new Memory(database, capacity);
    this.cells = [];
    this.ahead = [];
    this.recent = new Map();
    this.misses = 0;
    this.busy = 0;
  }

  /** Look from an eye in a cell, which is shown some items now. */
  look(eye, cell, items, now) {
    const moved = !this.eye || Math.hypot(...eye.map((x, k) => x - this.eye[k])) > STRIDE || this.cell !== cell;
    if (moved) {
      this.cells = rangeCells(this.database.maze, eye, cell < 0 ? [] : [cell], SPEED * AHEAD_S);
      [this.eye, this.cell, this.stale] = [[...eye], cell, true];
      this.memory.retry();
    }
    if (items !== this.items && items.some((item) => this.memory.absent(this.database.chunkOf[item]))) this.stale = true;
    this.items = items;
    if (!this.stale) return;
    this.stale = false;
    this.ahead = lookahead(this.database, this.cells, items, this.memory.room);
    this.ask(now);
  }

  /** Ask for what is looked ahead to and not there, as far as scripts may be under way. */
  ask(now) {
    const { read, released } = this.memory.frame(this.ahead, AT_ONCE - this.busy);
    for (const chunk of released) {
      this.recent.set(chunk, ["release", now]);
      this.supply.give(chunk);
      if (this.supply.streams) this.gone(this.database.itemsOf(chunk));
    }
    for (const chunk of read) this.bring(chunk, now);
  }

  async bring(chunk, now) {
    this.busy++;
    this.recent.set(chunk, ["read", now]);
    try {
      await this.supply.bring(chunk);
      this.memory.arrive(chunk);
      this.arrived();
    } catch (error) {
      this.memory.fail(chunk);
      this.misses++;
      this.failed(error);
    }
    this.busy--;
    this.ask(performance.now());
  }

  /** Whether colours of what was read or released change. */
  fades(now) {
    const before = this.recent.size;
    for (const [chunk, [, when]] of this.recent) if (now - when >= SHOWN_MS) this.recent.delete(chunk);
    return this.recent.size < before;
  }

  /** What an object's chunks are: read, release, resident, ahead or absent, the first that one of them is. */
  stateOf(id, now) {
    const chunks = this.database.chunksOf(id);
    for (const what of ["read", "release"]) {
      if (chunks.some((chunk) => this.recent.get(chunk)?.[0] === what && now - this.recent.get(chunk)[1] < SHOWN_MS)) return what;
    }
    if (chunks.some((chunk) => this.memory.resident(chunk))) return "resident";
    this.wanted = this.wantedOf === this.ahead ? this.wanted : new Set(this.wantedOf = this.ahead);
    return chunks.some((chunk) => this.wanted.has(chunk)) ? "ahead" : "absent";
  }
}
