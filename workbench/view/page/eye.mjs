// What an eye sees: a wedge of planes through it, narrowed from portal to portal (Funkhouser et al. 1996, section 4.2.1).
// More than what is seen may be kept, never less: planes and borders give way by SLACK.

/** Metres by which anything is taken for touching. */
export const SLACK = 1e-3;
// Ways through portals that are followed at most; past them the caller keeps all that may be seen.
const WAYS = 4000;
const DEEP = 64;

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** What of a polygon lies on the inner side of a plane through the eye, or at most SLACK beyond. */
function clip(polygon, normal) {
  const out = [];
  for (let k = 0; k < polygon.length; k++) {
    const [a, b] = [polygon[k], polygon[(k + 1) % polygon.length]];
    const [da, db] = [dot(a, normal) + SLACK, dot(b, normal) + SLACK];
    if (da >= 0) out.push(a);
    if (da >= 0 !== db >= 0) out.push(a.map((x, i) => x + ((b[i] - x) * da) / (da - db)));
  }
  return out;
}

/** Planes through the eye and the edges of a polygon in front of it, unit normals pointing inwards; none where it is a line. */
function planesAround(polygon) {
  const middle = [0, 1, 2].map((axis) => polygon.reduce((sum, point) => sum + point[axis], 0) / polygon.length);
  const out = [];
  for (let k = 0; k < polygon.length; k++) {
    const normal = cross(polygon[k], polygon[(k + 1) % polygon.length]);
    const length = Math.hypot(...normal);
    const side = dot(normal, middle);
    // Which way an edge that is hardly one looks cannot be told: a wedge without its plane is wider.
    if (length > 1e-9 && Math.abs(side) > 1e-9 * length) out.push(normal.map((x) => (Math.sign(side) * x) / length));
  }
  return out;
}

/** Whether a box about the eye is wholly beyond some plane. */
function beyond(low, high, planes) {
  return planes.some((n) => n.reduce((sum, x, axis) => sum + x * (x > 0 ? high : low)[axis], 0) < -SLACK);
}

/** Objects and cells that an eye sees within some planes, or null where there are too many ways.
 *
 * `eye` is a point, `planes` are unit normals that point inwards, `boxOf(id)` gives an object's box, `objectsIn(cell)`
 * those whose boxes meet a cell; `wanted` and `reached` say which objects and cells may be seen at all, or are null;
 * `passed(polygon)` hears of what of each portal is in sight, as corners about the eye. */
export function eyeSees(maze, eye, planes, boxOf, objectsIn, wanted = null, reached = null, passed = null) {
  const objects = new Set();
  const cells = new Set();
  const before = new Set();
  let ways = 0;

  const look = (cell, own) => {
    if (++ways > WAYS || before.size > DEEP) return false;
    cells.add(cell);
    const box = maze.boxes.subarray(6 * cell, 6 * cell + 6);
    for (const id of objectsIn(cell)) {
      if (objects.has(id) || (wanted && !wanted[id])) continue;
      const b = boxOf(id);
      const low = [0, 1, 2].map((axis) => Math.max(b[axis], box[axis]) - SLACK - eye[axis]);
      const high = [0, 1, 2].map((axis) => Math.min(b[axis + 3], box[axis + 3]) + SLACK - eye[axis]);
      if (!beyond(low, high, own)) objects.add(id);
    }
    before.add(cell);
    for (const portal of maze.portals[cell]) {
      const up = maze.sides[2 * portal] === cell;
      const behind = maze.sides[2 * portal + (up ? 1 : 0)];
      if (before.has(behind) || (reached && !reached.has(behind))) continue;
      const narrower = through(maze, portal, up, eye, own);
      if (narrower?.polygon && passed) passed(narrower.polygon);
      if (narrower && !look(behind, narrower.planes)) return false;
    }
    before.delete(cell);
    return true;
  };

  for (let cell = 0; cell < maze.count; cell++) {
    if (!near(maze, cell, eye)) continue;
    before.clear();
    if (!look(cell, planes)) return null;
  }
  return { objects, cells, ways };
}

/** Whether an eye is in a cell, or as good as on its border. */
function near(maze, cell, eye) {
  return [0, 1, 2].every((axis) =>
    eye[axis] >= maze.boxes[6 * cell + axis] - SLACK && eye[axis] <= maze.boxes[6 * cell + 3 + axis] + SLACK);
}

/** The wedge behind a portal, which is passed `up` its axis or down; null where nothing of it is in the wedge. */
function through(maze, portal, up, eye, planes) {
  const axis = maze.axes[portal];
  const ahead = (maze.coordinates[portal] - eye[axis]) * (up ? 1 : -1);
  if (ahead < -SLACK) return null;
  const [u, v] = [0, 1, 2].filter((other) => other !== axis);
  const [lowU, highU, lowV, highV] = maze.openings.subarray(4 * portal, 4 * portal + 4);
  if (ahead <= SLACK) {
    // From within a portal all of what lies on its other side is in sight.
    const inside = eye[u] >= lowU - SLACK && eye[u] <= highU + SLACK && eye[v] >= lowV - SLACK && eye[v] <= highV + SLACK;
    return inside ? { planes } : null;
  }
  let polygon = [[lowU, lowV], [highU, lowV], [highU, highV], [lowU, highV]].map(([a, b]) => {
    const corner = [0, 0, 0];
    [corner[axis], corner[u], corner[v]] = [maze.coordinates[portal] - eye[axis], a - eye[u], b - eye[v]];
    return corner;
  });
  for (const normal of planes) polygon = clip(polygon, normal);
  if (!polygon.length) return null;
  const found = polygon.length < 3 ? [] : planesAround(polygon);
  return { planes: found.length < 3 ? planes : found, polygon };
}
