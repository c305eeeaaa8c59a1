// Cells and portals: where an eye is, and where it can go.

/** Half of a shoulder [m]: an eye stays so far from what it cannot pass. */
export const MARGIN = 0.2;

export class Maze {
  /** Boxes of cells (6 numbers each: least, then most), plans of prisms (8, the first NaN where there is none),
   * whether one may be there, and portals: two cells, axis, coordinate, and least u, most u, least v, most v. */
  constructor({ boxes, plans, inhabitable, sides, axes, coordinates, openings }) {
    Object.assign(this, { boxes, plans, inhabitable, sides, axes, coordinates, openings });
    this.count = boxes.length / 6;
    this.portalBoxes = [];
    this.portals = Array.from({ length: this.count }, () => []);
    for (let portal = 0; portal < axes.length; portal++) {
      for (const side of [0, 1]) this.portals[sides[2 * portal + side]].push(portal);
    }
  }

  /** The box of a portal, flat along its axis. */
  portalBox(portal) {
    if (!this.portalBoxes[portal]) {
      const box = [0, 0, 0, 0, 0, 0];
      const axis = this.axes[portal];
      box[axis] = box[axis + 3] = this.coordinates[portal];
      [0, 1, 2].filter((other) => other !== axis).forEach((other, k) => {
        box[other] = this.openings[4 * portal + 2 * k];
        box[other + 3] = this.openings[4 * portal + 2 * k + 1];
      });
      this.portalBoxes[portal] = box;
    }
    return this.portalBoxes[portal];
  }

  /** Whether a point is in a cell, borders included. */
  holds(cell, point) {
    for (let axis = 0; axis < 3; axis++) {
      if (point[axis] < this.boxes[6 * cell + axis] || point[axis] > this.boxes[6 * cell + 3 + axis]) return false;
    }
    const plan = this.plans.subarray(8 * cell, 8 * cell + 8);
    for (let k = 0; k < 4 && plan[0] === plan[0]; k++) {
      const [ax, ay, bx, by] = [0, 1, 2, 3].map((n) => plan[(2 * k + n) % 8]);
      if ((bx - ax) * (point[1] - ay) - (by - ay) * (point[0] - ax) < 0) return false;
    }
    return true;
  }

  /** The cell that a point is in, -1 for none: `last` if it still is, else one for eyes before any other. */
  cellAt(point, last = -1) {
    if (last >= 0 && this.holds(last, point)) return last;
    let other = -1;
    for (let cell = 0; cell < this.count; cell++) {
      if (!this.holds(cell, point)) continue;
      if (this.inhabitable[cell]) return cell;
      other = cell;
    }
    return other;
  }

  /** The cell in which a straight way from a cell ends, or -1 where a wall is in the way. */
  follow(cell, from, to) {
    let here = cell;
    let crossed = -1;
    for (let step = 0; step < 16 && here >= 0; step++) {
      if (this.holds(here, to)) return here;
      const portal = this.portals[here].find((one) => one !== crossed && this.passes(one, from, to, here));
      if (portal === undefined) return -1;
      crossed = portal;
      here = this.sides[2 * portal] === here ? this.sides[2 * portal + 1] : this.sides[2 * portal];
    }
    return -1;
  }

  /** Whether a way passes a portal, out of a cell on one of its sides. */
  passes(portal, from, to, out) {
    const axis = this.axes[portal];
    const way = to[axis] - from[axis];
    const low = this.sides[2 * portal] === out;
    const rest = this.coordinates[portal] - from[axis];
    // Cells of a portal stand on either side of it: one leaves the lower one upwards.
    const upwards = this.boxes[6 * out + 3 + axis] <= this.coordinates[portal] || (low && way > 0);
    if (way === 0 || way > 0 !== upwards || Math.abs(rest) > Math.abs(way) || rest * way < 0) return false;
    const share = rest / way;
    return [0, 1, 2].filter((other) => other !== axis).every((other, k) => {
      const at = from[other] + share * (to[other] - from[other]);
      return at >= this.openings[4 * portal + 2 * k] && at <= this.openings[4 * portal + 2 * k + 1];
    });
  }

  /** Where a step leads: as far as walls let it, along them where it meets one; and the cell there. */
  step(cell, from, move) {
    for (const way of [move, [move[0], 0, 0], [0, move[1], 0]]) {
      const axes = [0, 1].filter((axis) => way[axis]);
      if (!axes.length) continue;
      const to = from.map((x, k) => x + way[k]);
      const there = this.follow(cell, from, to);
      // A shoulder's width along either axis, too.
      const ahead = (axis) => to.map((x, k) => x + (k === axis ? Math.sign(way[k]) * MARGIN : 0));
      if (there >= 0 && axes.every((axis) => this.follow(there, to, ahead(axis)) >= 0)) return { point: to, cell: there };
    }
    return { point: from, cell };
  }
}
