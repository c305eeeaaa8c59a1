import assert from "node:assert/strict";
import test from "node:test";
import { EYE, STEP, groundUnder } from "../../../../workbench/view/page/ground.mjs";

/** A floor at z = 0, stairs of 0.4 m and 1.2 m, a ceiling at 3 m, an upright pane. */
const SHAPES = [
  [0, 0, 0, 9, 0, 0, 0, 9, 0],
  [2, 0, 0.4, 4, 0, 0.4, 2, 2, 0.4],
  [5, 0, 1.2, 7, 0, 1.2, 5, 2, 1.2],
  [0, 0, 3, 9, 0, 3, 0, 9, 3],
  [1, 0, 0, 1, 1, 0, 1, 0, 2],
];
const BOXES = SHAPES.map((t) => {
  const along = (axis) => [t[axis], t[axis + 3], t[axis + 6]];
  return [Math.min, Math.max].flatMap((end) => [0, 1, 2].map((axis) => end(...along(axis))));
});
const under = (x, y, feet, ids = [0, 1, 2, 3, 4]) => groundUnder([x, y, feet + EYE], ids, (id) => BOXES[id], (id) => SHAPES[id]);

test("one stands on the highest that a step reaches", () => {
  assert.equal(under(0.5, 0.5, 0), 0);
  assert.ok(Math.abs(under(2.5, 0.5, 0) - 0.4) < 1e-12);
  assert.equal(under(5.5, 0.5, 0), 0);
  assert.ok(Math.abs(under(5.5, 0.5, 1.2 - STEP + 0.01) - 1.2) < 1e-12);
});

test("ceilings, panes and what is beside are no ground", () => {
  assert.equal(under(1, 0.5, 0, [3, 4]), -Infinity);
  assert.equal(under(8.9, 8.9, 0), -Infinity);
  assert.equal(under(0.5, 0.5, 0, []), -Infinity);
});
