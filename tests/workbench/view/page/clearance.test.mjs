import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
import { clearance } from "../../../../workbench/view/page/clearance.mjs";

const VECTORS = JSON.parse(readFileSync(new URL("clearances.json", import.meta.url)));
const EVERYWHERE = [-99, -99, -99, 99, 99, 99];

test("distances are those of the check of witnesses", () => {
  for (const { line, triangle, distance } of VECTORS) {
    const found = clearance(line.slice(0, 3), line.slice(3), [7], () => EVERYWHERE, () => triangle);
    assert.ok(Math.abs(found.distance - distance) < 1e-9, JSON.stringify({ line, triangle, found }));
    assert.ok(Math.abs(Math.hypot(...found.on.map((x, k) => x - found.at[k])) - distance) < 1e-9);
    assert.equal(found.id, 7);
  }
});

test("the nearest of many, in whatever order, is found although boxes leave some out", () => {
  const shapes = VECTORS.map(({ triangle }) => triangle);
  const box = (id) => [0, 3].flatMap((end) => [0, 1, 2].map((k) =>
    Math[end ? "max" : "min"](...[0, 3, 6].map((n) => shapes[id][n + k]))));
  const ids = [...shapes.keys()];
  for (const { line } of VECTORS) {
    const [from, to] = [line.slice(0, 3), line.slice(3)];
    const least = Math.min(...ids.map((id) => clearance(from, to, [id], box, (k) => shapes[k]).distance));
    for (const order of [ids, ids.toReversed()]) {
      assert.equal(clearance(from, to, order, box, (k) => shapes[k]).distance, least);
    }
  }
});

test("a near one is found behind a far one, on any side", () => {
  for (const axis of [0, 1, 2]) {
    for (const sign of [1, -1]) {
      const shapes = [6, 2, 4].map((far) => [0, 1, 2].flatMap((n) => {
        const corner = [0.5, 0.5, 0.5];
        corner[(axis + 1) % 3] += 0.1 * n;
        corner[axis] = sign * far + (sign > 0 ? 1 : 0);
        return corner;
      }));
      const box = (id) => [0, 3].flatMap((end) => [0, 1, 2].map((k) =>
        Math[end ? "max" : "min"](...[0, 3, 6].map((n) => shapes[id][n + k]))));
      const to = [0.5, 0.5, 0.5];
      to[axis] = 1;
      const from = [0.5, 0.5, 0.5];
      from[axis] = 0;
      assert.deepEqual(clearance(from, to, [0, 1, 2], box, (id) => shapes[id]).distance, 2);
    }
  }
});

test("nothing is near where there is nothing", () => {
  assert.equal(clearance([0, 0, 0], [1, 1, 1], [], () => EVERYWHERE, () => []), null);
});
