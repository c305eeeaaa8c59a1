import assert from "node:assert/strict";
import test from "node:test";
import { Recorder, at, readPath, writePath } from "../../../../workbench/view/page/path.mjs";

const TEXT = 'x,y,z,"yaw",pitch,t,cells\n1,2,1.7,350,0,5,3\n3,2,1.7,10,-20,7,4\n';

test("a table of a walk is read, times from its first frame on", () => {
  const frames = readPath(TEXT);
  assert.deepEqual(frames.map(({ t }) => t), [0, 2]);
  assert.ok(Math.abs(frames[1].pitch + Math.PI / 9) < 1e-12);
  const middle = at(frames, 1);
  assert.deepEqual(middle.point, [2, 2, 1.7]);
  // From 350 to 10 degrees is by 360, not by 180.
  assert.ok(Math.abs(Math.sin(middle.yaw)) < 1e-9 && Math.cos(middle.yaw) > 0.99);
  assert.equal(at(frames, -1), frames[0]);
  assert.equal(at(frames, 99), frames[1]);
});

test("what is written is read again", () => {
  const frames = readPath(TEXT);
  const again = readPath(writePath(frames));
  frames.forEach((frame, k) => assert.ok(Math.abs(frame.yaw - again[k].yaw) < 1e-4 && frame.t === again[k].t));
});

test("what is no path is refused in a line", () => {
  assert.throws(() => readPath("x,y,z,yaw,t\n1,2,3,4,5\n"), /expected the column pitch/);
  assert.throws(() => readPath("x,y,z,yaw,pitch,t\n"), /expected at least one frame/);
  assert.throws(() => readPath("x,y,z,yaw,pitch,t\n1,2,3,4,,6\n"), /expected six numbers/);
  assert.throws(() => readPath("x,y,z,yaw,pitch,t\n1,2,3,4,5,6\n1,2,3,4,5,6\n"), /expected t to ascend/);
});

test("ten frames a second are recorded", () => {
  const recorder = new Recorder(1000);
  for (let now = 1000; now <= 3000; now += 16) recorder.tick({ point: [now, 0, 0], yaw: 0, pitch: 0 }, now);
  assert.ok(recorder.frames.length >= 17 && recorder.frames.length <= 21);
  assert.equal(recorder.frames[0].t, 0);
});
