// Who walks: where they are, where they look, which cell they are in.

import { EYE, groundUnder } from "./ground.mjs";

export const SPEED = 1.6; // metres a second, as people walk
export const HURRY = 3;
export const TURN = 1.8; // radians a second by arrow keys
// How fast feet follow the ground [m/s]: stairs are no jumps.
const CLIMB = 3;
// A step is cut into pieces that are shorter than any wall is thick.
const PIECE = 0.1;
// Cells that see so much of what the best one sees are as good to begin in.
const ALMOST = 0.9;

export class Visitor {
  constructor(database) {
    this.database = database;
    this.yaw = this.pitch = 0;
    this.speed = SPEED;
    this.goTo(startCell(database));
  }

  /** Stand in the middle of a cell, on its ground. */
  goTo(cell) {
    const { database } = this;
    this.cell = cell;
    const middle = database.middle(cell);
    const floor = database.cellBoxes[6 * cell + 2];
    const roof = database.cellBoxes[6 * cell + 5];
    this.point = [middle[0], middle[1], Math.min(floor + EYE, (floor + roof) / 2 + 0.4 * (roof - floor))];
    const ground = this.ground(this.point);
    if (ground > floor - 0.5) this.point[2] = Math.min(ground + EYE, roof - 0.05);
    // Along the longer side of the cell there is most to see.
    const [width, depth] = [0, 1].map((axis) => database.cellBoxes[6 * cell + 3 + axis] - database.cellBoxes[6 * cell + axis]);
    this.yaw = width >= depth ? 0 : Math.PI / 2;
    this.pitch = 0;
  }

  ground(point) {
    const { database } = this;
    return groundUnder(point, database.groundOf(this.cell), (id) => database.boxOf(id), (id) => database.trianglesOf(id));
  }

  /** Walk for some seconds: `forward` and `right` from -1 to 1, times `speed` metres a second. */
  walk(seconds, forward, right, speed) {
    const length = Math.max(1, Math.hypot(forward, right));
    const [c, s] = [Math.cos(this.yaw), Math.sin(this.yaw)];
    const move = [(c * forward + s * right) / length, (s * forward - c * right) / length, 0].map((x) => x * speed * seconds);
    const pieces = Math.ceil(Math.hypot(...move) / PIECE);
    for (let piece = 0; piece < pieces; piece++) {
      const found = this.database.maze.step(this.cell, this.point, move.map((x) => x / pieces));
      this.point = found.point;
      this.cell = found.cell;
    }
    this.settle(seconds);
  }

  /** Follow the ground up and down, as far as floors and ceilings of cells let the eye. */
  settle(seconds) {
    const ground = this.ground(this.point);
    if (ground === -Infinity) return;
    const rest = ground + EYE - this.point[2];
    const rise = Math.sign(rest) * Math.min(Math.abs(rest), CLIMB * seconds);
    if (Math.abs(rise) < 1e-4) return;
    const to = [this.point[0], this.point[1], this.point[2] + rise];
    const { maze } = this.database;
    const cellAt = (z) => maze.follow(this.cell, this.point, [to[0], to[1], z]);
    // Under a room without a floor lies what nobody stands in, such as the space above a ceiling.
    if (rise < 0 && maze.inhabitable[this.cell] && !maze.inhabitable[cellAt(ground + EYE)]) return;
    const cell = cellAt(to[2]);
    if (cell >= 0) [this.point, this.cell] = [to, cell];
  }

  /** A unit vector along the view. */
  get ahead() {
    const flat = Math.cos(this.pitch);
    return [flat * Math.cos(this.yaw), flat * Math.sin(this.yaw), Math.sin(this.pitch)];
  }
}

/** The largest of the view cells from which almost as much may be seen as from any; -1 if there is none. */
export function startCell(database) {
  const cells = [...database.viewCells];
  const seen = (cell) => database.setOf(cell).potential.length;
  const size = (cell) => [0, 1, 2].reduce((all, k) => all * (database.cellBoxes[6 * cell + 3 + k] - database.cellBoxes[6 * cell + k]), 1);
  const most = cells.reduce((best, cell) => Math.max(best, seen(cell)), 0);
  return cells.filter((cell) => seen(cell) >= ALMOST * most).reduce((best, cell) => (best < 0 || size(cell) > size(best) ? cell : best), -1);
}
