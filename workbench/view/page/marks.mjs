// What an answer draws: a box about what was asked for, its sightline with the room that it clears, and occluders.

import {
  BufferAttribute, BufferGeometry, CylinderGeometry, DoubleSide, Group, Mesh, MeshBasicMaterial, Quaternion, Vector3,
} from "three";

import { Lines, boxLines, portalBoxes } from "./outlines.mjs";

const [MARK, LINE, BLOCK] = [0xd55e00, 0x009e73, 0xcc79a7];
// A sightline is drawn so thick [m], and what it clears no thicker than this.
const THIN = 0.012;
const THICK = 0.4;

export class Marks {
  /** Nothing at first; on `layers` of cameras, with what is in the way of it. */
  constructor(maze, layers, whole) {
    this.maze = maze;
    this.layers = layers;
    this.group = new Group();
    this.box = new Lines(MARK, whole, [], true);
    this.portals = new Lines(LINE, whole);
    this.edges = new Lines(BLOCK, whole);
    for (const { mesh } of [this.box, this.portals, this.edges]) for (const layer of layers) mesh.layers.enable(layer);
    this.solid = [];
    this.group.add(this.box.mesh, this.portals.mesh, this.edges.mesh);
    this.show(null);
  }

  /** Draw an answer, or nothing for null. */
  show(found) {
    for (const mesh of this.solid) {
      this.group.remove(mesh);
      mesh.geometry.dispose();
      mesh.material.dispose();
    }
    this.solid = [];
    this.box.set(found ? boxLines(found.box) : new Float32Array(0));
    this.portals.set(boxLines(found?.line ? portalBoxes(this.maze, found.line.portals) : []));
    this.edges.set(edgesOf(found?.corners ?? []));
    if (found?.line) this.sightline(found.line, found.clear);
    if (found?.corners.length) this.put(rectangles(found.corners), BLOCK, 0.35);
  }

  sightline({ from, to }, clear) {
    this.put(tube(from, to, THIN), LINE, 1);
    if (!clear) return;
    this.put(tube(from, to, Math.min(THICK, clear.distance)), LINE, 0.22);
    this.put(tube(clear.on, clear.at, THIN), MARK, 1);
  }

  put(geometry, color, opacity) {
    const material = new MeshBasicMaterial({ color, opacity, transparent: opacity < 1, depthWrite: opacity === 1, side: DoubleSide });
    const mesh = new Mesh(geometry, material);
    for (const layer of this.layers) mesh.layers.enable(layer);
    mesh.frustumCulled = false;
    this.solid.push(mesh);
    this.group.add(mesh);
  }
}

function tube(from, to, radius) {
  const [a, b] = [new Vector3(...from), new Vector3(...to)];
  const way = b.clone().sub(a);
  const geometry = new CylinderGeometry(radius, radius, way.length() || 1e-6, 12, 1, true);
  geometry.applyQuaternion(new Quaternion().setFromUnitVectors(new Vector3(0, 1, 0), way.normalize()));
  return geometry.translate(...a.add(b).multiplyScalar(0.5).toArray());
}

function rectangles(corners) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(Float32Array.from(corners), 3));
  geometry.setIndex(Array.from({ length: corners.length / 12 }, (_, k) => [0, 1, 2, 0, 2, 3].map((n) => 4 * k + n)).flat());
  return geometry;
}

/** Edges of rectangles, 6 numbers each. */
function edgesOf(corners) {
  const out = [];
  for (let k = 0; k < corners.length; k += 12) {
    for (let n = 0; n < 4; n++) for (const one of [n, (n + 1) % 4]) out.push(...corners.slice(k + 3 * one, k + 3 * one + 3));
  }
  return new Float32Array(out);
}
