import assert from "node:assert/strict";
import test from "node:test";
import { Memory, lookahead } from "../../../../workbench/view/page/memory.mjs";

/** Objects 0 to 3 of two levels each; items 4 to 7 are the fine ones; a chunk of 100 bytes an item. */
const database = {
  chunks: 8, chunkIds: [0, 1, 2, 3, 4, 5, 6, 7], chunkOf: [0, 1, 2, 3, 4, 5, 6, 7], chunkBytes: () => 100,
  itemStarts: [0, 2, 4, 6, 8], items: [4, 0, 5, 1, 6, 2, 7, 3],
  membersOf: (cell) => [[[0, 0], [1, 1]], [[1, 0], [2, 0]]][cell] ?? [],
};

test("what is shown first, then coarse levels, nearer cells first, then finer ones as far as they are needed", () => {
  assert.deepEqual(lookahead(database, [[0, 0], [1, 2]], [7], 10_000), [7, 0, 1, 2, 4, 5, 6]);
  assert.deepEqual(lookahead(database, [[0, 0], [1, 2]], [7], 400), [7, 0, 1, 2]);
  assert.deepEqual(lookahead(database, [[0, 0]], [], 10_000), [0, 1, 4]);
});

test("memory is claimed when it is asked for, and never more than there is", () => {
  const memory = new Memory(database, 350);
  assert.deepEqual(memory.frame([0, 1, 2, 3], 2), { read: [0, 1], released: [] });
  assert.equal(memory.claimed, 200);
  memory.arrive(0);
  assert.deepEqual(memory.frame([0, 1, 2, 3], 9), { read: [2], released: [] });
  assert.ok(memory.resident(0) && !memory.resident(1) && memory.fetched === 100);
  for (const chunk of [1, 2]) memory.arrive(chunk);
  memory.frame([0, 1], 9);
  // 1 and 2 are no longer wanted; 2 is longer unused, and goes first.
  assert.deepEqual(memory.frame([0, 4], 9), { read: [4], released: [2] });
  assert.ok(memory.claimed <= 350);
  assert.deepEqual(memory.frame([0, 4, 5, 6], 9).released, [1]);
});

test("a smaller memory gives up what nobody wants", () => {
  const memory = new Memory(database, 350);
  memory.frame([0, 1, 2], 9);
  for (const chunk of [0, 1, 2]) memory.arrive(chunk);
  memory.capacity = 150;
  assert.deepEqual(memory.frame([2], 9), { read: [], released: [0, 1] });
});

test("what failed is not asked for until it is tried again", () => {
  const memory = new Memory(database, 350);
  memory.frame([0, 1], 1);
  memory.fail(0);
  assert.equal(memory.claimed, 0);
  assert.deepEqual(memory.frame([0, 1], 9).read, [1]);
  memory.retry();
  assert.deepEqual(memory.frame([0, 1], 9).read, [0]);
});
