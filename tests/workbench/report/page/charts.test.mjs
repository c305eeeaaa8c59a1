import assert from "node:assert/strict";
import test from "node:test";
import { aboveOne, frontOf, logAxis, ofSameCells, safeSeries, ticksBetween } from "../../../../workbench/report/page/charts.mjs";

const point = (seconds, error, more = {}) => ({ seconds, error, wrong_hidden: 0, ...more });

test("a method that hides something visible at any setting is left out whole", () => {
  const safe = { method: "a", points: [point(1, 2), point(2, 1.5)] };
  const unsafe = { method: "b", points: [point(1, 2), point(2, 1, { wrong_hidden: 1 })] };
  const unknown = { method: "c", points: [point(1, 2, { wrong_hidden: null })] };
  assert.deepEqual(safeSeries([safe, unsafe, unknown]), [safe, unknown]);
});

test("points without time or error are left out, and series without points", () => {
  const some = { method: "a", points: [point(null, 2), point(0, 2), point(1, null), point(2, 3)] };
  const none = { method: "b", points: [point(null, null)] };
  assert.deepEqual(safeSeries([some, none]), [{ method: "a", points: [point(2, 3)] }]);
  assert.equal(some.points.length, 4);
});

test("the front is what is marked, fastest first", () => {
  const [a, b, c] = [point(2, 2, { front: true }), point(1, 3, { front: true }), point(3, 2, { front: false })];
  assert.deepEqual(frontOf([{ points: [a, c] }, { points: [b] }]), [b, a]);
  assert.deepEqual(frontOf([{ points: [c] }]), []);
});

test("ticks are round and between the ends", () => {
  assert.deepEqual(ticksBetween(0, 1), [1, 2, 5, 10]);
  assert.deepEqual(ticksBetween(-0.5, 0.5), [0.5, 1, 2]);
  assert.deepEqual(ticksBetween(-2, 3), [0.01, 0.1, 1, 10, 100, 1000]);
  assert.deepEqual(ticksBetween(0.1, 0.2), []);
});

test("an axis is logarithmic, with room at its ends", () => {
  const axis = logAxis([1, 100], 0, 230);
  assert.deepEqual(
    [1, 10, 100].map((value) => Math.round(axis.at(value) * 1e6) / 1e6),
    [15, 115, 215],
  );
  assert.deepEqual(axis.ticks, [1, 2, 5, 10, 20, 50, 100]);
  const down = logAxis([1, 100], 230, 0);
  assert.ok(Math.abs(down.at(1) - 215) < 1e-9);
  // A single value stands in the middle.
  assert.ok(Math.abs(logAxis([7], 0, 100).at(7) - 50) < 1e-9);
});

test("exact results have a place on the axis of overestimates", () => {
  assert.equal(aboveOne(point(1, 1)), 1e-4);
  assert.equal(aboveOne(point(1, 1.00001)), 1e-4);
  assert.equal(aboveOne(point(1, 1.5)), 0.5);
});

test("series of other view cells are apart from those that the front compares", () => {
  const [same, old, other] = [{ method: "a", apart: false }, { method: "b" }, { method: "c", apart: true }];
  assert.deepEqual(ofSameCells([other, same, old]), [[same, old], [other]]);
});
