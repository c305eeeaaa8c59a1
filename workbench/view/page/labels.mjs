// Names of rooms over the view from above: of those that are cut open, as many as do not hide each other.

import { Vector3 } from "three";

const MOST = 80;

export class Labels {
  constructor(holder, database) {
    this.holder = holder;
    this.rooms = database.rooms().map(({ name, cell }) => {
      const box = database.cellBoxes.subarray(6 * cell, 6 * cell + 6);
      return { name, box, middle: database.middle(cell) };
    });
    this.made = [];
  }

  /** Put them where a camera sees them, which draws into a part of the page, `left` to `left + width`, cut at a height. */
  draw(camera, left, width, depth, height) {
    const places = [];
    for (const { name, box, middle } of width ? this.rooms : []) {
      if (box[2] > height || box[5] + 0.5 < height || places.length === MOST) continue;
      const at = new Vector3(middle[0], middle[1], box[2]).project(camera);
      const [x, y] = [left + ((at.x + 1) / 2) * width, ((1 - at.y) / 2) * depth];
      const half = 3.2 * name.length + 4;
      const outside = at.z > 1 || x - half < left || x + half > left + width || y < 8 || y > depth - 8;
      const hides = places.some((other) => Math.abs(other.x - x) < other.half + half && Math.abs(other.y - y) < 16);
      if (!outside && !hides) places.push({ name, x, y, half });
    }
    while (this.made.length < places.length) {
      const label = document.createElement("span");
      this.holder.append(label);
      this.made.push(label);
    }
    this.made.forEach((label, k) => {
      label.hidden = !places[k];
      if (!places[k]) return;
      label.textContent = places[k].name;
      label.style.transform = `translate(${places[k].x}px, ${places[k].y}px) translate(-50%, -50%)`;
    });
  }
}
