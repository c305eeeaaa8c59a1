import assert from "node:assert/strict";
import test from "node:test";
import { Bake } from "../../../../workbench/report/page/data.mjs";
import * as storeys from "../../../../workbench/report/page/storeys.mjs";
import { chosen, handmade } from "./two_storeys.mjs";

const views = (data) => Object.assign(data.facts, { claimsCells: false });

test("a section cuts a box between its floor and its ceiling", () => {
  const box = [0, 0, 10, 1, 1, 20];
  assert.deepEqual(
    [9.5, 10, 10.5, 19.5, 20, 20.5].map((level) => storeys.cutBy(box, { level })),
    [false, false, true, true, false, false],
  );
});

test("the extent is that of the view cells, with the objects only where nothing is said of cells", () => {
  assert.deepEqual(new Bake(handmade()).extent, { low: [0, 0], high: [84, 40] });
  const data = handmade();
  views(data);
  // The empty object, whose low is above its high, does not count.
  data.objects.boxes.set([-500, -500, 1, -900, -900, 0], 18);
  assert.deepEqual(new Bake(data).extent, { low: [-4, -4], high: [84, 44] });
});

test("a storey's plan has what its section cuts and its own view cells; view cells lie above, small above large", () => {
  const data = handmade();
  assert.deepEqual(new Bake(data).on("cell", 0), [1, 0, 2]);
  assert.deepEqual(new Bake(data).on("cell", 1), [3]);
  // A gallery of the storey above the cut stays on it; a shaft through both storeys is on both.
  data.cells.boxes.set([0, 0, 20, 40, 40, 30], 0);
  data.cells.boxes.set([40, 10, 0, 44, 20, 60], 6);
  assert.deepEqual(new Bake(data).on("cell", 0), [1, 0, 2]);
  assert.deepEqual(new Bake(data).on("cell", 1), [1, 3]);
  views(data);
  assert.deepEqual(new Bake(data).on("cell", 0), [0, 2]);
});

test("a storey's objects stand on its floor or are cut; slabs are neither", () => {
  const data = handmade();
  assert.deepEqual(new Bake(data).on("object", 0), [0, 1, 2]);
  assert.deepEqual(new Bake(data).on("object", 1), []);
  data.objects.boxes.set([0, 0, -4, 90, 90, 0], 0);
  assert.deepEqual(new Bake(data).on("object", 0), [1, 2]);
  data.objects.boxes.set([0, 0, 13, 90, 90, 30], 0);
  assert.deepEqual(new Bake(data).on("object", 0), [1, 2]);
});

test("a point is in the view cells that hold it, their edges included", () => {
  const state = chosen();
  assert.deepEqual(storeys.sourcesAt(state, [20, 20]), [0]);
  assert.deepEqual(storeys.sourcesAt(state, [0, 40]), [0]);
  assert.deepEqual(storeys.sourcesAt(state, [42, 15]), []);
  assert.deepEqual(storeys.sourcesAt(state, [-0.1, 20]), []);
  assert.deepEqual(storeys.sourcesAt(state, [60, 35]), []);
  state.show(1);
  assert.deepEqual(storeys.sourcesAt(state, [20, 20]), [3]);
  assert.deepEqual(storeys.sourcesAt(state, [60, 20]), []);
});

test("of view cells at one point those cut come first, then the smallest", () => {
  const overlapping = (data) => {
    data.cells.boxes.set([0, 0, 0, 30, 30, 30], 12);
    data.cells.boxes.set([0, 0, 20, 20, 20, 30], 18);
    data.cells.storey[3] = 0;
  };
  assert.deepEqual(storeys.sourcesAt(chosen(overlapping), [10, 10]), [2, 0, 3]);
});

test("the target under a point is of the coloured kind, and never the view cell", () => {
  const state = chosen();
  assert.deepEqual(storeys.targetAt(state, [60, 15]), { kind: "cell", id: 2 });
  assert.deepEqual(storeys.targetAt(state, [42, 15]), { kind: "cell", id: 1 });
  assert.equal(storeys.targetAt(state, [20, 20]), null);
  assert.equal(storeys.targetAt(state, [500, 500]), null);
  state.set({ layer: "object" });
  assert.deepEqual(storeys.targetAt(state, [65, 15]), { kind: "object", id: 1 });
  // Three pixels are 0.3 steps here.
  assert.deepEqual(storeys.targetAt(state, [70.29, 15]), { kind: "object", id: 1 });
  assert.equal(storeys.targetAt(state, [70.31, 15]), null);
  state.view.scale = 1;
  assert.deepEqual(storeys.targetAt(state, [72.9, 15]), { kind: "object", id: 1 });
});

test("arrows find the nearest view cell ahead on the storey", () => {
  const state = chosen();
  const ways = { left: [-1, 0], right: [1, 0], up: [0, 1], down: [0, -1] };
  const found = () => Object.values(ways).map((way) => storeys.neighbour(state, way));
  assert.deepEqual(found(), [undefined, 2, undefined, undefined]);
  state.pick(2);
  assert.deepEqual(found(), [0, undefined, undefined, undefined]);
  // From another storey than the view cell's any arrow leads to this storey's first.
  state.show(1);
  assert.deepEqual(found(), [3, 3, 3, 3]);
});

test("of two ahead the nearer and straighter one is found", () => {
  const three = (data) => {
    data.cells.boxes.set([100, 0, 0, 140, 40, 30], 12);
    data.cells.boxes.set([60, 20, 0, 100, 60, 30], 18);
    data.cells.storey[3] = 0;
  };
  // Cell 3 lies 60 ahead and 20 aside, cell 2 lies 100 straight ahead: they are as good, and the first is taken.
  assert.equal(storeys.neighbour(chosen(three), [1, 0]), 2);
  const nearer = (data) => {
    three(data);
    data.cells.boxes.set([60, 19, 0, 100, 59, 30], 18);
  };
  assert.equal(storeys.neighbour(chosen(nearer), [1, 0]), 3);
});
