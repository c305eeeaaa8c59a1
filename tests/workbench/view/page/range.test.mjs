import assert from "node:assert/strict";
import test from "node:test";
import { Maze } from "../../../../workbench/view/page/maze.mjs";
import { apart, rangeCells } from "../../../../workbench/view/page/range.mjs";

/** Three rooms in a row, doors at x = 4 and x = 8, at the two ends of the middle one's depth. */
function row() {
  return new Maze({
    boxes: Float32Array.from([0, 0, 0, 4, 4, 3, 4, 0, 0, 8, 4, 3, 8, 0, 0, 12, 4, 3]),
    plans: new Float32Array(24).fill(NaN), inhabitable: Uint8Array.from([1, 1, 1]),
    sides: Int32Array.from([0, 1, 1, 2]), axes: Uint8Array.from([0, 0]), coordinates: Float32Array.from([4, 8]),
    openings: Float32Array.from([0, 1, 0, 2, 3, 4, 0, 2]),
  });
}

test("the next room is as far as its door, the one behind as the way from door to door more", () => {
  const found = rangeCells(row(), [3.7, 0.5, 1.6], [0], 20);
  assert.deepEqual(found.map(([cell]) => cell), [0, 1, 2]);
  assert.ok(Math.abs(found[1][1] - 0.3) < 1e-9 && Math.abs(found[2][1] - (0.3 + Math.hypot(4, 2))) < 1e-9, found);
});

test("nothing beyond reach", () => {
  assert.deepEqual(rangeCells(row(), [3.7, 0.5, 1.6], [0], 4).map(([cell]) => cell), [0, 1]);
  assert.deepEqual(rangeCells(row(), [1, 0.5, 1.6], [0], 0.5), [[0, 0]]);
});

test("an eye outside all cells may go anywhere, as far as boxes are", () => {
  assert.deepEqual(rangeCells(row(), [14, 1, 1], [], 5), [[2, 2]]);
});

test("a cell with very many portals is a lower bound", () => {
  const count = 300;
  const maze = new Maze({
    boxes: Float32Array.from([0, 0, 0, 400, 4, 3, ...Array.from({ length: count }, (_, k) => [k, 4, 0, k + 1, 8, 3]).flat()]),
    plans: new Float32Array(8 * (count + 1)).fill(NaN), inhabitable: new Uint8Array(count + 1).fill(1),
    sides: Int32Array.from(Array.from({ length: count }, (_, k) => [0, k + 1]).flat()), axes: new Uint8Array(count).fill(1),
    coordinates: new Float32Array(count).fill(4), openings: Float32Array.from(Array.from({ length: count }, (_, k) => [k, k + 1, 0, 2]).flat()),
  });
  const found = new Map(rangeCells(maze, [10.5, 5, 1], [11], 3));
  assert.equal(found.size, count + 1);
  for (const [cell, way] of found) assert.ok(way <= Math.max(0, apart([10.5, 5, 1, 10.5, 5, 1], maze.boxes.subarray(6 * cell, 6 * cell + 6)) + 2));
});
