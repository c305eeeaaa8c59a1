import assert from "node:assert/strict";
import test from "node:test";
import { gzipSync } from "node:zlib";
import { arraysOf, unpacked } from "../../../../workbench/view/page/unpack.mjs";

test("bytes come back", async () => {
  const text = gzipSync(Uint8Array.from([1, 2, 250])).toString("base64");
  assert.deepEqual([...(await unpacked(text))], [1, 2, 250]);
});

test("arrays lie anywhere", () => {
  const bytes = new Uint8Array(1 + 8 + 4);
  new DataView(bytes.buffer).setFloat32(1, 1.5, true);
  new DataView(bytes.buffer).setFloat32(5, -2, true);
  new DataView(bytes.buffer).setInt32(9, -7, true);
  const found = arraysOf({ heights: ["f4", 1, 2], one: ["i4", 9, 1], none: ["u1", 13, 0] }, bytes);
  assert.deepEqual([[...found.heights], [...found.one], [...found.none]], [[1.5, -2], [-7], []]);
});

test("an array that is not there is named", () => {
  assert.throws(() => arraysOf({ far: ["u4", 2, 3] }, new Uint8Array(9)), /far: expected 12 bytes from 2 on, found 7/);
});
