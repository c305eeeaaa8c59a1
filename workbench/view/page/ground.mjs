// What one stands on.

/** Height of eyes above it, and of the highest step one takes [m]. */
export const EYE = 1.65;
export const STEP = 0.55;

/** Height of the highest of some objects' triangles under a point, at most STEP above the feet; -Infinity for none.
 *
 * `objects` are ids; `boxOf(id)` gives 6 numbers, least, then most; `trianglesOf(id)` 9 a triangle, in metres. */
export function groundUnder(point, objects, boxOf, trianglesOf) {
  const [x, y] = point;
  const top = point[2] - EYE + STEP;
  let best = -Infinity;
  for (const id of objects) {
    const box = boxOf(id);
    const beside = x < box[0] || x > box[3] || y < box[1] || y > box[4];
    if (beside || box[2] > top || box[5] <= best) continue;
    const t = trianglesOf(id);
    for (let k = 0; k < t.length; k += 9) best = Math.max(best, heightOn(t, k, x, y, top));
  }
  return best;
}

/** Height of a triangle at x, y; -Infinity where it is not there, upright, or above `top`. */
function heightOn(t, k, x, y, top) {
  const [ax, ay, az, bx, by, bz, cx, cy, cz] = t.slice(k, k + 9);
  const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
  if (Math.abs(area) < 1e-12) return -Infinity;
  const u = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area;
  const v = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area;
  if (u < 0 || v < 0 || u + v > 1) return -Infinity;
  const z = az + u * (bz - az) + v * (cz - az);
  return z <= top ? z : -Infinity;
}
