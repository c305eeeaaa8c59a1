import assert from "node:assert/strict";
import test from "node:test";
import { classesOf, keptWords, numbersFrom, pathOf, reached, roomFacts } from "../../../../workbench/report/page/inspector.mjs";
import { chosen } from "./two_storeys.mjs";

test("classes of targets are counted apart", () => {
  const { bake } = chosen();
  const counted = classesOf(bake).map(([name, kind, belongs, all]) => [name, kind, all, [0, 1, 2, 3].filter(belongs)]);
  assert.deepEqual(counted, [
    ["Inhabitable cells", "cell", 3, [0, 2, 3]],
    ["Other cells", "cell", 1, [1]],
    ["Objects", "object", 4, [0, 1, 2, 3]],
  ]);
  const names = (change) => classesOf({ ...bake, ...change }).map(([name]) => name);
  assert.deepEqual(names({ facts: { claimsCells: false } }), ["Objects"]);
  assert.deepEqual(names({ objectCount: 0 }), ["Inhabitable cells", "Other cells"]);
});

test("how much of the objects is kept", () => {
  const { bake } = chosen();
  const { potential } = bake.relations.object.numbers(0);
  assert.ok(potential > 0 && potential < 4);
  assert.equal(keptWords(bake, 0), `; keeps ${25 * potential}.0 % of the objects`);
  assert.equal(keptWords({ ...bake, objectCount: 0 }, 0), "");
});

test("what is reached on each storey", () => {
  const state = chosen((data) => {
    // The hall sees the room above; the doorway is no view cell and does not count.
    Object.assign(data.cellRows, { starts: Uint8Array.of(0, 4, 4, 4, 4), gaps: Uint8Array.of(0, 1, 1, 1) });
    data.cellRows.codes = Uint8Array.of(2, 2, 0, 2);
  });
  assert.deepEqual(reached(state), [
    [0, 1, 1],
    [0, 0, 1],
  ]);
  state.set({ layer: "object" });
  assert.deepEqual(reached(state), [
    [0, 1, 1],
    [0, 0, 0],
  ]);
});

test("a sightline's path goes through each portal to the cell behind it", () => {
  const { bake } = chosen();
  const there = [
    { portal: 0, cell: 1 },
    { portal: 1, cell: 2 },
  ];
  const back = [
    { portal: 1, cell: 1 },
    { portal: 0, cell: 0 },
  ];
  assert.deepEqual(pathOf(bake, 0, [0, 1]), there);
  assert.deepEqual(pathOf(bake, 2, [1, 0]), back);
  assert.deepEqual(pathOf(bake, 0, []), []);
});

test("a room in words and numbers: of all its view cells together", () => {
  const state = chosen();
  state.pickRoom(1);
  const every = () => true;
  assert.equal(roomFacts(state.bake, 1), "2 view cells (2, 3) together; they hold 96 % of where eyes may be in it");
  const guid = "0BTBFw6f90Nfh9rP1dlXrr";
  const facts = `1 view cell (0) together; it holds 100 % of where eyes may be in it; storey at -0.50 m by the file; ${guid}`;
  assert.equal(roomFacts(state.bake, 0), facts);
  assert.deepEqual(numbersFrom(state, "cell", every), { potential: 4, seen: 4, unknown: 0, over: 1 });
  assert.deepEqual(numbersFrom(state, "object", every), { potential: 1, seen: 1, unknown: 0, over: 1 });
  assert.deepEqual(reached(state), [
    [0, 0, 2],
    [0, 0, 1],
  ]);
  const many = chosen((data) => {
    data.rooms.starts.set([0, 1, 18, 18]);
    data.rooms.cells = new Uint8Array(18).fill(2);
  });
  assert.match(roomFacts(many.bake, 1), /^17 view cells \((2, ){16}\.\.\.\) together/);
  const beside = chosen((data) => {
    data.cells.firstPlan = 3;
  });
  assert.match(roomFacts(beside.bake, 1), /nothing is claimed of the cells that these see$/);
});
