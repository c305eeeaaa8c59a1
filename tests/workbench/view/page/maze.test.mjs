import assert from "node:assert/strict";
import test from "node:test";
import { MARGIN, Maze } from "../../../../workbench/view/page/maze.mjs";

/** Rooms 0 and 2 of 4 by 4 by 3 m on either side of a wall of 0.2 m, whose doorway is cell 1, from y = 1 to 2; and a
 * prism, cell 3, apart from them. */
function rooms() {
  const boxes = [0, 0, 0, 4, 4, 3, 4, 1, 0, 4.2, 2, 2.1, 4.2, 0, 0, 8.2, 4, 3, 20, 0, 0, 24, 4, 3];
  const plans = new Float32Array(32).fill(NaN);
  plans.set([22, 0, 24, 2, 22, 4, 20, 2], 24);
  return new Maze({
    boxes: Float32Array.from(boxes), plans, inhabitable: Uint8Array.from([1, 0, 1, 1]),
    sides: Int32Array.from([0, 1, 2, 1]), axes: Uint8Array.from([0, 0]),
    coordinates: Float32Array.from([4, 4.2]), openings: Float32Array.from([1, 2, 0, 2.1, 1, 2, 0, 2.1]),
  });
}

test("where a point is: a room before a doorway, the last cell before others", () => {
  const maze = rooms();
  assert.equal(maze.cellAt([2, 2, 1.6]), 0);
  assert.equal(maze.cellAt([4.1, 1.5, 1.6]), 1);
  assert.equal(maze.cellAt([4, 1.5, 1.6]), 0);
  assert.equal(maze.cellAt([4, 1.5, 1.6], 1), 1);
  assert.equal(maze.cellAt([4.1, 3, 1.6]), -1);
});

test("a prism is its plan, not the box around it", () => {
  const maze = rooms();
  assert.equal(maze.cellAt([22, 2, 1]), 3);
  assert.equal(maze.cellAt([20.2, 0.2, 1]), -1);
  assert.equal(maze.cellAt([20.2, 0.2, 1], 3), -1);
});

test("one way through the doorway, none through the wall", () => {
  const maze = rooms();
  assert.equal(maze.follow(0, [3.5, 1.5, 1.6], [5, 1.5, 1.6]), 2);
  assert.equal(maze.follow(2, [5, 1.5, 1.6], [3.5, 1.5, 1.6]), 0);
  assert.equal(maze.follow(0, [3.5, 1.5, 1.6], [4.1, 1.5, 1.6]), 1);
  assert.equal(maze.follow(0, [3.5, 3, 1.6], [5, 3, 1.6]), -1);
  assert.equal(maze.follow(0, [3.5, 1.5, 2.5], [5, 1.5, 2.5]), -1);
  assert.equal(maze.follow(0, [3.5, 1.5, 1.6], [3.5, 1.5, 4]), -1);
  assert.equal(maze.follow(0, [1, 1, 1], [2, 3, 1]), 0);
});

test("steps stop a shoulder before a wall, slide along it, and pass the door", () => {
  const maze = rooms();
  let here = { point: [3, 3, 1.6], cell: 0 };
  for (let k = 0; k < 40; k++) here = maze.step(here.cell, here.point, [0.05, 0, 0]);
  assert.equal(here.cell, 0);
  assert.ok(here.point[0] > 3.7 && here.point[0] <= 4 - MARGIN + 1e-9, here.point);
  const slid = maze.step(0, here.point, [0.05, 0.05, 0]);
  assert.deepEqual(slid.point, [here.point[0], here.point[1] + 0.05, 1.6]);
  here = { point: [3, 1.5, 1.6], cell: 0 };
  for (let k = 0; k < 40; k++) here = maze.step(here.cell, here.point, [0.05, 0, 0]);
  assert.equal(here.cell, 2);
  assert.ok(Math.abs(here.point[0] - 5) < 1e-9);
});

test("no step, no change", () => {
  assert.deepEqual(rooms().step(0, [1, 1, 1], [0, 0, 0]), { point: [1, 1, 1], cell: 0 });
});
