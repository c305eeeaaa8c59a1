import assert from "node:assert/strict";
import test from "node:test";
import { legendItems } from "../../../../workbench/report/page/legend.mjs";
import * as words from "../../../../workbench/report/page/words.mjs";
import { chosen } from "./two_storeys.mjs";

test("numbers in words", () => {
  assert.deepEqual([0, 999, 1234567].map(words.count), ["0", "999", "1,234,567"]);
  const things = [0, 1, 2, 1000].map((n) => words.counted(n, "view cell"));
  assert.deepEqual(things, ["0 view cells", "1 view cell", "2 view cells", "1,000 view cells"]);
  assert.deepEqual([1, 1.23456, Infinity].map(words.ratio), ["1.000", "1.235", "no witness"]);
  assert.equal(words.size(chosen().bake, [0, 10, 20, 15, 30, 50]), "1.50 × 2.00 × 3.00 m");
});

test("cells and objects are called by number and, if they have one, name", () => {
  const { bake } = chosen();
  assert.deepEqual([words.label(3, "x"), words.label(3, "")], ["3 · x", "3"]);
  assert.deepEqual(
    [0, 1].map((cell) => words.cellName(bake, cell)),
    ["0 (hall)", "1"],
  );
  const called = [
    ["cell", 2],
    ["cell", 1],
    ["object", 0],
    ["object", 1],
  ];
  assert.deepEqual(
    called.map(([kind, id]) => words.describe(bake, kind, id)),
    ["Cell 2 (Room 7)", "Cell 1", "Object 0 (wall)", "Object 1"],
  );
  assert.deepEqual(
    called.map(([kind, id]) => words.nature(bake, kind, id)),
    ["inhabitable cell", "wall, sliver or exterior cell", "IfcWall, occluder", "IfcDesk, detail"],
  );
  bake.objects.kinds = [""];
  assert.equal(words.nature(bake, "object", 2), "object, transparent");
});

test("the legend names what the plan can show", () => {
  const { bake } = chosen();
  const shown = (layer, change = {}) => legendItems({ ...bake, ...change }, layer).map(([, word]) => word);
  const cells = ["view cell", "cell seen", "cell unknown", "cell hidden", "no cell"];
  const surfaces = ["occluder", "detail", "transparent"];
  assert.deepEqual(shown("cell"), [...cells, ...surfaces, "portal", "sightline", "target"]);
  const objects = ["view cell", "object seen", "object unknown", "object hidden"];
  assert.deepEqual(shown("object"), [...objects, "portal", "sightline", "target"]);
  const bare = { objectCount: 0, objects: { role: [] }, portals: { axis: [] } };
  assert.deepEqual(shown("cell", bare), [...cells, "sightline", "target"]);
});
