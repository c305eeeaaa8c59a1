import assert from "node:assert/strict";
import test from "node:test";
import { findAll, findWords, takeFind } from "../../../../workbench/report/page/search.mjs";
import { chosen } from "./two_storeys.mjs";

const found = (text) => findAll(chosen().bake, text).map(({ what, id }) => `${what} ${id}`);

test("rooms are found by both names, storey and GUID, objects by name, kind and GUID", () => {
  assert.deepEqual(found("hall"), ["room 0"]);
  assert.deepEqual(found(" 1 HALL "), ["room 0"]);
  assert.deepEqual(found("upper"), ["room 1"]);
  assert.deepEqual(found("pane"), ["object 2"]);
  assert.deepEqual(found("2O2Fr$"), ["object 0"]);
  // The same GUID begins a room's and an object's: case does not matter, and rooms come first.
  assert.deepEqual(found("0btbfw6f90nfh9rp1dlxr"), ["room 0", "object 2"]);
  assert.deepEqual(found("0BTBFw6f90Nfh9rP1dlXr2"), ["object 2"]);
  assert.deepEqual([found(""), found("  "), found("cellar")], [[], [], []]);
});

test("what is called so comes before what begins so, and that before the rest", () => {
  const state = chosen((data) => {
    data.objects.names = ["my void", "voids", "void", ""];
  });
  const order = findAll(state.bake, "void").map(({ what, id }) => `${what} ${id}`);
  assert.deepEqual(order, ["room 2", "object 2", "object 1", "object 0"]);
});

test("a whole kind brings its objects, a part of one the kind alone", () => {
  assert.deepEqual(found("IfcDesk"), ["kind 0", "object 1", "object 2", "object 3"]);
  assert.deepEqual(found("desk"), ["kind 0"]);
});

test("finds in words", () => {
  const { bake } = chosen();
  const words = (what, id) => findWords(bake, { what, id });
  assert.deepEqual(words("room", 0), ["Room 1 Hall, Ground", "1 view cell"]);
  assert.deepEqual(words("room", 1), ["Room suite, Upper", "2 view cells"]);
  assert.deepEqual(words("room", 2), ["Room void", "no view cell"]);
  assert.deepEqual(words("kind", 0), ["IfcDesk", "3 objects"]);
  assert.deepEqual(words("object", 2), ["2 · pane", "IfcDesk"]);
});

test("a room that is taken is looked from, an object is the target, a kind is searched for", () => {
  const state = chosen();
  assert.equal(takeFind(state, { what: "room", id: 1 }), "");
  assert.deepEqual([state.room, state.from], [1, [2, 3]]);
  takeFind(state, { what: "object", id: 1 });
  assert.deepEqual([state.target, state.storey, state.room], [{ kind: "object", id: 1 }, 0, 1]);
  takeFind(state, { what: "room", id: 2 });
  assert.equal(state.room, 1);
  assert.equal(takeFind(state, { what: "kind", id: 1 }), "IfcWall");
});
