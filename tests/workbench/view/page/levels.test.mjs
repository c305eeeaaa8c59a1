import assert from "node:assert/strict";
import test from "node:test";
import { Levels } from "../../../../workbench/view/page/levels.mjs";

/** An object of three levels, 1 and 4 cm off, twice as large as its shape, in the unit box. */
const database = {
  objects: 1, itemStarts: [0, 3], items: [2, 1, 0], itemErrors: [0.04, 0.01, 0],
  transforms: Float32Array.from([2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0]), boxOf: () => [0, 0, 0, 1, 1, 1],
};

test("the coarsest level that deviates by few enough pixels, a stretched shape by more", () => {
  const levels = new Levels(database);
  levels.target = 16;
  levels.tolerance = 1;
  // At 100 m with 1000 pixels a pixel is 10 cm; the shape is off by at most 2 sqrt(3) times its errors.
  assert.equal(levels.of(0, [101, 0, 0], 1000), 1);
  assert.equal(levels.of(0, [151, 0, 0], 1000), 2);
  assert.equal(levels.of(0, [11, 0, 0], 1000), 0);
  assert.equal(levels.of(0, [0.5, 0.5, 0.5], 1000), 0);
});

test("without a target all is finest", () => {
  assert.equal(new Levels(database).of(0, [1001, 0, 0], 1000), 0);
});

test("slow frames allow more, quick ones less, within bounds", () => {
  const levels = new Levels(database);
  levels.target = 16;
  for (let k = 0; k < 200; k++) levels.heard(50);
  assert.equal(levels.tolerance, 64);
  for (let k = 0; k < 200; k++) levels.heard(5);
  assert.equal(levels.tolerance, 0.5);
  // In between it stays what it is.
  levels.tolerance = 4;
  levels.average = 15;
  assert.equal(levels.heard(15), false);
  assert.equal(levels.tolerance, 4);
});
