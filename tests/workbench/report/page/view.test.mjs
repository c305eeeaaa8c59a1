import assert from "node:assert/strict";
import test from "node:test";
import * as view from "../../../../workbench/report/page/view.mjs";

const VIEW = { x: 100, y: 50, scale: 2, width: 800, height: 600 };

test("up is y on the ground and against y in pixels, and back again", () => {
  assert.deepEqual([view.toX(VIEW, 100), view.toY(VIEW, 50)], [400, 300]);
  assert.deepEqual([view.toX(VIEW, 110), view.toY(VIEW, 60)], [420, 280]);
  assert.deepEqual(view.groundAt(VIEW, 420, 280), [110, 60]);
});

test("a box is a rectangle from its upper left corner", () => {
  assert.deepEqual(view.rectangle(VIEW, [90, 40, 0, 120, 70, 9]), [380, 260, 60, 60]);
});

test("out of sight is what leaves no pixel within", () => {
  const seen = [
    [0, 0, 1, 1],
    [800, 600, 1, 1],
    [-5, -5, 5, 5],
  ];
  const unseen = [
    [801, 0, 1, 1],
    [0, 601, 1, 1],
    [-6, 0, 5, 5],
    [0, -6, 5, 5],
  ];
  assert.deepEqual(
    [...seen, ...unseen].map((r) => view.outOfSight(VIEW, r)),
    [false, false, false, true, true, true, true],
  );
});

test("a fitted view shows all with a margin of 28 pixels on the tighter side", () => {
  const wide = view.fitted(VIEW, { low: [0, 0], high: [200, 10] });
  assert.deepEqual(wide, { ...VIEW, x: 100, y: 5, scale: (800 - 56) / 200 });
  assert.equal(view.toX(wide, 0), 28);
  const tall = view.fitted(VIEW, { low: [0, 0], high: [10, 200] });
  assert.ok(Math.abs(view.toY(tall, 200) - 28) < 1e-9);
  assert.ok(view.fitted({ ...VIEW, width: 10 }, { low: [0, 0], high: [1, 1] }).scale > 0);
});

test("a zoom keeps the ground under the pixel, within bounds", () => {
  for (const factor of [1.5, 0.2, 1e9, 1e-12]) {
    const nearer = view.zoomed(VIEW, factor, 123, 456);
    assert.equal(nearer.scale, Math.min(Math.max(2 * factor, 1e-6), 10));
    const [before, after] = [view.groundAt(VIEW, 123, 456), view.groundAt(nearer, 123, 456)];
    before.forEach((value, k) => assert.ok(Math.abs(value - after[k]) < 1e-6 / Math.min(1, nearer.scale)));
  }
});

test("a move is in pixels", () => {
  assert.deepEqual(view.moved(VIEW, 60, -20), { ...VIEW, x: 130, y: 40 });
});

test("a plan is as high as the building needs and the window has room for", () => {
  const { wantedHeight } = view;
  assert.equal(wantedHeight({ low: [0, 0], high: [100, 50] }, 1000, 2000), 610);
  assert.equal(wantedHeight({ low: [0, 0], high: [100, 50] }, 1000, 800), 530);
  assert.equal(wantedHeight({ low: [0, 0], high: [100, 5] }, 1000, 2000), 400);
  assert.equal(wantedHeight({ low: [0, 0], high: [100, 500] }, 1000, 300), 400);
});

test("the scale's bar is the longest round length of at most 110 pixels", () => {
  const bar = (scale) => view.scaleBar({ ...VIEW, scale }, 0.01);
  assert.deepEqual(bar(1), { metres: 1, wide: 100 });
  assert.deepEqual(bar(0.5), { metres: 2, wide: 100 });
  assert.deepEqual(bar(0.2), { metres: 5, wide: 100 });
  assert.equal(bar(3).metres, 0.2);
  for (let scale = 1e-5; scale < 10; scale *= 1.7)
    assert.ok(bar(scale).wide <= 110.0001 && bar(scale).wide > 110 / 2.6);
});
