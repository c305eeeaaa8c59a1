// A bake made by hand: two rooms with a doorway, and a room above the first; a wall, a desk, a pane and an empty object.
import { Bake } from "../../../../workbench/report/page/data.mjs";
import { State } from "../../../../workbench/report/page/state.mjs";

const box = (x, y, z, u, v, w) => [x, y, z, u, v, w];
const CELLS = [
  box(0, 0, 0, 40, 40, 30), // 0: hall
  box(40, 10, 0, 44, 20, 20), // 1: doorway, no view cell
  box(44, 0, 0, 84, 30, 30), // 2: Room 7
  box(0, 0, 34, 40, 40, 64), // 3: upstairs, without a name
];
const OBJECTS = [
  box(-4, -4, 0, 0, 44, 30), // 0: wall
  box(60, 10, 0, 70, 20, 8), // 1: desk
  box(40, 10, 0, 41, 20, 20), // 2: pane
  box(1, 1, 1, 0, 0, 0), // 3: no triangles
];
const LINES = [
  [1, 1, 1, 2, 2, 2],
  [1, 15, 1, 40, 15, 1],
  [50, 1, 1, 41, 15, 1],
  [50, 15, 1, 60, 15, 1],
];

/** What the page's JSON holds, unpacked: steps of 10 cm. Cell 0 sees 0, 1 and perhaps 2; cell 2 sees 0, 1 and 2. */
export function handmade() {
  return {
    facts: { claimsCells: true, gridMetres: 0.1, origin: [0, 0, 0], yawDegrees: 0 },
    cells: {
      firstPlan: 1e9,
      plans: new Int32Array(),
      boxes: Int32Array.from(CELLS.flat()),
      inhabitable: Uint8Array.of(1, 0, 1, 1),
      storey: Int8Array.of(0, -1, 0, 1),
      names: ["hall", "", "Room 7", ""],
    },
    portals: {
      boxes: Int32Array.of(40, 10, 0, 40, 20, 20, 44, 10, 0, 44, 20, 20),
      cells: Uint8Array.of(0, 1, 1, 2),
      axis: Uint8Array.of(0, 0),
    },
    objects: {
      boxes: Int32Array.from(OBJECTS.flat()),
      names: ["wall", "", "pane", ""],
      guids: ["2O2Fr$t4X7Zf8NOew3FLKr", "", "0BTBFw6f90Nfh9rP1dlXr2", ""],
      kinds: ["IfcDesk", "IfcWall"],
      kind: Uint8Array.of(1, 0, 0, 0),
      role: Uint8Array.of(0, 1, 2, 0),
    },
    rooms: {
      words: [
        { name: "1", longName: "Hall", guid: "0BTBFw6f90Nfh9rP1dlXrr", storey: "Ground", elevation: -0.5, covered: 1 },
        { name: "suite", longName: "", guid: "", storey: "Upper", elevation: null, covered: 0.955 },
        { name: "void", longName: "void", guid: "", storey: "", elevation: null, covered: 0 },
      ],
      starts: Uint8Array.of(0, 1, 3, 3),
      cells: Uint8Array.of(0, 2, 3),
    },
    storeys: [
      { floor: 0, level: 12.5, step: 8 },
      { floor: 34, level: 46.5, step: 8 },
    ],
    cellRows: {
      starts: Uint8Array.of(0, 3, 3, 6, 7),
      gaps: Int8Array.of(0, 1, 1, 0, 1, 1, 3),
      codes: Uint8Array.of(1, 1, 0, 2, 1, 1, 2),
      low: [0, 0, 0],
      unit: [1, 1, 0.5],
      lines: Uint8Array.from(LINES.flat()),
      crossings: Uint8Array.of(0, 1, 1, 0),
      portals: Uint8Array.of(0, 1),
    },
    objectRows: {
      starts: Uint8Array.of(0, 2, 2, 3, 3),
      gaps: Uint8Array.of(0, 2, 1),
      codes: Uint8Array.of(2, 0, 2),
      low: [0, 0, 0],
      unit: [1, 1, 1],
      lines: new Uint8Array(),
      crossings: new Uint8Array(),
      portals: new Uint8Array(),
    },
  };
}

/** The bake, and what is chosen at first: cell 0 on storey 0, in a plan of 840 by 400 pixels, 10 a step. */
export function chosen(change = () => {}) {
  const data = handmade();
  change(data);
  const state = new State(new Bake(data));
  state.view = { x: 42, y: 20, scale: 10, width: 840, height: 400 };
  state.pick(data.cells.inhabitable.indexOf(1));
  return state;
}
