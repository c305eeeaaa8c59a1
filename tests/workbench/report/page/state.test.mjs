import assert from "node:assert/strict";
import test from "node:test";
import { HIDDEN, SEEN, UNCLAIMED, UNKNOWN } from "../../../../workbench/report/page/data.mjs";
import { LISTED } from "../../../../workbench/report/page/state.mjs";
import { chosen } from "./two_storeys.mjs";

test("who listens to a field is told of it, in order, whether it changed or not", () => {
  const state = chosen(),
    heard = [];
  state.on("a b", (told) => heard.push(["first", told === state, told.a]));
  state.on("b", () => heard.push("second"));
  state.set({ a: 1 });
  state.set({ c: 2 });
  state.set({ b: 3, a: 1 });
  assert.deepEqual(heard, [["first", true, 1], ["first", true, 1], "second"]);
});

test("a picked view cell brings its verdicts and storey and forgets the target", () => {
  const state = chosen();
  assert.deepEqual([state.cell, [...state.verdicts.cell]], [0, [SEEN, SEEN, UNKNOWN, HIDDEN]]);
  state.set({ target: { kind: "cell", id: 1 }, hover: { kind: "cell", id: 2 }, listed: 3 * LISTED });
  state.pick(3);
  assert.deepEqual([state.cell, state.storey, state.target, state.hover, state.listed], [3, 1, null, null, LISTED]);
  assert.deepEqual([...state.verdicts.object], [HIDDEN, HIDDEN, HIDDEN, HIDDEN]);
  state.pick(2, { keepStorey: true });
  assert.deepEqual([state.cell, state.storey], [2, 1]);
});

test("what is no view cell cannot be picked", () => {
  const state = chosen();
  state.on("cell", () => assert.fail("picked"));
  for (const none of [1, 4, -1, undefined]) state.pick(none);
  assert.equal(state.cell, 0);
});

test("a storey stays where it is when its view cell is picked again", () => {
  const state = chosen();
  state.on("storey", () => assert.fail("moved"));
  state.pick(2);
});

test("steps go round, storeys end", () => {
  const state = chosen();
  const way = [1, 1, 1, -1].map((step) => {
    state.step(step);
    return state.cell;
  });
  assert.deepEqual(way, [2, 3, 0, 3]);
  for (const [asked, shown] of [
    [0, 0],
    [7, 1],
    [-2, 0],
  ]) {
    state.show(asked);
    assert.equal(state.storey, shown);
  }
});

test("the sightline is that of the chosen cell", () => {
  const state = chosen();
  assert.deepEqual(state.sightline({ kind: "cell", id: 1 }).portals, [0]);
  assert.equal(state.sightline({ kind: "object", id: 0 }), null);
  state.pick(2);
  assert.deepEqual(state.sightline({ kind: "cell", id: 1 }).portals, [1]);
});

test("zoom is about the view cell in sight, else about the middle", () => {
  const state = chosen();
  state.view.scale = 4;
  state.zoomHere(2);
  // The hall's middle (20, 20) was 88 pixels left of the plan's middle, and still is.
  assert.deepEqual(state.view, { x: 31, y: 20, scale: 8, width: 840, height: 400 });
  state.show(1);
  state.zoomHere(0.5);
  assert.deepEqual([state.view.x, state.view.y, state.view.scale], [31, 20, 4]);
  state.fit();
  assert.deepEqual([state.view.x, state.view.y], [42, 20]);
});

test("a room is looked from by all its view cells: what one of them sees is seen", () => {
  const state = chosen((data) => {
    data.objectRows.starts.set([0, 2, 2, 3, 5]);
    data.objectRows.gaps = Uint8Array.of(0, 2, 1, 0, 1);
    data.objectRows.codes = Uint8Array.of(2, 0, 2, 0, 0);
  });
  state.pickRoom(1);
  assert.deepEqual([state.room, state.cell, state.from, state.storey], [1, 2, [2, 3], 0]);
  // Cell 2 sees cells 0, 1, 2 and object 1; cell 3 itself, and perhaps objects 0 and 1.
  assert.deepEqual([...state.verdicts.cell], [SEEN, SEEN, SEEN, SEEN]);
  assert.deepEqual([...state.verdicts.object], [UNKNOWN, SEEN, HIDDEN, HIDDEN]);
  // The page has a sightline from cell 2 alone.
  assert.equal(state.seenFrom({ kind: "cell", id: 1 }), 2);
  assert.deepEqual(state.sightline({ kind: "cell", id: 1 }).portals, [1]);
  assert.equal(state.sightline({ kind: "object", id: 0 }), null);
  state.pick(0);
  assert.deepEqual([state.room, state.from], [-1, [0]]);
});

test("a room without view cells cannot be picked", () => {
  const state = chosen();
  state.on("cell room", () => assert.fail("picked"));
  state.pickRoom(2);
  assert.equal(state.room, -1);
});

test("of cells that only view cells at an angle might see nothing is claimed", () => {
  const state = chosen((data) => {
    data.cells.firstPlan = 3;
    data.cells.plans = Int32Array.of(0, 0, 40, 0, 40, 40, 0, 40);
    data.cellRows.starts.set([0, 3, 3, 6, 6]);
    data.cellRows.gaps = Int8Array.of(0, 1, 1, 1, 1, 0);
    data.cellRows.codes = Uint8Array.of(1, 1, 0, 0, 1, 1);
    data.cellRows.starts.set([0, 3, 3, 5, 5]);
  });
  state.pickRoom(1);
  // Cell 2 hides cell 0, of which the other says nothing; both see themselves.
  assert.deepEqual([...state.verdicts.cell], [UNCLAIMED, UNKNOWN, SEEN, SEEN]);
});
