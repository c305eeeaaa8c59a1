// Labels beside points of a picture, none over another.

// Sides of a point where one may stand, the best first: steps to the right and downwards.
const SIDES = [
  [1, -1],
  [1, 1],
  [-1, -1],
  [-1, 1],
  [0, -1],
  [0, 1],
  [1, 0],
  [-1, 0],
];
// Distances of one from its point; farther ones are joined by a line.
const AWAY = [6, 16, 28, 42, 58, 76];
// A digit is about so wide, and a line so high, in the font's em; a mark reaches so far about its point.
const WIDE = 0.62;
const HIGH = 1.1;
const MARK = 5;

const shared = (a, b) =>
  Math.max(0, Math.min(a[2], b[2]) - Math.max(a[0], b[0])) * Math.max(0, Math.min(a[3], b[3]) - Math.max(a[1], b[1]));

/** The box about a middle. */
const boxAbout = ([x, y], width, height) => [x - width / 2, y - height / 2, x + width / 2, y + height / 2];

/**
 * Middles of labels beside their points, none over another, over a point or outside a box, as far as there is room.
 * `labels` are {x, y, text}, `marks` further points {x, y}, `inside` a box [left, top, right, bottom]; all in one unit,
 * that of the font's `em`. Gives {x, y, far} for each of them; `far` where it needs a line to its point.
 */
export function labelPlaces(labels, marks, inside, em) {
  const taken = [...labels, ...marks].map(({ x, y }) => boxAbout([x, y], 2 * MARK, 2 * MARK));
  return labels.map(({ x, y, text }) => {
    const width = WIDE * em * text.length,
      height = HIGH * em;
    let best = null;
    for (const [number, away] of AWAY.entries())
      for (const [right, down] of SIDES) {
        const middle = [x + right * (away + width / 2), y + down * (away + height / 2)],
          box = boxAbout(middle, width, height);
        const out = width * height - shared(box, inside);
        const covered = taken.reduce((sum, other) => sum + shared(box, other), out);
        if (!best || covered < best.covered - 1e-9) best = { middle, box, covered, far: number > 0 };
      }
    taken.push(best.box);
    return { x: best.middle[0], y: best.middle[1], far: best.far };
  });
}
