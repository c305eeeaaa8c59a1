import assert from "node:assert/strict";
import test from "node:test";
import { answer } from "../../../../workbench/view/page/answer.mjs";
import { Reasons } from "../../../../workbench/view/page/reasons.mjs";

/** A view cell 0, which may see objects 0 and 1 and cell 1; 1 without a witness; object 2 and cell 2 are hidden. */
const database = {
  head: { names: ["desk", "lamp", "safe"] }, clear: [0, 0, 0],
  setOf: (cell) => (cell === 0 ? { potential: [0, 1], unknown: new Set([1]) } : null),
  isPotential: (cell, id) => id < 2,
  reachOf: (cell) => (cell === 0 ? new Set([0, 1]) : null),
  boxOf: (id) => [10 * id, 0, 0, 10 * id + 1, 1, 1],
  trianglesOf: (id) => [10 * id, 0, 0, 10 * id + 1, 0, 0, 10 * id, 1, 0],
  cellBoxes: Float32Array.from([0, 0, 0, 1, 1, 1, 5, 0, 0, 6, 1, 1, 20, 0, 0, 21, 1, 1]),
};
const RECTANGLE = [15, 0, 0, 15, 2, 0, 15, 2, 2, 15, 0, 2];

function reasons(certified) {
  return new Reasons({ certified }, {
    objectPairs: Int32Array.from([0, 0]), objectLines: Float32Array.from([4, 0.2, 0, 0.5, 0.2, 0]),
    cellPairs: Int32Array.from([0, 1]), cellLines: Float32Array.from([1, 0.5, 0.5, 5, 0.5, 0.5]),
    sequenceStarts: Uint32Array.from([0, 2]), sequences: Uint32Array.from([3, 4]),
    proofCells: Int32Array.from([0, 0, 1]), proofBoxes: Float32Array.from([19, 0, 0, 22, 2, 2, 30, 0, 0, 31, 1, 1, 0, 0, 0, 99, 9, 9]),
    proofStarts: Uint32Array.from([0, 1, 2, 3]), proofBlockers: Uint32Array.from([1, 0, 0]),
    blockerStarts: Uint32Array.from([0, 2, 3]), blockerCorners: Float32Array.from([...new Array(24).fill(0), ...RECTANGLE]),
  });
}

test("what is seen has a sightline and what it clears", () => {
  const found = answer(database, reasons(true), 0, "object", 0);
  assert.equal(found.verdict, "seen");
  assert.deepEqual(found.line.to.map((x) => Math.round(10 * x)), [5, 2, 0]);
  assert.equal(found.clear.id, 1);
  assert.equal(found.text, "A sightline of 3.50 m leads from this cell to it, clear of everything else by 6.00 m (lamp).");
});

test("a cell has the portals on the way", () => {
  const found = answer(database, reasons(true), 0, "cell", 1);
  assert.equal(found.verdict, "seen");
  assert.deepEqual(found.line.portals, [3, 4]);
  assert.match(found.text, /through 2 portals/);
});

test("what is unknown is kept", () => {
  const found = answer(database, reasons(true), 0, "object", 1);
  assert.equal(found.verdict, "unknown");
  assert.match(found.text, /^No sightline was found, and it is not proved hidden/);
});

test("what is hidden has the occluders that proofs of its place name, and no others", () => {
  for (const [kind, id] of [["object", 2], ["cell", 2]]) {
    const found = answer(database, reasons(true), 0, kind, id);
    assert.equal(found.verdict, "hidden");
    assert.deepEqual(found.corners, RECTANGLE);
    assert.equal(found.text, "Proved hidden: 1 proof for where it is, by 1 occluder, drawn.");
  }
});

test("what is not held is said", () => {
  assert.match(answer(database, reasons(false), 0, "object", 2).text, /--certify/);
  const nothing = new Reasons({ certified: null }, {});
  for (const id of [0, 2]) assert.match(answer(database, nothing, 0, "object", id).text, /made without its bake/);
  const outside = answer(database, nothing, 2, "object", 0);
  assert.equal(outside.verdict, null);
  assert.match(outside.text, /Nothing is claimed/);
});

test("all sightlines of a cell to others", () => {
  assert.deepEqual(reasons(true).sightlinesOf(0).map(({ portals }) => portals), [[3, 4]]);
  assert.deepEqual(reasons(true).sightlinesOf(1), []);
  assert.deepEqual(new Reasons({ certified: null }, {}).sightlinesOf(0), []);
});
