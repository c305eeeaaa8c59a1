// What lies on a storey's plan, and what lies there under a point. Coordinates are grid steps.

/** Whether a storey's section cuts a box. */
export const cutBy = (b, storey) => b[2] < storey.level && storey.level < b[5];

/** Floor area of a box [square grid steps]. */
export const floorArea = (b) => (b[3] - b[0]) * (b[4] - b[1]);

/** Corners (x, y) of the rectangle about all view cells; about all objects, too, where the bake speaks of these only. */
export function extentOf(bake) {
  const objects = bake.facts.claimsCells ? [] : [...bake.objects.role.keys()].map((id) => bake.box("object", id));
  const boxes = [...bake.sources.map((cell) => bake.box("cell", cell)), ...objects.filter((b) => b[0] <= b[3])];
  const low = [0, 1].map((k) => boxes.reduce((least, b) => Math.min(least, b[k]), Infinity));
  const high = [0, 1].map((k) => boxes.reduce((most, b) => Math.max(most, b[k + 3]), -Infinity));
  return { low, high };
}

/** Cells drawn on a storey's plan: those that its section cuts, and its own view cells above or below the cut. */
export function cellsOn(bake, number) {
  const { cells, facts } = bake,
    box = (cell) => bake.box("cell", cell);
  return [...cells.inhabitable.keys()]
    .filter((cell) => cells.storey[cell] === number || (facts.claimsCells && cutBy(box(cell), bake.storeys[number])))
    .sort((a, b) => cells.inhabitable[a] - cells.inhabitable[b] || floorArea(box(b)) - floorArea(box(a)));
}

/** Objects that stand on a storey's floor or are cut by its section; slabs are neither. */
export function objectsOn(bake, number) {
  const { level, floor } = bake.storeys[number],
    step = 0.05 / bake.facts.gridMetres,
    box = (id) => bake.box("object", id);
  const stands = (b) => b[0] <= b[3] && b[2] < level && b[5] > floor + step;
  return [...bake.objects.role.keys()]
    .filter((id) => stands(box(id)))
    .sort((a, b) => floorArea(box(b)) - floorArea(box(a)));
}

/** Whether a point lies in a convex plan, its corners counter-clockwise. */
export function inPlan(corners, [x, y]) {
  return corners.every(([a, b], k) => {
    const [c, d] = corners[(k + 1) % corners.length];
    return (c - a) * (y - b) - (d - b) * (x - a) >= 0;
  });
}

/** What of the chosen storey lies under a point: cells that the section cuts first, then the smallest. */
function under({ bake, storey }, kind, [x, y], slack) {
  const box = (id) => bake.box(kind, id),
    cut = (id) => kind === "cell" && cutBy(box(id), bake.storeys[storey]);
  const holds = (b) => b[0] - slack <= x && x <= b[3] + slack && b[1] - slack <= y && y <= b[4] + slack;
  const found = bake.on(kind, storey).filter((id) => holds(box(id)) && (kind !== "cell" || inPlan(bake.plan(id), [x, y])));
  return found.sort((a, b) => cut(b) - cut(a) || floorArea(box(a)) - floorArea(box(b)));
}

/** View cells under a point of the chosen storey, those that the section cuts first, then the smallest. */
export const sourcesAt = (state, point) =>
  under(state, "cell", point, 0).filter((cell) => state.bake.cells.inhabitable[cell]);

/** The target {kind, id} under a point, of the kind that is coloured, or null; objects within 3 pixels count. */
export function targetAt(state, point) {
  const cells = state.layer === "cell",
    found = under(state, state.layer, point, cells ? 0 : 3 / state.view.scale),
    id = found.find((one) => !cells || one !== state.cell);
  return id === undefined ? null : { kind: state.layer, id };
}

/** The view cell of the chosen storey that lies nearest in a direction, off it by less than it is away. */
export function neighbour({ bake, cell, storey }, [dx, dy]) {
  const { cells, sources } = bake;
  if (cells.storey[cell] !== storey) return sources.find((one) => cells.storey[one] === storey);
  const centre = (one) => {
    const b = bake.box("cell", one);
    return [(b[0] + b[3]) / 2, (b[1] + b[4]) / 2];
  };
  const [x, y] = centre(cell);
  const far = (one) => {
    const [cx, cy] = centre(one),
      along = (cx - x) * dx + (cy - y) * dy,
      off = Math.abs((cx - x) * dy) + Math.abs((cy - y) * dx);
    return along > 0 && off <= along ? along + 2 * off : Infinity;
  };
  const there = sources.filter((one) => cells.storey[one] === storey && far(one) < Infinity);
  return there.sort((a, b) => far(a) - far(b))[0];
}
