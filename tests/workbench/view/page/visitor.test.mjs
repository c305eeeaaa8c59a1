import assert from "node:assert/strict";
import test from "node:test";
import { Maze } from "../../../../workbench/view/page/maze.mjs";
import { Visitor, startCell } from "../../../../workbench/view/page/visitor.mjs";

/** View cells 1 to 4 (0 is none): sizes of sets and of boxes, cubes but for their height. */
function database(sets, sides) {
  return {
    viewCells: sets.map((_, k) => k + 1), setOf: (cell) => ({ potential: new Array(sets[cell - 1]) }),
    cellBoxes: Float32Array.from([0, ...sides].flatMap((side) => [0, 0, 0, side, side, side])),
  };
}

test("a walk begins where much may be seen, in the largest of such cells", () => {
  assert.equal(startCell(database([100, 95, 40, 99], [1, 4, 9, 2])), 2);
  assert.equal(startCell(database([100, 50], [1, 9])), 1);
  assert.equal(startCell(database([0, 0], [1, 2])), 2);
  assert.equal(startCell(database([], [])), -1);
});

/** A room of 3 m, 4 by 4 m, without a floor, over a space whose ground is 1 m below; `below`: whether one may be there. */
function overSpace(below) {
  const boxes = Float32Array.from([0, 0, 0, 4, 4, 3, 0, 0, -2, 4, 4, 0]);
  const maze = new Maze({
    boxes, plans: new Float32Array(16).fill(NaN), inhabitable: Uint8Array.from([1, below]), sides: Int32Array.from([1, 0]),
    axes: Uint8Array.from([2]), coordinates: Float32Array.from([0]), openings: Float32Array.from([0, 4, 0, 4]),
  });
  return {
    maze, cellBoxes: boxes, viewCells: [0], setOf: () => ({ potential: [0] }), groundOf: () => [0], boxOf: () => [0, 0, -1, 4, 4, -1],
    trianglesOf: () => [0, 0, -1, 4, 0, -1, 0, 4, -1, 4, 4, -1, 0, 4, -1, 4, 0, -1], middle: () => [2, 2, 1.5],
  };
}

test("nobody falls out of a room to where nobody can stand, but down a stairwell one goes", () => {
  for (const below of [0, 1]) {
    const visitor = new Visitor(overSpace(below));
    for (let k = 0; k < 100; k++) visitor.walk(0.1, 0, 0, 1);
    assert.equal(visitor.cell, 0);
    assert.ok(Math.abs(visitor.point[2] - 0.65) < 1e-6, `${visitor.point}`);
  }
  // Eyes of who stands on a ground that is lower still would be out of the room: they stay where they are.
  for (const [below, cell] of [[0, 0], [1, 1]]) {
    const database = { ...overSpace(below), boxOf: () => [0, 0, -1.9, 4, 4, -1.9] };
    database.trianglesOf = () => overSpace(below).trianglesOf().map((x, k) => (k % 3 === 2 ? -1.9 : x));
    const visitor = new Visitor(database);
    for (let k = 0; k < 100; k++) visitor.walk(0.1, 0, 0, 1);
    assert.equal(visitor.cell, cell);
    assert.ok(Math.abs(visitor.point[2] - (cell ? -0.25 : 1.65)) < 1e-6, `${visitor.point}`);
  }
});
