// Where the plan looks. A view is {x, y, scale, width, height}: the ground's point in the middle [grid steps], pixels a
// grid step, and the plan's size [pixels]. Up is y on the ground, and against y in pixels.

const MARGIN = 28;
const LEAST_HEIGHT = 400;

/** Pixels from the left of a ground's x. */
export const toX = (view, x) => view.width / 2 + (x - view.x) * view.scale;
/** Pixels from the top of a ground's y. */
export const toY = (view, y) => view.height / 2 - (y - view.y) * view.scale;
/** The ground's point [grid steps] at a pixel. */
export const groundAt = (view, px, py) => [
  view.x + (px - view.width / 2) / view.scale,
  view.y - (py - view.height / 2) / view.scale,
];

/** A box as (left, top, width, height) in pixels. */
export function rectangle(view, b) {
  const x = toX(view, b[0]),
    y = toY(view, b[4]);
  return [x, y, toX(view, b[3]) - x, toY(view, b[1]) - y];
}

/** Whether a rectangle in pixels is out of sight. */
export const outOfSight = (view, [x, y, w, h]) => x > view.width || y > view.height || x + w < 0 || y + h < 0;

/** The view that shows a whole extent. */
export function fitted(view, { low, high }) {
  const across = Math.max(1, high[0] - low[0]),
    up = Math.max(1, high[1] - low[1]);
  const scale = Math.min((view.width - 2 * MARGIN) / across, (view.height - 2 * MARGIN) / up);
  return { ...view, x: (low[0] + high[0]) / 2, y: (low[1] + high[1]) / 2, scale: Math.max(scale, 1e-9) };
}

/** The view nearer by a factor; what is at the pixel stays there. */
export function zoomed(view, factor, px, py) {
  const [x, y] = groundAt(view, px, py),
    scale = Math.min(Math.max(view.scale * factor, 1e-6), 10);
  return { ...view, scale, x: x - (px - view.width / 2) / scale, y: y + (py - view.height / 2) / scale };
}

/** The view that far on, in pixels to the right and up. */
export const moved = (view, right, up) => ({ ...view, x: view.x + right / view.scale, y: view.y + up / view.scale });

/** Height [pixels] of a plan: as high as the building needs at this width, and the window has room for. */
export function wantedHeight({ low, high }, width, windowHeight) {
  const needed = (1.1 * width * (high[1] - low[1])) / Math.max(1, high[0] - low[0]) + 60;
  const room = Math.max(LEAST_HEIGHT, windowHeight - 270);
  return Math.round(Math.min(Math.max(needed, LEAST_HEIGHT), room));
}

/** The longest of 1, 2, 5, 10... metres that takes at most 110 pixels, and the pixels it takes. */
export function scaleBar(view, gridMetres) {
  const wanted = (110 / view.scale) * gridMetres,
    power = 10 ** Math.floor(Math.log10(wanted));
  const long = [5, 2, 1].map((n) => n * power).find((n) => n <= wanted) ?? power;
  return { metres: Number(long.toPrecision(1)), wide: (long / gridMetres) * view.scale };
}
