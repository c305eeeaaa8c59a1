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
    Object.assign(this, { bake, storey: 0, cell: -1, target: null, hover: null, mode: "pick", layer: kind });
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

  /** Chooses a view cell and, unless told to keep it, the cell's storey; does nothing if it is none. */
  pick(cell, { keepStorey = false } = {}) {
    const { cells } = this.bake;
    if (!cells.inhabitable[cell]) return;
    const verdicts = this.bake.verdicts(cell);
    const moves = !keepStorey && cells.storey[cell] !== this.storey;
    const storey = moves ? { storey: cells.storey[cell] } : {};
    this.set({ cell, verdicts, target: null, hover: null, listed: LISTED, ...storey });
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

  /** The sightline to a target {kind, id}, or null. */
  sightline({ kind, id }) {
    return this.bake.relations[kind].sightline(this.cell, id);
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
