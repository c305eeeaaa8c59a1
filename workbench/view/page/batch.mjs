// All objects as two draw calls, what is opaque and what is not: each shape once, each object a copy that can be hidden
// or coloured by itself.

import {
  BatchedMesh, BufferAttribute, BufferGeometry, Color, DoubleSide, Matrix4, MeshLambertMaterial,
} from "three";

import { colourOf } from "./colours.mjs";

export class Batch {
  /** Objects of a database; `layer` is that of the cameras that see them, `planes` cut them. */
  constructor(database, layer, planes = []) {
    this.database = database;
    this.parts = [false, true].map((clear) => this.part(clear, layer, planes));
    this.colours = Array.from({ length: database.objects }, (_, id) =>
      colourOf(database.colours[id], database.head.kinds[database.kinds[id]], database.head.names[id]));
    this.shown = new Uint8Array(database.objects).fill(1);
    this.paint(() => null);
  }

  part(clear, layer, planes) {
    const { database } = this;
    const ids = Array.from({ length: database.objects }, (_, id) => id).filter((id) => !!database.clear[id] === clear);
    const shapes = new Map(ids.map((id) => [database.finestOf(id), null]));
    let [vertices, faces] = [0, 0];
    for (const item of shapes.keys()) {
      vertices += database.itemVertices[item];
      faces += database.itemFaces[item];
    }
    const material = new MeshLambertMaterial({
      side: DoubleSide, flatShading: true, clippingPlanes: planes,
      ...(clear ? { transparent: true, opacity: 0.35, depthWrite: false } : {}),
    });
    const mesh = new BatchedMesh(Math.max(1, ids.length), Math.max(3, vertices), Math.max(3, 3 * faces), material);
    for (const item of shapes.keys()) {
      const { corners, faces: own } = database.item(item);
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(corners, 3));
      geometry.setIndex(new BufferAttribute(Uint32Array.from(own), 1));
      shapes.set(item, mesh.addGeometry(geometry));
    }
    const matrix = new Matrix4();
    const copies = new Map();
    for (const id of ids) {
      const m = database.transforms.subarray(12 * id, 12 * id + 12);
      const copy = mesh.addInstance(shapes.get(database.finestOf(id)));
      mesh.setMatrixAt(copy, matrix.set(...m, 0, 0, 0, 1));
      copies.set(id, copy);
    }
    mesh.layers.set(layer);
    mesh.frustumCulled = false;
    mesh.sortObjects = clear;
    return { mesh, copies, ids };
  }

  get meshes() {
    return this.parts.map((part) => part.mesh);
  }

  /** The object that a copy in one of the meshes is. */
  idOf(mesh, copy) {
    return this.parts.find((part) => part.mesh === mesh).ids[copy];
  }

  /** Show some objects, given as an array of 0 and 1, and no others. */
  show(wanted) {
    for (const { mesh, copies } of this.parts) {
      for (const [id, copy] of copies) if (wanted[id] !== this.shown[id]) mesh.setVisibleAt(copy, !!wanted[id]);
    }
    this.shown = wanted;
  }

  /** Colour objects: what `of` says of each, three numbers from 0 to 1, or null for its own. */
  paint(of) {
    const colour = new Color();
    for (const { mesh, copies } of this.parts) {
      for (const [id, copy] of copies) mesh.setColorAt(copy, colour.setRGB(...(of(id) ?? this.colours[id]), "srgb"));
    }
  }
}
