// All objects as two draw calls, what is opaque and what is not: each shape once, each object a copy of one, at some level
// of detail, that can be hidden or coloured by itself.

import { BatchedMesh, BufferAttribute, BufferGeometry, Color, Matrix4 } from "three";

import { colourOf } from "./colours.mjs";
import { Edges } from "./edges.mjs";
import { Backs, faceMaterial } from "./faces.mjs";

// Room to begin with [vertices], and what it grows by.
const ROOM = 50_000;
const GROWTH = 1.6;
// Share of what colours mean: the rest is an object's own, so that one knows it again.
const MEANING = 0.7;

export class Batch {
  /** Objects of a database; `layer` is that of the cameras that see them, `planes` cut them. */
  constructor(database, layer, planes = []) {
    this.database = database;
    this.backs = new Backs();
    this.ids = Array.from({ length: database.objects }, (_, id) => id);
    this.parts = [false, true].map((clear) => this.part(clear, layer, planes));
    this.colours = this.ids.map((id) =>
      colourOf(database.colours[id], database.head.kinds[database.kinds[id]], database.head.names[id]));
    this.shown = new Uint8Array(database.objects);
    this.items = new Int32Array(database.objects).fill(-1);
    this.paint(() => null);
  }

  part(clear, layer, planes) {
    const { database } = this;
    const ids = this.ids.filter((id) => !!database.clear[id] === clear);
    const material = faceMaterial(clear, planes, this.backs);
    const room = ids.length ? ROOM : 3;
    const mesh = new BatchedMesh(Math.max(1, ids.length), room, 2 * room, material);
    const nothing = new BufferGeometry();
    nothing.setAttribute("position", new BufferAttribute(new Float32Array(9), 3));
    nothing.setIndex([0, 1, 2]);
    // A copy always has a shape: of an object that is not there, a point.
    const none = mesh.addGeometry(nothing);
    const edges = new Edges(clear ? 0 : ids.length, layer, planes);
    const matrix = new Matrix4();
    const copies = new Map();
    for (const id of ids) {
      const copy = mesh.addInstance(none);
      mesh.setMatrixAt(copy, matrix.set(...database.transforms.subarray(12 * id, 12 * id + 12), 0, 0, 0, 1));
      mesh.setVisibleAt(copy, false);
      if (!clear) edges.add(matrix);
      copies.set(id, copy);
    }
    mesh.layers.set(layer);
    mesh.frustumCulled = false;
    mesh.sortObjects = clear;
    return { mesh, edges: clear ? null : edges, copies, ids, none, shapes: new Map(), users: new Map() };
  }

  get meshes() {
    return this.parts.map((part) => part.mesh);
  }

  /** All that is drawn; one can point at `meshes` alone. */
  get all() {
    return [...this.meshes, ...this.parts.flatMap(({ edges }) => (edges ? [edges.mesh] : []))];
  }

  /** The object that a copy in one of the meshes is. */
  idOf(mesh, copy) {
    return this.parts.find((part) => part.mesh === mesh).ids[copy];
  }

  /** Show some objects, given as an array of 0 and 1, and no others, each as `itemOf(id)` says; -1 is nothing. */
  show(wanted, itemOf) {
    for (const part of this.parts) {
      for (const [id, copy] of part.copies) {
        const item = wanted[id] ? itemOf(id) : -1;
        if (item >= 0 && item !== this.items[id]) this.change(part, id, copy, item);
        const visible = item >= 0 ? 1 : 0;
        if (visible !== this.shown[id]) see(part, copy, !!visible);
        this.shown[id] = visible;
      }
    }
  }

  /** Draw edges of what is opaque, or do not. */
  drawEdges(wanted) {
    for (const { edges } of this.parts) edges?.draw(wanted);
  }

  /** Triangles of what is shown. */
  get triangles() {
    return this.ids.reduce((sum, id) => sum + (this.shown[id] ? this.database.itemFaces[this.items[id]] : 0), 0);
  }

  change(part, id, copy, item) {
    const users = part.users.get(item) ?? new Set();
    part.users.set(item, users.add(id));
    part.users.get(this.items[id])?.delete(id);
    this.items[id] = item;
    part.mesh.setGeometryIdAt(copy, this.shapeOf(part, item));
    part.edges?.change(copy, item, () => this.geometryOf(item));
  }

  shapeOf(part, item) {
    if (!part.shapes.has(item)) {
      const geometry = this.geometryOf(item);
      makeRoom(part.mesh, geometry.attributes.position.count, geometry.index.count);
      part.shapes.set(item, part.mesh.addGeometry(geometry));
    }
    return part.shapes.get(item);
  }

  geometryOf(item) {
    const { corners, faces } = this.database.item(item);
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(corners, 3));
    geometry.setIndex(new BufferAttribute(Uint32Array.from(faces), 1));
    return geometry;
  }

  /** Forget items, which are no longer in memory; what was drawn as one of them is not until it is shown anew. */
  drop(items) {
    for (const part of this.parts) {
      for (const item of items) {
        if (!part.shapes.has(item)) continue;
        const users = [...(part.users.get(item) ?? [])];
        part.edges?.drop(item, users.map((id) => part.copies.get(id)));
        for (const id of users) {
          part.mesh.setGeometryIdAt(part.copies.get(id), part.none);
          see(part, part.copies.get(id), false);
          this.items[id] = -1;
          this.shown[id] = 0;
        }
        part.users.delete(item);
        part.mesh.deleteGeometry(part.shapes.get(item));
        part.shapes.delete(item);
      }
    }
  }

  /** Colour objects: what `of` says of each, three numbers from 0 to 1, or null for its own. */
  paint(of) {
    const colour = new Color();
    for (const { mesh, copies } of this.parts) {
      for (const [id, copy] of copies) mesh.setColorAt(copy, colour.setRGB(...mixed(this.colours[id], of(id)), "srgb"));
    }
  }
}

/** A meaning's colour over an object's own, or that alone for null. */
function mixed(own, meaning) {
  return meaning ? own.map((x, k) => x + MEANING * (meaning[k] - x)) : own;
}

/** Whether a copy is drawn. */
function see({ mesh, edges }, copy, visible) {
  mesh.setVisibleAt(copy, visible);
  edges?.mesh.setVisibleAt(copy, visible);
}

/** Room in a mesh for a shape: where others were, or more. */
function makeRoom(mesh, vertices, corners) {
  const fits = () => mesh.unusedVertexCount >= vertices && mesh.unusedIndexCount >= corners;
  if (fits()) return;
  mesh.optimize();
  const size = mesh.geometry.attributes.position?.count ?? 0;
  // Once it is nearly full, it would be put in order for every shape.
  if (fits() && mesh.unusedVertexCount > size / 8) return;
  const [used, held] = [size - mesh.unusedVertexCount, mesh.geometry.index.count - mesh.unusedIndexCount];
  mesh.setGeometrySize(Math.ceil(GROWTH * (used + vertices)) + ROOM, Math.ceil(GROWTH * (held + corners)) + 2 * ROOM);
}
