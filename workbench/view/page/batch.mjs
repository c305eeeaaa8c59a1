// All objects as two draw calls, what is opaque and what is not: each shape once, each object a copy of one, at some level
// of detail, that can be hidden or coloured by itself.

import {
  BatchedMesh, BufferAttribute, BufferGeometry, Color, DoubleSide, Matrix4, MeshLambertMaterial,
} from "three";

import { colourOf } from "./colours.mjs";

// Room to begin with [vertices], and what it grows by.
const ROOM = 50_000;
const GROWTH = 1.6;

export class Batch {
  /** Objects of a database; `layer` is that of the cameras that see them, `planes` cut them. */
  constructor(database, layer, planes = []) {
    this.database = database;
    this.backs = { value: false };
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
    const material = new MeshLambertMaterial({
      side: DoubleSide, flatShading: true, clippingPlanes: planes,
      ...(clear ? { transparent: true, opacity: 0.35, depthWrite: false } : {}),
    });
    material.onBeforeCompile = (shader) => {
      shader.uniforms.backs = this.backs;
      // Differences of neighbouring pixels, by which faces are shaded, can vanish on a very large one: such are grounds.
      shader.fragmentShader = `uniform bool backs;\n${shader.fragmentShader}`
        .replace("#include <color_fragment>",
          "#include <color_fragment>\nif (backs && !gl_FrontFacing) diffuseColor.rgb = vec3(0.6, 0.19, 0.38);")
        .replace("#include <normal_fragment_begin>",
          "#include <normal_fragment_begin>\nif (!(dot(normal, normal) > 0.5)) normal = (viewMatrix * vec4(0.0, 0.0, 1.0, 0.0)).xyz;");
    };
    const room = ids.length ? ROOM : 3;
    const mesh = new BatchedMesh(Math.max(1, ids.length), room, 2 * room, material);
    const nothing = new BufferGeometry();
    nothing.setAttribute("position", new BufferAttribute(new Float32Array(9), 3));
    nothing.setIndex([0, 1, 2]);
    // A copy always has a shape: of an object that is not there, a point.
    const none = mesh.addGeometry(nothing);
    const matrix = new Matrix4();
    const copies = new Map();
    for (const id of ids) {
      const copy = mesh.addInstance(none);
      mesh.setMatrixAt(copy, matrix.set(...database.transforms.subarray(12 * id, 12 * id + 12), 0, 0, 0, 1));
      mesh.setVisibleAt(copy, false);
      copies.set(id, copy);
    }
    mesh.layers.set(layer);
    mesh.frustumCulled = false;
    mesh.sortObjects = clear;
    return { mesh, copies, ids, none, shapes: new Map(), users: new Map() };
  }

  get meshes() {
    return this.parts.map((part) => part.mesh);
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
        if (visible !== this.shown[id]) part.mesh.setVisibleAt(copy, !!visible);
        this.shown[id] = visible;
      }
    }
  }

  /** Colour what is seen from behind, or do not. */
  markBacks(marked) {
    this.backs.value = marked;
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
  }

  shapeOf(part, item) {
    if (!part.shapes.has(item)) {
      const { corners, faces } = this.database.item(item);
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(corners, 3));
      geometry.setIndex(new BufferAttribute(Uint32Array.from(faces), 1));
      makeRoom(part.mesh, corners.length / 3, faces.length);
      part.shapes.set(item, part.mesh.addGeometry(geometry));
    }
    return part.shapes.get(item);
  }

  /** Forget items, which are no longer in memory; what was drawn as one of them is not until it is shown anew. */
  drop(items) {
    for (const part of this.parts) {
      for (const item of items) {
        if (!part.shapes.has(item)) continue;
        for (const id of part.users.get(item) ?? []) {
          part.mesh.setGeometryIdAt(part.copies.get(id), part.none);
          part.mesh.setVisibleAt(part.copies.get(id), false);
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
      for (const [id, copy] of copies) mesh.setColorAt(copy, colour.setRGB(...(of(id) ?? this.colours[id]), "srgb"));
    }
  }
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
