import assert from "node:assert/strict";
import test from "node:test";
import { clickAt, pressKey, tipWords } from "../../../../workbench/report/page/pointing.mjs";
import { chosen } from "./two_storeys.mjs";

// In a plan of 840 by 400 pixels the ground's (0, 40) is the upper left corner, a step 10 pixels.
const pixel = (x, y) => [10 * x, 10 * (40 - y)];

test("a click picks the view cell there, or none", () => {
  const state = chosen();
  clickAt(state, ...pixel(60, 10), false);
  assert.equal(state.cell, 2);
  clickAt(state, ...pixel(42, 15), false);
  assert.equal(state.cell, 2);
});

test("clicks where view cells lie above each other pick one after the other and keep the storey", () => {
  const state = chosen((data) => {
    data.cells.boxes.set([0, 0, 0, 30, 30, 30], 12);
    data.cells.boxes.set([0, 0, 8, 20, 20, 30], 18);
  });
  const met = [0, 1, 2, 3].map(() => {
    clickAt(state, ...pixel(10, 10), false);
    return [state.cell, state.storey];
  });
  // From cell 0, the largest and last, the smallest is next.
  assert.deepEqual(met, [
    [3, 0],
    [2, 0],
    [0, 0],
    [3, 0],
  ]);
});

test("a click that asks chooses the target there, or forgets it", () => {
  const state = chosen();
  clickAt(state, ...pixel(60, 10), true);
  assert.deepEqual([state.cell, state.target], [0, { kind: "cell", id: 2 }]);
  clickAt(state, ...pixel(20, 20), true);
  assert.equal(state.target, null);
});

test("the tip says what is under the pointer", () => {
  const state = chosen();
  assert.equal(tipWords(state, { kind: "cell", id: 2 }, [2]), "Cell 2 (Room 7)\nUNKNOWN from view cell 0");
  assert.equal(tipWords(state, { kind: "object", id: 1 }, []), "Object 1\nHIDDEN from view cell 0");
  assert.equal(tipWords(state, null, [0]), "The view cell, 0 (hall)");
  assert.equal(tipWords(state, null, []), "");
  state.pickRoom(1);
  assert.equal(tipWords(state, { kind: "object", id: 1 }, []), "Object 1\nSEEN from room suite, Upper");
  assert.equal(tipWords(state, null, [2]), "A view cell of the room, 2 (Room 7)");
  state.pick(0);
  const above = "2 view cells above each other: click again for the next";
  assert.equal(tipWords(state, null, [2, 3]), above);
  assert.equal(tipWords(state, null, [0, 3]), `The view cell, 0 (hall)\n${above}`);
  state.set({ mode: "inspect" });
  assert.equal(tipWords(state, null, [2, 3]), "");
});

test("keys pick, pan, zoom, change the storey and forget", () => {
  const state = chosen();
  state.view.scale = 4;
  const press = (key, shiftKey = false) => pressKey(state, { key, shiftKey });
  assert.ok(press("ArrowRight"));
  assert.equal(state.cell, 2);
  assert.ok(press("ArrowUp", true) && press("ArrowRight", true));
  assert.deepEqual([state.view.x, state.view.y], [57, 35]);
  const { scale } = state.view;
  assert.ok(press("-") && state.view.scale < scale && press("+") && press("="));
  assert.ok(state.view.scale > scale);
  assert.ok(press("0"));
  assert.deepEqual([state.view.x, state.view.y], [42, 20]);
  assert.ok(press("PageUp"));
  assert.equal(state.storey, 1);
  assert.ok(press("PageDown"));
  assert.equal(state.storey, 0);
  state.set({ target: { kind: "cell", id: 0 } });
  assert.ok(press("Escape"));
  assert.equal(state.target, null);
  assert.ok(!press("x") && !press("Tab"));
});
