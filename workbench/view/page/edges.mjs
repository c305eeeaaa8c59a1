// Edges of what is drawn: where faces meet at an angle. One draw call, as for faces.

import { BatchedMesh, BufferAttribute, BufferGeometry, EdgesGeometry, LineBasicMaterial } from "three";

const COLOUR = 0x2b2f33;
// Faces that meet at less are one curved surface [degrees].
const ANGLE = 30;
// Shapes with more faces have no edges: from where one sees them whole they would be black.
const FACES_MOST = 2_000;
const ROOM = 20_000;

export class Edges {
  /** Of at most so many copies, and none before `draw`; `planes` cut them, `layer` is that of the cameras that see them. */
  constructor(copies, layer, planes) {
    const material = new LineBasicMaterial({ color: COLOUR, clippingPlanes: planes, transparent: true, opacity: 0.45 });
    this.mesh = new BatchedMesh(Math.max(1, copies), ROOM, 0, material);
    // Drawn as lines: three.js goes by these words, not by the class.
    Object.assign(this.mesh, { isMesh: false, isLine: true, isLineSegments: true, frustumCulled: false, sortObjects: false, visible: false });
    this.mesh.layers.set(layer);
    this.none = this.mesh.addGeometry(lines(new Float32Array(6)));
    this.shapes = new Map();
    this.later = new Map();
  }

  /** Another copy, of nothing. */
  add(matrix) {
    const copy = this.mesh.addInstance(this.none);
    this.mesh.setMatrixAt(copy, matrix);
    this.mesh.setVisibleAt(copy, false);
  }

  /** A copy is an item, whose faces `made()` gives. */
  change(copy, item, made) {
    if (!this.mesh.visible) {
      this.later.set(copy, [item, made]);
      return;
    }
    if (!this.shapes.has(item)) this.shapes.set(item, this.shapeOf(made()));
    this.mesh.setGeometryIdAt(copy, this.shapes.get(item));
  }

  /** Draw them, or do not: who does not is spared the work of finding them. */
  draw(wanted) {
    this.mesh.visible = wanted;
    if (!wanted) return;
    for (const [copy, [item, made]] of this.later) this.change(copy, item, made);
    this.later.clear();
  }

  shapeOf(geometry) {
    if (geometry.index.count > 3 * FACES_MOST) return this.none;
    const found = new EdgesGeometry(geometry, ANGLE).attributes.position;
    if (!found.count) return this.none;
    const { mesh } = this;
    if (mesh.unusedVertexCount < found.count) mesh.optimize();
    if (mesh.unusedVertexCount < found.count) mesh.setGeometrySize(2 * mesh.geometry.attributes.position.count + found.count, 0);
    return mesh.addGeometry(lines(found.array));
  }

  /** Forget an item; these copies were it. */
  drop(item, copies) {
    for (const copy of copies) {
      this.later.delete(copy);
      this.mesh.setGeometryIdAt(copy, this.none);
    }
    const shape = this.shapes.get(item);
    if (shape !== undefined && shape !== this.none) this.mesh.deleteGeometry(shape);
    this.shapes.delete(item);
  }
}

function lines(ends) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(ends, 3));
  return geometry;
}
