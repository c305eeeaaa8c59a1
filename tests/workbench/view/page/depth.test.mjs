import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
import { FACES, decodeFace, placed } from "../../../../workbench/view/page/depth.mjs";

const VECTOR = JSON.parse(readFileSync(new URL("depth_face.json", import.meta.url)));
const BYTES = Uint8Array.from(Buffer.from(VECTOR.face, "base64"));

test("a face is what Python has encoded", async () => {
  const { texels, png, meshes } = await decodeFace(BYTES);
  assert.equal(texels, VECTOR.texels);
  assert.deepEqual([...png.subarray(1, 4)], [..."PNG"].map((letter) => letter.charCodeAt(0)));
  assert.equal(meshes.length, VECTOR.meshes.length);
  for (const [k, mesh] of meshes.entries()) {
    assert.deepEqual([...mesh.places], VECTOR.meshes[k].places);
    assert.deepEqual([...mesh.parallax], VECTOR.meshes[k].parallax);
    assert.deepEqual([...mesh.triangles], VECTOR.meshes[k].triangles);
  }
});

test("a face that is cut off is refused", async () => {
  await assert.rejects(decodeFace(BYTES.subarray(0, BYTES.length - 9)));
});

test("vertices lie where Python places them", async () => {
  const { texels, meshes } = await decodeFace(BYTES);
  for (const [face, corners] of VECTOR.placed.entries()) {
    const found = placed(meshes[0], texels, VECTOR.reach, FACES[face]);
    corners.forEach((x, k) => assert.ok(Math.abs(found[k] - x) <= 1e-5 * Math.max(1, Math.abs(x)), `${face} ${k}`));
  }
});
