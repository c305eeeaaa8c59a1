import assert from "node:assert/strict";
import test from "node:test";
import { decode } from "../../../../workbench/view/page/runs.mjs";

const bytes = (hex) => Uint8Array.from(hex.split(" ").filter(Boolean), (pair) => parseInt(pair, 16));
const ids = (hex, count = 1000) => decode(bytes(hex), 0, bytes(hex).length, count);

test("codes of docs/reference/walk-folder.md", () => {
  assert.deepEqual(ids(""), []);
  assert.deepEqual(ids("07 00"), [7]);
  assert.deepEqual(ids("00 02 03 01 0a 00"), [0, 1, 2, 7, 8, 20]);
  assert.deepEqual(ids("00 ab 02"), Array.from({ length: 300 }, (_, k) => k));
});

test("a set among others", () => {
  assert.deepEqual(decode(bytes("07 00 00 02 03 01 0a 00 05 05"), 2, 8, 21), [0, 1, 2, 7, 8, 20]);
});

test("what is cut short, or beyond all ids, is told", () => {
  assert.throws(() => ids("07"), /expected a whole code/);
  assert.throws(() => ids("87"), /expected a whole code/);
  assert.throws(() => ids("ff ff ff ff ff 01 00"), /expected a whole code/);
  assert.throws(() => ids("00 ab 02", 299), /expected ids below 299, found 299/);
});
