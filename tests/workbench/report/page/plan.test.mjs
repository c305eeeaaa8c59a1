import assert from "node:assert/strict";
import test from "node:test";
import { placeLabels } from "../../../../workbench/report/page/plan.mjs";
import { chosen } from "./two_storeys.mjs";

/** Labels of the plan, a letter being 7 pixels wide, 8 in the view cell's bold. */
function labels(state, wider = 0) {
  const measure = (text, font) => text.length * (wider + (font.startsWith("700") ? 8 : 7));
  const frame = { bake: state.bake, state, view: state.view, storey: state.bake.storeys[state.storey] };
  return placeLabels(frame, measure);
}

test("view cells have their number and name in the middle, the chosen one in bold", () => {
  const found = labels(chosen()).map(({ lines, font, x, y }) => [lines, font.split(" ")[0], x, y]);
  assert.deepEqual(found, [
    [["0", "hall"], "700", 200, 200],
    [["2", "Room 7"], "500", 640, 250],
  ]);
});

test("a name that has no room is left out, and then the number", () => {
  const lines = (scale, wider, change) => {
    const state = chosen(change);
    state.view.scale = scale;
    return labels(state, wider).map((one) => one.lines);
  };
  assert.deepEqual(lines(1), [["0", "hall"], ["2"]]);
  assert.deepEqual(lines(0.6), [["0"], ["2"]]);
  assert.deepEqual(lines(0.39), []);
  assert.deepEqual(lines(0.6, 15), []);
  // A hall of 400 by 30 pixels is too low for two lines.
  const low = (data) => data.cells.boxes.set([0, 0, 0, 40, 3, 30], 0);
  assert.deepEqual(lines(10, 0, low)[0], ["0"]);
});

test("labels do not lie on each other: the chosen one goes first", () => {
  const state = chosen((data) => {
    data.cells.boxes.set([2, 2, 0, 38, 38, 30], 12);
  });
  assert.deepEqual(
    labels(state).map((one) => one.lines[0]),
    ["0"],
  );
  state.pick(2);
  assert.deepEqual(
    labels(state).map((one) => one.lines[0]),
    ["2"],
  );
});

test("what is out of sight, on another storey or not cut has no label, but for the chosen view cell", () => {
  const state = chosen();
  state.view.x = 500;
  assert.deepEqual(labels(state), []);
  state.view.x = 42;
  state.show(1);
  assert.deepEqual(
    labels(state).map((one) => one.lines),
    [["3"]],
  );
  const raised = chosen((data) => {
    data.cells.boxes.set([0, 0, 20, 40, 40, 30], 0);
    data.cells.boxes.set([44, 0, 20, 84, 30, 30], 12);
  });
  assert.deepEqual(
    labels(raised).map((one) => one.lines[0]),
    ["0"],
  );
});
