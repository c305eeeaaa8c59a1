import assert from "node:assert/strict";
import test from "node:test";
import { labelPlaces } from "../../../../workbench/report/page/labels.mjs";

const SIZE = 10;
const box = ({ x, y }, text) => [x - 3.1 * text.length, y - 5.5, x + 3.1 * text.length, y + 5.5];
const meet = (a, b) => a[0] < b[2] - 1e-6 && b[0] < a[2] - 1e-6 && a[1] < b[3] - 1e-6 && b[1] < a[3] - 1e-6;

test("labels of points at one place stand apart, off the marks and inside", () => {
  const labels = ["0", "1", "4", "1024", "256", "64", "16", "2"].map((text, n) => ({ x: 100 + n, y: 8, text })),
    marks = [{ x: 130, y: 12 }],
    inside = [0, 0, 200, 200];
  const found = labelPlaces(labels, marks, inside, SIZE).map((place, n) => box(place, labels[n].text));
  for (const [n, a] of found.entries()) {
    assert.ok(a[0] >= -1e-6 && a[1] >= -1e-6 && a[2] <= 200 && a[3] <= 200, `label ${n} reaches out`);
    for (const b of found.slice(n + 1)) assert.ok(!meet(a, b), `label ${n} is under another`);
    for (const { x, y } of [...labels, ...marks]) assert.ok(!meet(a, [x - 4, y - 4, x + 4, y + 4]), `${n} on a mark`);
  }
});

test("a label alone stands close to its point, upwards to the right", () => {
  const [only] = labelPlaces([{ x: 50, y: 50, text: "12" }], [], [0, 0, 100, 100], SIZE);
  assert.ok(only.x > 50 && only.y < 50 && !only.far);
});

test("without room a label is still placed", () => {
  const crowd = Array.from({ length: 40 }, (_, n) => ({ x: 5, y: 5, text: `${n}` }));
  assert.equal(labelPlaces(crowd, [], [0, 0, 10, 10], SIZE).length, 40);
});
