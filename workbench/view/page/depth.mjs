// Textured depth meshes as they are stored (docs/reference/walk-folder.md): a face is a PNG and its meshes.

// Heights of vertices are multiples of this [texels].
const STEP = 2 ** -6;
// Right, up and forward of each face: +x, -x, +y, -y, +z, -z.
export const FACES = [0, 1, 2].flatMap((k) => [1, -1].map((sign) => {
  const axis = (at, length) => [0, 1, 2].map((one) => (one === at ? length : 0));
  return [axis((k + 1) % 3, 1), axis((k + 2) % 3, 1), axis(k, sign)];
}));

/** The bytes that zlib has packed. */
async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** A face: texels a side, its PNG, and of each layer its vertices' places (row * texels + column), their parallax [texels],
 * and triangles. */
export async function decodeFace(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const number = (at) => view.getUint32(4 * at, true);
  const [texels, layers, size] = [number(0), number(1), number(2)];
  const first = 12 + 12 * layers;
  const counts = Array.from({ length: layers }, (_, k) => [number(3 + 3 * k), number(4 + 3 * k)]);
  const [vertices, triangles] = [0, 1].map((part) => counts.reduce((sum, one) => sum + one[part], 0));
  const planes = await inflated(bytes.subarray(first + size));
  if (planes.length !== 4 * (2 * vertices + 3 * triangles)) throw new Error("depth mesh: expected other bytes");
  let begin = 0;
  const column = (count) => {
    const found = Float64Array.from({ length: count }, (_, k) =>
      planes[begin + k] + 256 * (planes[begin + count + k] + 256 * (planes[begin + 2 * count + k] + 256 * planes[begin + 3 * count + k])));
    begin += 4 * count;
    return found;
  };
  const [places, heights, corners, seconds, thirds] = [vertices, vertices, triangles, triangles, triangles].map(column);
  let [vertex, triangle] = [0, 0];
  const meshes = counts.map(([own, faces]) => {
    const found = { places: new Uint32Array(own), parallax: new Float32Array(own), triangles: new Uint32Array(3 * faces) };
    let [place, height, corner] = [0, 0, 0];
    for (let k = 0; k < own; k++, vertex++) {
      found.places[k] = place += places[vertex];
      height += heights[vertex] % 2 ? -(heights[vertex] + 1) / 2 : heights[vertex] / 2;
      found.parallax[k] = height * STEP;
    }
    for (let k = 0; k < faces; k++, triangle++) {
      corner += corners[triangle];
      found.triangles.set([corner, corner + seconds[triangle], corner + thirds[triangle]], 3 * k);
    }
    return found;
  });
  return { texels, png: bytes.subarray(first, first + size), meshes };
}

/** Where the vertices of a mesh lie about the cell's middle, three numbers each, in the unit of `reach`. */
export function placed({ places, parallax }, texels, reach, [right, up, forward]) {
  const half = texels / 2;
  const found = new Float32Array(3 * places.length);
  places.forEach((place, k) => {
    const depth = ((half - 1) * reach) / parallax[k];
    const across = ((place % texels) + 0.5 - half) / (half - 1);
    const above = (half - 0.5 - Math.floor(place / texels)) / (half - 1);
    for (let axis = 0; axis < 3; axis++) {
      found[3 * k + axis] = depth * (across * right[axis] + above * up[axis] + forward[axis]);
    }
  });
  return found;
}
