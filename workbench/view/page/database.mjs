// The display database as the viewer has it: objects, levels, sets, cells.

import { Maze } from "./maze.mjs";
import { decode } from "./runs.mjs";

// Corners lie on a grid, up to half a step from where they are placed [m].
const GRID = 1e-3;

/** Least and most of points, 3 numbers each. */
function boxAround(points) {
  const box = [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity];
  points.forEach((x, k) => {
    box[k % 3] = Math.min(box[k % 3], x);
    box[3 + (k % 3)] = Math.max(box[3 + (k % 3)], x);
  });
  return box;
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
    this.boxes = new Map();
    this.held = new Map();
    this.reach = new Map();
    this.around = [];
    this.itemBoxes = [];
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

  /** Corners and faces of an item: 3 numbers a vertex, 3 a face. */
  item(number) {
    const begin = this.itemOffsets[number];
    const [vertices, faces] = [this.itemVertices[number], this.itemFaces[number]];
    const corners = new Float32Array(this.geometry.slice(begin, begin + 12 * vertices).buffer);
    const wide = vertices > 65536 ? Uint32Array : Uint16Array;
    const at = begin + 12 * vertices;
    return { corners, faces: new wide(this.geometry.slice(at, at + 3 * faces * wide.BYTES_PER_ELEMENT).buffer) };
  }

  /** Triangles of an object in the model, 9 numbers each. */
  trianglesOf(id) {
    if (!this.shapes.has(id)) this.shapes.set(id, this.placed(id));
    return this.shapes.get(id);
  }

  /** Objects whose boxes meet a cell. */
  objectsIn(cell) {
    if (!this.held.has(cell)) {
      const box = this.cellBoxes.subarray(6 * cell, 6 * cell + 6);
      const ids = [];
      for (let id = 0; id < this.objects; id++) {
        const b = this.aroundOf(id);
        if ([0, 1, 2].every((axis) => b[axis] <= box[axis + 3] + GRID && b[axis + 3] >= box[axis] - GRID)) ids.push(id);
      }
      this.held.set(cell, ids);
    }
    return this.held.get(cell);
  }

  /** A box around an object: around its shape's box where that is placed, so never smaller than the object. */
  aroundOf(id) {
    if (!this.around[id]) {
      const box = this.itemBox(this.finestOf(id));
      const m = this.transforms.subarray(12 * id, 12 * id + 12);
      this.around[id] = [0, 1].flatMap((end) => [0, 1, 2].map((row) => {
        let sum = m[4 * row + 3];
        for (let k = 0; k < 3; k++) sum += m[4 * row + k] * box[k + (m[4 * row + k] > 0 === (end === 1) ? 3 : 0)];
        return sum;
      }));
    }
    return this.around[id];
  }

  itemBox(item) {
    if (!this.itemBoxes[item]) this.itemBoxes[item] = boxAround(this.item(item).corners);
    return this.itemBoxes[item];
  }

  /** Least and most of an object's corners. */
  boxOf(id) {
    if (!this.boxes.has(id)) this.boxes.set(id, boxAround(this.trianglesOf(id)));
    return this.boxes.get(id);
  }

  placed(id) {
    const { corners, faces } = this.item(this.finestOf(id));
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
