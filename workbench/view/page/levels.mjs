// Levels of detail, chosen live: the coarsest that deviates by few enough pixels, and how few that is follows from how
// long frames take.

const [FINEST, COARSEST] = [0.5, 64];
// Frames that are averaged; by how much the tolerance changes with each.
const FRAMES = 8;
const STEP = 1.12;

export class Levels {
  constructor(database) {
    this.database = database;
    this.target = 0;
    this.tolerance = FINEST;
    this.average = 0;
    this.stretch = new Float32Array(database.objects);
    for (let id = 0; id < database.objects; id++) {
      const m = database.transforms.subarray(12 * id, 12 * id + 12);
      // No vector becomes longer than by the root of the sum of squares.
      this.stretch[id] = Math.min(Math.hypot(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]), 1e6);
    }
  }

  /** Level of an object that deviates by few enough pixels from an eye; `focal` pixels are a metre's at a metre. */
  of(id, eye, focal) {
    const { database } = this;
    const begin = database.itemStarts[id];
    let level = database.itemStarts[id + 1] - begin - 1;
    if (!this.target || !level) return 0;
    const b = database.boxOf(id);
    const away = Math.hypot(...[0, 1, 2].map((k) => Math.max(0, b[k] - eye[k], eye[k] - b[k + 3])));
    const allowed = (this.tolerance * Math.max(away, 0.01)) / focal;
    while (level && database.itemErrors[database.items[begin + level]] * this.stretch[id] > allowed) level--;
    return level;
  }

  /** A frame took so long [ms]; whether levels should be chosen anew. */
  heard(ms) {
    this.average += (ms - this.average) / FRAMES;
    const before = this.tolerance;
    if (!this.target) this.tolerance = FINEST;
    else if (this.average > 1.05 * this.target) this.tolerance = Math.min(COARSEST, this.tolerance * STEP);
    else if (this.average < 0.8 * this.target) this.tolerance = Math.max(FINEST, this.tolerance / STEP);
    return this.tolerance !== before;
  }
}
