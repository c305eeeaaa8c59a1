// Lines around boxes and openings.

import { BufferAttribute, BufferGeometry, LineBasicMaterial, LineSegments } from "three";

const CORNERS = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => [3 * (k & 1), 3 * ((k >> 1) & 1) + 1, 3 * (k >> 2) + 2]);
const EDGES = [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/** Ends of the edges of boxes, 6 numbers each: 72 numbers a box. */
export function boxLines(boxes) {
  const out = [];
  for (let b = 0; b < boxes.length; b += 6) {
    for (const edge of EDGES) for (const corner of edge) for (const place of CORNERS[corner]) out.push(boxes[b + place]);
  }
  return new Float32Array(out);
}

/** The boxes of some portals: 6 numbers each. */
export function portalBoxes(maze, portals) {
  return portals.flatMap((portal) => maze.portalBox(portal));
}

/** Lines of a colour on a layer, none at first; `through` all that is before them. */
export class Lines {
  constructor(colour, layer, planes = [], through = false) {
    const material = new LineBasicMaterial({ color: colour, clippingPlanes: planes, depthTest: !through, transparent: through });
    this.mesh = new LineSegments(new BufferGeometry(), material);
    this.mesh.layers.set(layer);
    this.mesh.frustumCulled = false;
  }

  /** Draw lines with these ends, 6 numbers each. */
  set(ends) {
    this.mesh.geometry.dispose();
    this.mesh.geometry = new BufferGeometry();
    this.mesh.geometry.setAttribute("position", new BufferAttribute(ends, 3));
    this.mesh.visible = ends.length > 0;
  }
}
