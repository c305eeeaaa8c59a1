import assert from "node:assert/strict";
import test from "node:test";
import { eyeSees } from "../../../../workbench/view/page/eye.mjs";
import { Maze } from "../../../../workbench/view/page/maze.mjs";

/** Rooms 0 and 2 of 4 by 4 by 3 m, and between them doorway 1, from y = 1 to 2. */
const MAZE = new Maze({
  boxes: Float32Array.from([0, 0, 0, 4, 4, 3, 4, 1, 0, 4.2, 2, 2.1, 4.2, 0, 0, 8.2, 4, 3]),
  plans: new Float32Array(24).fill(NaN), inhabitable: Uint8Array.from([1, 0, 1]),
  sides: Int32Array.from([0, 1, 1, 2]), axes: Uint8Array.from([0, 0]),
  coordinates: Float32Array.from([4, 4.2]), openings: Float32Array.from([1, 2, 0, 2.1, 1, 2, 0, 2.1]),
});
/** 0 beside the eye, 1 behind it, 2 straight behind the door, 3 in the room's far corner, 4 before the door's wall. */
const BOXES = [
  [2.5, 1.4, 0, 2.7, 1.6, 1], [0.1, 1.4, 0, 0.3, 1.6, 1], [7, 1.4, 0, 7.2, 1.6, 1], [5, 3.7, 0, 5.2, 3.9, 1],
  [3.5, 3.5, 0, 3.7, 3.7, 1],
];
const IN = [[0, 1, 4], [], [2, 3]];
/** Planes of an eye that looks along X, 60 degrees to either side. */
const AHEAD = [[Math.sqrt(0.75), 0.5, 0], [Math.sqrt(0.75), -0.5, 0], [Math.sqrt(0.75), 0, 0.5], [Math.sqrt(0.75), 0, -0.5]];
const BACK = AHEAD.map(([x, y, z]) => [-x, y, z]);

function sees(eye, planes, ...more) {
  const found = eyeSees(MAZE, eye, planes, (id) => BOXES[id], (cell) => IN[cell], ...more);
  return found && [[...found.objects].sort(), [...found.cells].sort()];
}

test("through the door is seen what is in line with it", () => {
  assert.deepEqual(sees([1, 1.5, 1.6], AHEAD), [[0, 2, 4], [0, 1, 2]]);
  assert.deepEqual(sees([1, 1.5, 1.6], BACK), [[1], [0]]);
  // From beside the door's wall the far corner is in line.
  assert.deepEqual(sees([3.9, 1.1, 1.6], []), [[0, 1, 2, 3, 4], [0, 1, 2]]);
  assert.deepEqual(sees([3.9, 1.1, 1.6], AHEAD), [[2], [0, 1, 2]]);
});

test("within a portal both sides are seen", () => {
  assert.deepEqual(sees([4, 1.5, 1.6], AHEAD), [[2], [0, 1, 2]]);
  assert.deepEqual(sees([4, 1.5, 1.6], BACK), [[0, 1], [0, 1]]);
});

test("what may not be seen at all is not looked for", () => {
  assert.deepEqual(sees([1, 1.5, 1.6], AHEAD, [1, 0, 0, 0, 0]), [[0], [0, 1, 2]]);
  assert.deepEqual(sees([1, 1.5, 1.6], AHEAD, null, new Set([1])), [[0, 4], [0, 1]]);
});

test("an eye in no cell sees nothing that is known", () => {
  assert.deepEqual(sees([20, 1, 1], AHEAD), [[], []]);
});

test("too many ways are told", () => {
  const side = 30;
  const boxes = [];
  const [sides, axes, coordinates, openings] = [[], [], [], []];
  for (let k = 0; k < side * side; k++) {
    const [x, y] = [k % side, Math.floor(k / side)];
    boxes.push(x, y, 0, x + 1, y + 1, 1);
    if (x + 1 < side) sides.push(k, k + 1), axes.push(0), coordinates.push(x + 1), openings.push(y, y + 1, 0, 1);
    if (y + 1 < side) sides.push(k, k + side), axes.push(1), coordinates.push(y + 1), openings.push(x, x + 1, 0, 1);
  }
  const maze = new Maze({
    boxes: Float32Array.from(boxes), plans: new Float32Array(8 * side * side).fill(NaN),
    inhabitable: new Uint8Array(side * side).fill(1), sides: Int32Array.from(sides), axes: Uint8Array.from(axes),
    coordinates: Float32Array.from(coordinates), openings: Float32Array.from(openings),
  });
  assert.equal(eyeSees(maze, [0, 0, 0.5], [], () => [], () => []), null);
});

test("what of portals is in sight is told, as corners about the eye", () => {
  const maze = new Maze({
    boxes: Float32Array.from([0, 0, 0, 4, 4, 3, 4, 0, 0, 8, 4, 3]), plans: new Float32Array(16).fill(NaN),
    inhabitable: Uint8Array.from([1, 1]), sides: Int32Array.from([0, 1]), axes: Uint8Array.from([0]),
    coordinates: Float32Array.from([4]), openings: Float32Array.from([1, 2, 0, 2]),
  });
  const told = [];
  eyeSees(maze, [3, 1.5, 1], [[1, 0, 0]], () => [], () => [], null, null, (polygon) => told.push(polygon));
  assert.deepEqual(told, [[[1, -0.5, -1], [1, 0.5, -1], [1, 0.5, 1], [1, -0.5, 1]]]);
});
