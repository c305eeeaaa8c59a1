// What is held in memory: chunks of geometry, by a look-ahead that takes coarse levels first (docs/decisions/0025).

// Share of the memory that is looked ahead to; the rest holds what was needed before.
const SHARE = 0.9;
const [ABSENT, ASKED, RESIDENT] = [0, 1, 2];

/** Chunks in the order in which they are wanted: those of `now`, then levels from the coarsest, sooner cells first.
 *
 * `near` are pairs of a cell and how far it is, ascending; `room` is how many bytes may be looked ahead to. */
export function lookahead(database, near, now, room) {
  const found = new Set();
  let bytes = 0;
  const take = (item) => {
    const chunk = database.chunkOf[item];
    if (found.has(chunk)) return true;
    bytes += database.chunkBytes(chunk);
    if (bytes > room) return false;
    found.add(chunk);
    return true;
  };
  for (const item of now) if (!take(item)) return [...found];
  const steps = [];
  const finest = new Map();
  for (const [cell] of near) {
    database.membersOf(cell).forEach(([id, limit]) => {
      const [begin, end] = [database.itemStarts[id], database.itemStarts[id + 1]];
      const from = finest.get(id) ?? end - begin;
      for (let level = from - 1; level >= limit; level--) (steps[end - begin - 1 - level] ??= []).push(database.items[begin + level]);
      finest.set(id, Math.min(from, limit));
    });
  }
  for (const step of steps) for (const item of step ?? []) if (!take(item)) return [...found];
  return [...found];
}

export class Memory {
  /** Empty; `capacity` bytes are never passed: they are claimed when a chunk is asked for. */
  constructor(database, capacity) {
    this.database = database;
    this.state = new Uint8Array(database.chunks);
    this.used = new Float64Array(database.chunks);
    this.failed = new Set();
    this.claimed = this.fetched = this.clock = 0;
    this.capacity = capacity;
  }

  get room() {
    return SHARE * this.capacity;
  }

  resident(chunk) {
    return this.state[chunk] === RESIDENT;
  }

  /** Whether it is neither here nor asked for. */
  absent(chunk) {
    return this.state[chunk] === ABSENT && !this.failed.has(chunk);
  }

  /** Chunks to be read, at most `most`, and chunks that were given up for them, the longest unused first. */
  frame(ahead, most) {
    this.clock++;
    const wanted = new Set(ahead);
    for (const chunk of ahead) this.used[chunk] = this.clock;
    const old = this.database.chunkIds.filter((chunk) => this.state[chunk] === RESIDENT && !wanted.has(chunk))
      .sort((a, b) => this.used[a] - this.used[b]);
    const [read, released] = [[], []];
    const drop = () => {
      const chunk = old.shift();
      this.forget(chunk);
      released.push(chunk);
    };
    while (this.claimed > this.capacity && old.length) drop();
    for (const chunk of ahead) {
      if (read.length === most) break;
      if (this.state[chunk] !== ABSENT || this.failed.has(chunk)) continue;
      const bytes = this.database.chunkBytes(chunk);
      while (this.claimed + bytes > this.capacity && old.length) drop();
      if (this.claimed + bytes > this.capacity) break;
      this.state[chunk] = ASKED;
      this.claimed += bytes;
      read.push(chunk);
    }
    return { read, released };
  }

  arrive(chunk) {
    this.state[chunk] = RESIDENT;
    this.fetched += this.database.chunkBytes(chunk);
  }

  forget(chunk) {
    if (this.state[chunk] !== ABSENT) this.claimed -= this.database.chunkBytes(chunk);
    this.state[chunk] = ABSENT;
  }

  /** It did not come, and is not asked for again before `retry`. */
  fail(chunk) {
    this.forget(chunk);
    this.failed.add(chunk);
  }

  retry() {
    this.failed.clear();
  }
}
