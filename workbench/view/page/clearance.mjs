// By how much a sightline clears what is about it, as verify/rays/clearance.py measures it
// (Ericson 2004, Real-Time Collision Detection, sections 5.1.5 and 5.1.9).

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const along = (a, d, t) => [a[0] + d[0] * t, a[1] + d[1] * t, a[2] + d[2] * t];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const clamp = (x) => Math.max(0, Math.min(1, x));

/** The point of a triangle that is nearest to a point. */
export function nearestOnTriangle(p, a, b, c) {
  const [ab, ac, ap] = [minus(b, a), minus(c, a), minus(p, a)];
  const [d1, d2] = [dot(ab, ap), dot(ac, ap)];
  if (d1 <= 0 && d2 <= 0) return a;
  const bp = minus(p, b);
  const [d3, d4] = [dot(ab, bp), dot(ac, bp)];
  if (d3 >= 0 && d4 <= d3) return b;
  const cp = minus(p, c);
  const [d5, d6] = [dot(ab, cp), dot(ac, cp)];
  if (d6 >= 0 && d5 <= d6) return c;
  const vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return along(a, ab, d1 / (d1 - d3));
  const vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return along(a, ac, d2 / (d2 - d6));
  const va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) return along(b, minus(c, b), (d4 - d3) / (d4 - d3 + (d5 - d6)));
  const share = 1 / (va + vb + vc);
  return along(along(a, ab, vb * share), ac, vc * share);
}

/** Points of two segments, p to p + d and q to q + e, that are nearest to each other. */
export function nearestOfSegments(p, d, q, e) {
  const r = minus(p, q);
  const [a, b, c, f, g] = [dot(d, d), dot(d, e), dot(d, r), dot(e, r), dot(e, e)];
  const denominator = a * g - b * b;
  let s = denominator > 0 ? clamp((b * f - c * g) / denominator) : 0;
  let t = g > 0 ? (b * s + f) / g : 0;
  if (t < 0) [t, s] = [0, clamp(-c / a)];
  else if (t > 1) [t, s] = [1, clamp((b - c) / a)];
  return [along(p, d, s), along(q, e, t)];
}

/** The object that comes nearest to a segment: how near, id, a point of the segment and one of the object; or null.
 *
 * `ids` are candidates; `boxOf(id)` holds an object, `trianglesOf(id)` are its triangles. */
export function clearance(from, to, ids, boxOf, trianglesOf) {
  const way = minus(to, from);
  let best = { distance: Infinity };
  for (const id of ids) {
    if (beyond(from, to, boxOf(id), best.distance)) continue;
    const t = trianglesOf(id);
    for (let k = 0; k < t.length; k += 9) {
      const corners = [0, 3, 6].map((n) => [t[k + n], t[k + n + 1], t[k + n + 2]]);
      if (beyond(from, to, around(corners), best.distance)) continue;
      const pairs = [from, to].map((end) => [end, nearestOnTriangle(end, ...corners)]);
      for (const n of [0, 1, 2]) pairs.push(nearestOfSegments(from, way, corners[n], minus(corners[(n + 1) % 3], corners[n])));
      for (const [on, at] of pairs) {
        const distance = Math.sqrt(dot(minus(on, at), minus(on, at)));
        if (distance < best.distance) best = { distance, id, on, at };
      }
    }
  }
  return best.distance < Infinity ? best : null;
}

function around(points) {
  const low = [0, 1, 2].map((k) => Math.min(...points.map((point) => point[k])));
  return [...low, ...[0, 1, 2].map((k) => Math.max(...points.map((point) => point[k])))];
}

/** Whether a box is surely farther from a segment than a distance. */
function beyond(from, to, box, distance) {
  if (distance === Infinity) return false;
  return [0, 1, 2].some((k) =>
    box[k] - Math.max(from[k], to[k]) > distance || Math.min(from[k], to[k]) - box[k + 3] > distance);
}
