import assert from "node:assert/strict";
import test from "node:test";
import { ink, takeInk } from "../../../../workbench/report/page/ink.mjs";

test("dark and light have the same colours by name, and all but two differ", () => {
  const light = { ...ink },
    dark = { ...takeInk(true) };
  assert.deepEqual(Object.keys(dark), Object.keys(light));
  assert.deepEqual(
    Object.keys(light).filter((name) => light[name] === dark[name]),
    ["source", "glass"],
  );
  assert.equal(takeInk(false), ink);
  assert.deepEqual({ ...ink }, light);
});
