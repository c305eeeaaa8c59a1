import assert from "node:assert/strict";
import test from "node:test";
import { gzipSync } from "node:zlib";
import { Bake, HIDDEN, Relation, SEEN, UNKNOWN, unpack } from "../../../../workbench/report/page/data.mjs";
import { handmade } from "./two_storeys.mjs";

const zipped = (bytes) => gzipSync(bytes).toString("base64");
const packed = (dtype, values) => ({ dtype, shape: [values.length], gzip: zipped(Buffer.from(values.buffer)) });

test("packed arrays of every type come back, values too, at any depth", async () => {
  const arrays = {
    u1: Uint8Array.of(0, 255),
    i1: Int8Array.of(-128, 127),
    u2: Uint16Array.of(0, 65535),
    i2: Int16Array.of(-32768, 32767),
    u4: Uint32Array.of(0, 4294967295),
    i4: Int32Array.of(-2147483648, 2147483647),
  };
  for (const [dtype, values] of Object.entries(arrays)) assert.deepEqual(await unpack(packed(dtype, values)), values);
  const names = ["", "Küche", "</script>"];
  const node = {
    title: "t",
    none: null,
    list: [1, { deep: packed("i1", arrays.i1) }],
    names: { dtype: "json", gzip: zipped(JSON.stringify(names)) },
    empty: packed("u1", new Uint8Array()),
  };
  assert.deepEqual(await unpack(node), {
    title: "t",
    none: null,
    list: [1, { deep: arrays.i1 }],
    names,
    empty: new Uint8Array(),
  });
});

test("rows are targets by differences that begin anew with every source", () => {
  const relation = new Relation(handmade().cellRows, 4);
  assert.deepEqual([...relation.targets], [0, 1, 2, 0, 1, 2, 3]);
  assert.deepEqual([...relation.verdicts(0)], [SEEN, SEEN, UNKNOWN, HIDDEN]);
  assert.deepEqual([...relation.verdicts(1)], [HIDDEN, HIDDEN, HIDDEN, HIDDEN]);
  assert.deepEqual([...relation.verdicts(2)], [SEEN, SEEN, SEEN, HIDDEN]);
  const met = [];
  relation.each(2, (...row) => met.push(row));
  assert.deepEqual(met, [
    [0, SEEN, 3],
    [1, SEEN, 4],
    [2, SEEN, 5],
  ]);
});

test("numbers of a source", () => {
  const relation = new Relation(handmade().cellRows, 4);
  assert.deepEqual(relation.numbers(0), { potential: 3, seen: 2, unknown: 1, over: 1.5 });
  assert.deepEqual(
    relation.numbers(0, (target) => target > 1),
    { potential: 1, seen: 0, unknown: 1, over: Infinity },
  );
  assert.deepEqual(relation.numbers(1), { potential: 0, seen: 0, unknown: 0, over: 1 });
});

test("sightlines lie where the page has them", () => {
  const relation = new Relation(handmade().cellRows, 4);
  const ends = [
    [1, 15, 0.5],
    [40, 15, 0.5],
  ];
  assert.deepEqual(relation.sightline(0, 1), { ends, portals: [0] });
  assert.deepEqual(relation.sightline(2, 1).portals, [1]);
  assert.deepEqual(relation.sightline(2, 2).portals, []);
  // Unknown; seen, but left out of the page; hidden; no row of this source although another has one.
  for (const [source, target] of [
    [0, 2],
    [2, 0],
    [0, 3],
    [1, 0],
  ])
    assert.equal(relation.sightline(source, target), null);
  const moved = new Relation({ ...handmade().cellRows, low: [5, 6, 7], unit: [2, 3, 4] }, 4);
  assert.deepEqual(moved.sightline(0, 0).ends[1], [5 + 2 * 2, 6 + 3 * 2, 7 + 4 * 2]);
});

test("a bake knows its view cells, lengths and storeys", () => {
  const bake = new Bake(handmade());
  assert.deepEqual([bake.cellCount, bake.objectCount, bake.sources], [4, 4, [0, 2, 3]]);
  assert.deepEqual([bake.kinds, bake.level], [["cell", "object"], "Storey"]);
  assert.deepEqual([...bake.box("cell", 1)], [40, 10, 0, 44, 20, 20]);
  assert.equal(bake.metres(25), 2.5);
  assert.equal(bake.diagonal("object", 1), 0.1 * Math.hypot(10, 10, 8));
  assert.equal(bake.diagonal("object", 3), 0);
  // A view cell's storey is stored; the doorway stands on the lowest floor, a box from 30 to 40 on the upper one.
  assert.deepEqual(
    [0, 1, 2, 3].map((cell) => bake.storeyOf("cell", cell)),
    [0, 0, 0, 1],
  );
  bake.objects.boxes.set([0, 0, 30, 1, 1, 40], 6);
  assert.equal(bake.storeyOf("object", 1), 1);
  bake.objects.boxes.set([0, 0, -30, 1, 1, -20], 6);
  assert.equal(bake.storeyOf("object", 1), 0);
});

test("a bake of view cells alone speaks of levels and objects, one without objects of cells", () => {
  const views = new Bake({ ...handmade(), facts: { claimsCells: false, gridMetres: 0.1 } });
  assert.deepEqual([views.kinds, views.level], [["object"], "Level"]);
  const bare = handmade();
  Object.assign(bare.objects, { names: [], boxes: new Int32Array(), role: new Uint8Array() });
  assert.deepEqual(new Bake(bare).kinds, ["cell"]);
});
