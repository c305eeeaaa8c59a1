// The page's data: packed arrays, rows of the bake's tables, and what a bake is made of. Coordinates are grid steps.
import { cellsOn, extentOf, objectsOn } from "./storeys.mjs";

// Verdicts, in the order of certainty that something is visible, and their words.
export const HIDDEN = 0;
export const UNKNOWN = 1;
export const SEEN = 2;
export const WORD = ["hidden", "unknown", "seen", "unclaimed"];
// Of cells that a prism sees, or that see a prism, nothing is claimed.
export const UNCLAIMED = 3;
// Of two verdicts on one target from cells of a room the one that ranks higher is the room's.
const RANK = [0, 2, 3, 1];
// Codes of the page's rows; what has no row is hidden.
const ROW_UNKNOWN = 0;
const ROW_SIGHTLINE = 1;
const ARRAYS = { u1: Uint8Array, i1: Int8Array, u2: Uint16Array, i2: Int16Array, u4: Uint32Array, i4: Int32Array };

async function unzip(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

/** Replaces every packed array by a typed array, every packed value by itself, at any depth; resolves to the whole. */
export async function unpack(node) {
  if (node === null || typeof node !== "object") return node;
  if ("gzip" in node) {
    const buffer = await unzip(node.gzip);
    return node.dtype === "json" ? JSON.parse(new TextDecoder().decode(buffer)) : new ARRAYS[node.dtype](buffer);
  }
  const entries = await Promise.all(Object.entries(node).map(async ([name, value]) => [name, await unpack(value)]));
  return Array.isArray(node) ? entries.map(([, value]) => value) : Object.fromEntries(entries);
}

/** Six numbers, low then high corner, of the box with this number in an array of boxes. */
export const boxAt = (boxes, id) => boxes.subarray(6 * id, 6 * id + 6);

/** Rows of a table: verdicts of a source, and the sightline of a row if the page holds it. */
export class Relation {
  constructor(rows, targetCount) {
    Object.assign(this, rows, { targetCount });
    const firsts = new Set(rows.starts);
    let [target, line, portal] = [0, 0, 0];
    this.targets = Int32Array.from(rows.gaps, (gap, row) => (target = firsts.has(row) ? gap : target + gap));
    this.lineOf = Int32Array.from(rows.codes, (code) => (code === ROW_SIGHTLINE ? line++ : -1));
    this.portalEnds = Uint32Array.from(rows.crossings, (crossed) => (portal += crossed));
  }

  /** Calls `act(target, verdict, row)` for every target of a source that is not hidden, in ascending order. */
  each(source, act) {
    for (let row = this.starts[source]; row < this.starts[source + 1]; row++)
      act(this.targets[row], this.codes[row] === ROW_UNKNOWN ? UNKNOWN : SEEN, row);
  }

  /** Verdict of every target, shape (targets,). */
  verdicts(source) {
    const out = new Uint8Array(this.targetCount);
    this.each(source, (target, verdict) => (out[target] = verdict));
    return out;
  }

  /** How many of the chosen targets are potential, seen and unknown, and the overestimate: infinite without a witness. */
  numbers(source, chosen = () => true) {
    const found = [0, 0, 0];
    this.each(source, (target, verdict) => {
      if (chosen(target)) found[verdict]++;
    });
    const [, unknown, seen] = found;
    const potential = unknown + seen;
    return { potential, seen, unknown, over: seen ? potential / seen : potential ? Infinity : 1 };
  }

  /** Both ends [grid steps] and the portals passed, or null where the page has no sightline. */
  sightline(source, target) {
    const [first, last] = this.starts.subarray(source, source + 2);
    const at = this.targets.subarray(first, last).indexOf(target);
    return at < 0 ? null : this.sightlineOf(first + at);
  }

  /** The same for a row of the table. */
  sightlineOf(row) {
    const line = this.lineOf[row];
    if (line < 0) return null;
    const ends = [0, 1].map((end) => this.low.map((low, k) => low + this.unit[k] * this.lines[6 * line + 3 * end + k]));
    const last = this.portalEnds[line];
    return { ends, portals: Array.from(this.portals.subarray(last - this.crossings[line], last)) };
  }
}

/** What was baked: the page's data unpacked, with what follows from them. */
export class Bake {
  constructor(data) {
    Object.assign(this, data);
    const { cells, facts, objects } = data,
      cellCount = cells.inhabitable.length,
      objectCount = objects.names.length,
      roomCount = data.rooms.words.length;
    Object.assign(this, { cellCount, objectCount, roomCount });
    const [ofCells, ofObjects] = [new Relation(data.cellRows, cellCount), new Relation(data.objectRows, objectCount)];
    this.relations = { cell: ofCells, object: ofObjects };
    this.boxes = { cell: cells.boxes, object: objects.boxes };
    this.sources = [...cells.inhabitable.keys()].filter((cell) => cells.inhabitable[cell]);
    this.kinds = [...(facts.claimsCells ? ["cell"] : []), ...(objectCount ? ["object"] : [])];
    this.level = facts.claimsCells ? "Storey" : "Level";
    this.extent = extentOf(this);
    this.drawn = { cell: [], object: [] };
  }

  /** Verdicts of all targets from a view cell, by kind. */
  verdicts(cell) {
    const { firstPlan } = this.cells,
      ofCells = this.relations.cell.verdicts(cell);
    ofCells.fill(UNCLAIMED, cell < firstPlan ? firstPlan : 0);
    if (cell >= firstPlan) ofCells[cell] = SEEN;
    return { cell: ofCells, object: this.relations.object.verdicts(cell) };
  }

  /** View cells of a room. */
  cellsOf(room) {
    return Array.from(this.rooms.cells.subarray(this.rooms.starts[room], this.rooms.starts[room + 1]));
  }

  /** Verdicts of all targets from some view cells together: what any of them sees is seen. */
  verdictsFrom(cells) {
    const [first, ...others] = cells.map((cell) => this.verdicts(cell));
    for (const kind of ["cell", "object"])
      for (const { [kind]: found } of others)
        found.forEach((verdict, id) => {
          if (RANK[verdict] > RANK[first[kind][id]]) first[kind][id] = verdict;
        });
    return first;
  }

  box(kind, id) {
    return boxAt(this.boxes[kind], id);
  }

  /** Corners [x, y] of a cell's plan: of its box, or its own where it stands at an angle. */
  plan(cell) {
    const { firstPlan, plans } = this.cells,
      [x, y, , u, v] = this.box("cell", cell);
    if (cell < firstPlan) return [[x, y], [u, y], [u, v], [x, v]];
    return [0, 1, 2, 3].map((k) => plans.subarray(8 * (cell - firstPlan) + 2 * k, 8 * (cell - firstPlan) + 2 * k + 2));
  }

  /** A point [grid steps] in the model's own coordinates [m]. */
  inModel(p) {
    const { origin, yawDegrees } = this.facts,
      [x, y, z] = Array.from(p, (steps) => this.metres(steps)),
      [cos, sin] = [Math.cos((yawDegrees * Math.PI) / 180), Math.sin((yawDegrees * Math.PI) / 180)];
    return [x * cos - y * sin, x * sin + y * cos, z].map((value, k) => value + origin[k]);
  }

  metres(steps) {
    return steps * this.facts.gridMetres;
  }

  /** Diagonal of a box [m]; 0 for an object without triangles. */
  diagonal(kind, id) {
    const b = this.box(kind, id);
    return b[3] < b[0] ? 0 : this.metres(Math.hypot(b[3] - b[0], b[4] - b[1], b[5] - b[2]));
  }

  /** The storey that a box stands in: the highest whose floor is not above its middle; a view cell's own is stored. */
  storeyOf(kind, id) {
    if (kind === "cell" && this.cells.storey[id] >= 0) return this.cells.storey[id];
    const b = this.box(kind, id);
    const found = this.storeys.findLastIndex((storey) => storey.floor <= (b[2] + b[5]) / 2);
    return Math.max(0, found);
  }

  /** Ids on a storey's plan in the order of drawing; found once. */
  on(kind, number) {
    return (this.drawn[kind][number] ??= kind === "cell" ? cellsOn(this, number) : objectsOn(this, number));
  }
}
