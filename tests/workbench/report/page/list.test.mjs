import assert from "node:assert/strict";
import test from "node:test";
import { SEEN } from "../../../../workbench/report/page/data.mjs";
import * as list from "../../../../workbench/report/page/list.mjs";
import { LISTED } from "../../../../workbench/report/page/state.mjs";
import { chosen } from "./two_storeys.mjs";

test("targets are listed by verdict, without the view cell itself", () => {
  const state = chosen();
  assert.deepEqual(list.targetsByVerdict(state, "cell"), [[3], [2], [1]]);
  assert.deepEqual(list.targetsByVerdict(state, "object"), [[1, 3], [2], [0]]);
});

test("of a room's targets its own view cells are left out", () => {
  const state = chosen();
  state.pickRoom(1);
  assert.deepEqual(list.targetsByVerdict(state, "cell"), [[], [], [0, 1]]);
});

test("large targets come first, inhabitable cells before them all", () => {
  const state = chosen((data) => data.cells.boxes.set([0, 0, 0, 999, 999, 999], 6));
  assert.deepEqual(list.bySize(state.bake, "cell", [0, 1, 2, 3]), [0, 3, 2, 1]);
  assert.deepEqual(list.bySize(state.bake, "object", [0, 1, 2, 3]), [0, 2, 1, 3]);
});

test("a list holds so many, and says how many are left", () => {
  const state = chosen();
  assert.deepEqual(list.listing(state), { counts: [1, 1, 1], ids: [2], left: 1 - LISTED });
  state.set({ listKind: "object", listVerdict: 0, listed: 1 });
  assert.deepEqual(list.listing(state), { counts: [2, 1, 1], ids: [1], left: 1 });
  state.set({ listed: 2 });
  assert.deepEqual(list.listing(state), { counts: [2, 1, 1], ids: [1, 3], left: 0 });
  state.set({ listVerdict: SEEN });
  assert.deepEqual(list.listing(state).ids, [0]);
});

test("a view cell is found by id or name", () => {
  const { bake } = chosen();
  const found = (text) => list.findSource(bake, text);
  assert.deepEqual(["0", " 2 ", "2 · Room 7", "3"].map(found), [0, 2, 2, 3]);
  assert.deepEqual(["hall", "HALL", "room 7", "oom"].map(found), [0, 0, 2, 2]);
  assert.deepEqual(["1", "4", "", "  ", "cellar", "2 x"].map(found), Array(6).fill(undefined));
  // A whole name goes before an earlier one that holds it.
  bake.cells.names = ["hall of rooms", "", "room", ""];
  assert.equal(found("room"), 2);
});

test("view cells are sorted by a column, ties by what is unknown and then by id", () => {
  const { bake } = chosen();
  const order = (kind, key, down) => list.sortedCells(bake, kind, { key, down }).map((row) => row.cell);
  assert.deepEqual(order("cell", "over", true), [0, 2, 3]);
  assert.deepEqual(order("cell", "potential", false), [3, 0, 2]);
  assert.deepEqual(order("cell", "cell", true), [3, 2, 0]);
  assert.deepEqual(order("cell", "storey", true), [3, 0, 2]);
  assert.deepEqual(order("cell", "name", false), [3, 0, 2]);
  assert.deepEqual(order("object", "seen", false), [3, 0, 2]);
  assert.deepEqual(list.sortedCells(bake, "cell", { key: "cell", down: false })[0], {
    cell: 0,
    name: "hall",
    storey: 0,
    potential: 3,
    seen: 2,
    unknown: 1,
    over: 1.5,
  });
});

test("names sort by the numbers in them, and cells without any witness as the worst", () => {
  const named = chosen((data) => {
    data.cells.names = ["room 10", "", "room 9", "Room 2"];
  });
  const order = (state, key, down) => list.sortedCells(state.bake, "cell", { key, down }).map((row) => row.cell);
  assert.deepEqual(order(named, "name", false), [3, 2, 0]);
  const blind = chosen((data) => data.cellRows.codes.set([0, 0, 0, 0, 0, 0]));
  assert.deepEqual(order(blind, "over", true), [0, 2, 3]);
  assert.deepEqual(order(blind, "over", false), [3, 0, 2]);
  const tied = chosen((data) => data.cellRows.codes.set([1, 1, 2, 0, 1, 1]));
  assert.deepEqual(order(tied, "potential", true), [2, 0, 3]);
});
