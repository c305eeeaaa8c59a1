// The display database as the viewer has it: objects, levels, sets, cells.

import { Maze } from "./maze.mjs";
import { decode } from "./runs.mjs";

// Corners lie on a grid, up to half a step from where they are placed [m].
const GRID = 1e-3;

/** Boxes of objects [m], 6 numbers each, from columns of low corners and of extents in steps; of what is nowhere, none. */
function boxesOf(steps, count, grid) {
  const out = new Float32Array(6 * count);
  for (let id = 0; id < count; id++) {
    for (let k = 0; k < 3; k++) {
      const [low, extent] = [steps[k * count + id], steps[(3 + k) * count + id]];
      out[6 * id + k] = extent < 0 ? Infinity : low * grid;
      out[6 * id + 3 + k] = extent < 0 ? -Infinity : (low + extent) * grid;
    }
  }
  return out;
}

export class Database {
  constructor(head, arrays) {
    Object.assign(this, arrays);
    this.head = head;
    this.objects = head.names.length;
    this.maze = new Maze({
      boxes: this.cellBoxes, plans: this.cellPlans, inhabitable: this.inhabitable,
      sides: this.portalCells, axes: this.portalAxes, coordinates: this.portalCoordinates, openings: this.openings,
    });
    this.rowOfCell = new Map(Array.from(this.viewCells, (cell, row) => [cell, row]));
    this.sets = new Map();
    this.shapes = new Map();
    this.held = new Map();
    this.reach = new Map();
    this.objectBoxes = boxesOf(this.objectSteps, this.objects, head.grid);
    this.chunks = this.chunkStarts.length - 1;
    this.chunkIds = Array.from({ length: this.chunks }, (_, chunk) => chunk);
    this.chunkOf = new Uint32Array(this.itemOffsets.length);
    for (const chunk of this.chunkIds) this.chunkOf.fill(chunk, this.chunkStarts[chunk], this.chunkStarts[chunk + 1]);
    // Bytes of the chunks that are here.
    this.parts = new Map();
    if (!head.streams) {
      for (const chunk of this.chunkIds) {
        const begin = this.itemOffsets[this.chunkStarts[chunk]];
        this.parts.set(chunk, this.geometry.subarray(begin, begin + this.chunkBytes(chunk)));
      }
    }
    this.triangleCounts = Array.from({ length: this.objects }, (_, id) => this.itemFaces[this.finestOf(id)]);
  }

  /** The finest item of an object. */
  finestOf(id) {
    return this.items[this.itemStarts[id]];
  }

  /** What may be visible from a cell: potential ids, and those of them that no witness shows; null for no view cell. */
  setOf(cell) {
    const row = this.rowOfCell.get(cell);
    if (row === undefined) return null;
    if (!this.sets.has(row)) {
      const ids = (name) => decode(this[name], this[`${name}Starts`][row], this[`${name}Starts`][row + 1], this.objects);
      const unknown = new Set(ids("unknown"));
      this.sets.set(row, { potential: ids("potential"), unknown });
    }
    return this.sets.get(row);
  }

  /** Members of a cell's set, each an id and the coarsest level that is good enough for it from anywhere in the cell. */
  membersOf(cell) {
    const row = this.rowOfCell.get(cell);
    if (row === undefined) return [];
    const begin = this.memberStarts[row];
    return this.setOf(cell).potential.map((id, k) => [id, this.limits[begin + k]]);
  }

  /** Bytes of a chunk: of the items in it, which lie together. */
  chunkBytes(chunk) {
    return this.chunkEnds[chunk] - this.itemOffsets[this.chunkStarts[chunk]];
  }

  /** Whether an object may be visible from a cell. */
  isPotential(cell, id) {
    if (this.members?.cell !== cell) this.members = { cell, ids: new Set(this.setOf(cell)?.potential) };
    return this.members.ids.has(id);
  }

  /** What one may stand on in a cell: those of its potential objects. */
  groundOf(cell) {
    if (this.standing?.cell !== cell) {
      this.standing = { cell, ids: (this.setOf(cell)?.potential ?? []).filter((id) => this.ground[id]) };
    }
    return this.standing.ids;
  }

  /** Cells that may be visible from a cell; null where nothing is claimed. */
  cellsOf(cell) {
    const row = this.rowOfCell.get(cell);
    if (row === undefined || !this.head.claimsCells) return null;
    return decode(this.reached, this.reachedStarts[row], this.reachedStarts[row + 1], this.maze.count);
  }

  /** The same as a set, which is made once. */
  reachOf(cell) {
    if (!this.reach.has(cell)) {
      const cells = this.cellsOf(cell);
      this.reach.set(cell, cells && new Set(cells));
    }
    return this.reach.get(cell);
  }

  /** Corners and faces of an item that is here: 3 numbers a vertex, 3 a face. */
  item(number) {
    const chunk = this.chunkOf[number];
    const bytes = this.parts.get(chunk);
    const begin = this.itemOffsets[number] - this.itemOffsets[this.chunkStarts[chunk]];
    const [vertices, faces] = [this.itemVertices[number], this.itemFaces[number]];
    const corners = new Float32Array(bytes.slice(begin, begin + 12 * vertices).buffer);
    const wide = vertices > 65536 ? Uint32Array : Uint16Array;
    const at = begin + 12 * vertices;
    return { corners, faces: new wide(bytes.slice(at, at + 3 * faces * wide.BYTES_PER_ELEMENT).buffer) };
  }

  /** The item of an object that is here and nearest to a level: coarser ones first, then finer ones; -1 for none. */
  itemNear(id, level) {
    const [begin, end] = [this.itemStarts[id], this.itemStarts[id + 1]];
    for (let at = begin + level; at < end; at++) if (this.parts.has(this.chunkOf[this.items[at]])) return this.items[at];
    for (let at = begin + level - 1; at >= begin; at--) if (this.parts.has(this.chunkOf[this.items[at]])) return this.items[at];
    return -1;
  }

  /** Items of a chunk. */
  itemsOf(chunk) {
    return Array.from({ length: this.chunkStarts[chunk + 1] - this.chunkStarts[chunk] }, (_, k) => this.chunkStarts[chunk] + k);
  }

  /** Chunks of an object's levels. */
  chunksOf(id) {
    return Array.from(this.items.subarray(this.itemStarts[id], this.itemStarts[id + 1]), (item) => this.chunkOf[item]);
  }

  /** Forget a chunk. */
  release(chunk) {
    this.parts.delete(chunk);
    this.shapes.clear();
  }

  /** Triangles of an object in the model, 9 numbers each; of the finest level that is here. */
  trianglesOf(id) {
    if (!this.shapes.has(id)) {
      const item = this.itemNear(id, 0);
      if (item < 0) return new Float32Array(0);
      this.shapes.set(id, this.placed(id, item));
    }
    return this.shapes.get(id);
  }

  /** Objects whose boxes meet a cell. */
  objectsIn(cell) {
    if (!this.held.has(cell)) {
      const box = this.cellBoxes.subarray(6 * cell, 6 * cell + 6);
      const ids = [];
      for (let id = 0; id < this.objects; id++) {
        const b = this.boxOf(id);
        if ([0, 1, 2].every((axis) => b[axis] <= box[axis + 3] + GRID && b[axis + 3] >= box[axis] - GRID)) ids.push(id);
      }
      this.held.set(cell, ids);
    }
    return this.held.get(cell);
  }

  /** A box around an object, 6 numbers, the least ones first. */
  boxOf(id) {
    return this.objectBoxes.subarray(6 * id, 6 * id + 6);
  }

  placed(id, item) {
    const { corners, faces } = this.item(item);
    const m = this.transforms.subarray(12 * id, 12 * id + 12);
    const out = new Float32Array(3 * faces.length);
    faces.forEach((vertex, k) => {
      const [x, y, z] = corners.subarray(3 * vertex, 3 * vertex + 3);
      for (let axis = 0; axis < 3; axis++) {
        out[3 * k + axis] = m[4 * axis] * x + m[4 * axis + 1] * y + m[4 * axis + 2] * z + m[4 * axis + 3];
      }
    });
    return out;
  }

  /** Middle of a cell. */
  middle(cell) {
    return [0, 1, 2].map((axis) => (this.cellBoxes[6 * cell + axis] + this.cellBoxes[6 * cell + 3 + axis]) / 2);
  }

  /** Rooms by name, each with its largest view cell; cells without a name count as none. */
  rooms() {
    const found = new Map();
    for (const cell of this.viewCells) {
      const name = this.head.cellNames[cell];
      const b = this.cellBoxes.subarray(6 * cell, 6 * cell + 6);
      const size = (b[3] - b[0]) * (b[4] - b[1]) * (b[5] - b[2]);
      if (name && !(found.get(name)?.size >= size)) found.set(name, { cell, size });
    }
    return [...found].map(([name, { cell }]) => ({ name, cell })).sort((a, b) => a.name.localeCompare(b.name, "en", { numeric: true }));
  }
}
