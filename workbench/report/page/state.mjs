// What is chosen and shown: one object that all parts of the page read, change by `set`, and listen to.
import { UNKNOWN } from "./data.mjs";
import { fitted, toX, toY, zoomed } from "./view.mjs";

/** Entries of the list of targets that one press of a button adds. */
export const LISTED = 200;

export class State {
  #listeners = [];

  /** Nothing is chosen yet: `pick` does that once all have said what they listen to. */
  constructor(bake) {
    const [kind] = bake.kinds;
    Object.assign(this, { bake, storey: 0, cell: -1, room: -1, target: null, hover: null, mode: "pick", layer: kind });
    Object.assign(this, { verdicts: null, lines: { cell: false, object: false }, portals: true });
    Object.assign(this, { listKind: kind, listVerdict: UNKNOWN, listed: LISTED });
    Object.assign(this, { worstKind: kind, sort: { key: "over", down: true }, allCells: false });
    this.view = { x: 0, y: 0, scale: 1, width: 0, height: 0 };
  }

  /** Calls `act(this)` after each `set` of any of the fields named, those who came first first. */
  on(names, act) {
    this.#listeners.push({ names: names.split(" "), act });
  }

  /** Writes fields, then tells who listens to any of them, changed or not. */
  set(fields) {
    Object.assign(this, fields);
    for (const { names, act } of this.#listeners) if (names.some((name) => name in fields)) act(this);
  }

  /** The view cells that are looked from: the chosen one, or all of the chosen room. */
  get from() {
    return this.room < 0 ? [this.cell] : this.bake.cellsOf(this.room);
  }

  /** Chooses a room: what its view cells see together is shown; does nothing if it has none. */
  pickRoom(room) {
    const cells = this.bake.cellsOf(room),
      [cell] = cells;
    if (cell === undefined) return;
    const storey = this.bake.cells.storey[cell];
    this.set({ cell, room, verdicts: this.bake.verdictsFrom(cells), target: null, hover: null, listed: LISTED, storey });
  }

  /** Chooses a view cell and, unless told to keep it, the cell's storey; does nothing if it is none. */
  pick(cell, { keepStorey = false } = {}) {
    const { cells } = this.bake;
    if (!cells.inhabitable[cell]) return;
    const verdicts = this.bake.verdicts(cell);
    const moves = !keepStorey && cells.storey[cell] !== this.storey;
    const storey = moves ? { storey: cells.storey[cell] } : {};
    this.set({ cell, room: -1, verdicts, target: null, hover: null, listed: LISTED, ...storey });
  }

  /** Chooses the view cell so many places on in the order of ids, round and round. */
  step(way) {
    const { sources } = this.bake;
    this.pick(sources[(sources.indexOf(this.cell) + way + sources.length) % sources.length]);
  }

  /** Shows a storey, or the first or last where there is none with this number. */
  show(storey) {
    this.set({ storey: Math.max(0, Math.min(this.bake.storeys.length - 1, storey)) });
  }

  /** The view cell from which the page has a sightline to a target {kind, id}; the chosen one if there is none. */
  seenFrom({ kind, id }) {
    return this.from.find((cell) => this.bake.relations[kind].sightline(cell, id)) ?? this.cell;
  }

  /** The sightline to a target, or null. */
  sightline(target) {
    return this.bake.relations[target.kind].sightline(this.seenFrom(target), target.id);
  }

  fit() {
    this.set({ view: fitted(this.view, this.bake.extent) });
  }

  /** Zooms about a pixel. */
  zoom(factor, px, py) {
    this.set({ view: zoomed(this.view, factor, px, py) });
  }

  /** Zooms about the view cell where it is in sight, else about the middle. */
  zoomHere(factor) {
    const { bake, cell, view } = this,
      b = bake.box("cell", cell);
    const px = toX(view, (b[0] + b[3]) / 2),
      py = toY(view, (b[1] + b[4]) / 2);
    const near = bake.cells.storey[cell] === this.storey && px > 0 && px < view.width && py > 0 && py < view.height;
    this.zoom(factor, near ? px : view.width / 2, near ? py : view.height / 2);
  }
}
