// What is drawn: the model from inside and from above, each with a camera and layers of its own.

import {
  CircleGeometry, Color, DirectionalLight, HemisphereLight, MathUtils, Mesh, MeshBasicMaterial, PerspectiveCamera, Plane, Raycaster,
  Scene, SphereGeometry, Vector2, Vector3, WebGLRenderer,
} from "three";

import { Batch } from "./batch.mjs";
import { MEMORY, VERDICTS, levelColour, rgb } from "./colours.mjs";
import { Marks } from "./marks.mjs";
import { Lines, boxLines, portalBoxes } from "./outlines.mjs";

export const [INSIDE, ABOVE] = [0, 1];
const FOV = 75;
// How far the eye's frustum is drawn [m].
const REACH = 6;

export class Stage {
  constructor(canvas, database) {
    this.database = database;
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.renderer.autoClear = false;
    this.renderer.localClippingEnabled = true;
    this.scene = new Scene();
    this.bounds = database.head.bounds;
    this.cut = new Plane(new Vector3(0, 0, -1), this.bounds[5] + 1);
    this.inside = new Batch(database, INSIDE);
    this.above = new Batch(database, ABOVE, [this.cut]);
    this.scene.add(...this.inside.all, ...this.above.all);
    this.eye = new PerspectiveCamera(FOV, 1, 0.05, 2 * this.size());
    this.sky = new PerspectiveCamera(45, 1, 1, 8 * this.size());
    this.eye.up.set(0, 0, 1);
    this.sky.up.set(0, 0, 1);
    this.eye.layers.set(INSIDE);
    this.sky.layers.set(ABOVE);
    this.orbit = { turn: -0.9, rise: 0.9, away: 1.15 * this.size() };
    this.light();
    this.head = new Mesh(new SphereGeometry(0.35), new MeshBasicMaterial({ color: 0xd55e00 }));
    const lines = { frustum: 0xd55e00, cell: 0xd55e00, cells: 0x0072b2, range: 0x0072b2, portals: 0x007a58, wedge: 0xcc79a7, stabbed: 0x007a58, stabs: 0x009e73 };
    const whole = ["frustum", "cell", "wedge", "stabbed", "stabs"];
    this.lines = Object.fromEntries(Object.entries(lines).map(([name, colour]) =>
      [name, new Lines(colour, ABOVE, whole.includes(name) ? [] : [this.cut], name === "stabs")]));
    this.marks = new Marks(database.maze, [INSIDE, ABOVE], INSIDE);
    this.scene.add(this.marks.group);
    this.head.layers.set(ABOVE);
    this.land = new Mesh(new CircleGeometry(4 * this.size(), 64), new MeshBasicMaterial({ depthWrite: false }));
    const b = this.bounds;
    this.land.position.set((b[0] + b[3]) / 2, (b[1] + b[4]) / 2, b[2]);
    // Drawn first and without a depth it is behind all else: depths of so large a triangle are not exact.
    this.land.renderOrder = -1;
    this.land.layers.enable(ABOVE);
    this.scene.add(this.land, this.head, ...Object.values(this.lines).map((one) => one.mesh));
  }

  size() {
    const b = this.bounds;
    return Math.max(10, Math.hypot(b[3] - b[0], b[4] - b[1], b[5] - b[2]));
  }

  light() {
    const sky = new HemisphereLight(0xffffff, 0xb4b0a8, 2.1);
    const sun = new DirectionalLight(0xffffff, 1.1);
    sky.position.set(0, 0, 1);
    sun.position.set(0.5, -0.7, 1.2);
    for (const one of [sky, sun]) one.layers.enableAll();
    this.scene.add(sky, sun);
  }

  /** Colours of the sky and of the ground. */
  dress([sky, land]) {
    this.scene.background = new Color(sky);
    this.land.material.color.set(land);
  }

  /** Draw from an eye to what of portals is in its sight. */
  wedge(eye, polygons) {
    const ends = polygons.flatMap((polygon) => polygon.flatMap((corner, k) =>
      [[0, 0, 0], corner, corner, polygon[(k + 1) % polygon.length]].flatMap((point) => point.map((x, axis) => x + eye[axis]))));
    this.lines.wedge.set(new Float32Array(ends));
  }

  /** Where on the page the view from above is. */
  skyPart(view) {
    const width = this.canvas.clientWidth;
    const left = { inside: width, both: Math.floor(width / 2), above: 0 }[view];
    return { left, width: width - left };
  }

  /** Show all there is from above: at the levels of the view from inside where they are asked for, else as fine as is here. */
  all(colours) {
    const { database, inside, above } = this;
    this.every ??= new Uint8Array(database.objects).fill(1);
    above.show(this.every, (id) => (colours === "levels" && inside.shown[id] ? inside.items[id] : this.fit(id)));
  }

  /** What is looked at from afar: of a model that streams, the coarsest level. */
  fit(id) {
    const { database } = this;
    return database.itemNear(id, database.head.streams ? database.itemStarts[id + 1] - database.itemStarts[id] - 1 : 0);
  }

  /** Colour by verdicts, memory, levels or backs, or as the model is; `verdicts` by id, `stateOf(id)` in memory, of an eye
   * in a `cell`. */
  colour(colours, { verdicts, stateOf, cell }) {
    const { above, inside, database } = this;
    const level = (id) => database.items.indexOf(inside.items[id], database.itemStarts[id]) - database.itemStarts[id];
    const hidden = rgb(VERDICTS.hidden);
    const of = {
      verdicts: (id) => rgb(VERDICTS[verdicts[id]]),
      memory: (id) => rgb(MEMORY[stateOf(id)]),
      levels: (id) => (inside.shown[id] ? levelColour(level(id)) : hidden),
    }[colours];
    const box = cell < 0 ? null : database.cellBoxes.subarray(6 * cell, 6 * cell + 6);
    for (const batch of [above, inside]) batch.backs.of(colours === "backs" ? box : null);
    above.paint(of ?? (() => null));
    if (colours === "levels" || this.painted) inside.paint(colours === "levels" ? of : () => null);
    this.painted = colours === "levels";
  }

  /** Draw edges, or do not. */
  edges(wanted) {
    for (const batch of [this.above, this.inside]) batch.drawEdges(wanted);
  }

  /** Whether the processor draws: it takes long for lines. */
  get slow() {
    const context = this.renderer.getContext();
    const named = context.getExtension("WEBGL_debug_renderer_info");
    return !!named && /swiftshader|llvmpipe|software/i.test(context.getParameter(named.UNMASKED_RENDERER_WEBGL));
  }

  /** Stabbing lines from a cell, and the portals that they pass, in sequence. */
  sequences(lines) {
    const portals = [...new Set(lines.flatMap((line) => line.portals))];
    this.lines.stabbed.set(boxLines(portalBoxes(this.database.maze, portals)));
    this.lines.stabs.set(new Float32Array(lines.flatMap(({ from, to }) => [...from, ...to])));
  }

  /** Lines around cells in range. */
  range(cells) {
    this.lines.range.set(boxLines(cells.flatMap(([cell]) => [...this.database.cellBoxes.subarray(6 * cell, 6 * cell + 6)])));
  }

  /** Items are no longer in memory. */
  drop(items) {
    this.inside.drop(items);
    this.above.drop(items);
  }

  /** Pixels of a metre at a metre. */
  focal() {
    return this.canvas.clientHeight / 2 / Math.tan((FOV * Math.PI) / 360);
  }

  /** Keep what a visitor sees for the eye's frustum while they walk on, and give a copy of them; or go on, for null. */
  hold(visitor) {
    this.held = visitor && this.eye.clone();
    return visitor && { point: [...visitor.point], cell: visitor.cell };
  }

  /** Lines around a cell, and, if asked for, cells that may be seen from it and all their portals. */
  outline(cell, cells, portals) {
    const { maze, cellBoxes } = this.database;
    const boxes = (ids) => ids.flatMap((id) => [...cellBoxes.subarray(6 * id, 6 * id + 6)]);
    this.lines.cell.set(boxLines(cell < 0 ? [] : boxes([cell])));
    this.lines.cells.set(boxLines(boxes(cells)));
    this.lines.portals.set(boxLines(portalBoxes(maze, portals)));
  }

  /** Turn the eye to where a visitor looks, in the part of the page that a view leaves it. */
  aim(visitor, view) {
    const { eye, canvas } = this;
    eye.position.set(...visitor.point);
    eye.lookAt(...visitor.point.map((x, k) => x + visitor.ahead[k]));
    const width = view === "both" ? Math.floor(canvas.clientWidth / 2) : canvas.clientWidth;
    eye.aspect = Math.max(1, width) / Math.max(1, canvas.clientHeight);
    eye.updateProjectionMatrix();
    eye.updateMatrixWorld();
  }

  /** Planes through the eye and the borders of its picture: unit normals that point inwards. */
  planes() {
    const ways = this.corners();
    return ways.map((way, k) => new Vector3().crossVectors(ways[(k + 1) % 4], way).normalize().toArray());
  }

  /** Ways from the eye to the corners of its picture, anticlockwise. */
  corners() {
    const eye = this.held ?? this.eye;
    const at = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
    return at.map(([x, y]) => new Vector3(x, y, 0.5).unproject(eye).sub(eye.position).normalize());
  }

  /** Draw what a visitor sees, and, below a height, where they are: `inside`, `above`, or `both`. */
  draw(visitor, view, height) {
    const { renderer, canvas, eye, sky, head } = this;
    const [width, depth] = [canvas.clientWidth, canvas.clientHeight];
    const ratio = Math.min(devicePixelRatio, 2);
    if (canvas.width !== Math.floor(width * ratio) || canvas.height !== Math.floor(depth * ratio)) {
      renderer.setPixelRatio(ratio);
      renderer.setSize(width, depth, false);
    }
    this.cut.constant = height;
    this.aim(visitor, view);
    head.position.copy((this.held ?? eye).position);
    if (view !== "above") this.lines.frustum.set(this.frustum());
    const { turn, rise, away } = this.orbit;
    const middle = view === "both" ? visitor.point : [0, 1, 2].map((k) => (this.bounds[k] + this.bounds[k + 3]) / 2);
    const far = view === "both" ? Math.min(away, 32) * (away / (1.15 * this.size())) : away;
    sky.position.set(middle[0] + far * Math.cos(rise) * Math.cos(turn), middle[1] + far * Math.cos(rise) * Math.sin(turn), middle[2] + far * Math.sin(rise));
    sky.lookAt(...middle);
    renderer.setScissorTest(false);
    renderer.clear();
    const half = Math.floor(width / 2);
    if (view !== "above") this.part(eye, 0, view === "both" ? half : width, depth);
    const [left, rest] = view === "both" ? [half, width - half] : [0, width];
    sky.aspect = rest / depth;
    sky.updateProjectionMatrix();
    if (view !== "inside") this.part(sky, left, rest, depth);
  }

  /** The object at a place of the page's picture and the point of it there, of those that are drawn; or null. */
  pick(x, y, view) {
    const { canvas, eye, sky } = this;
    const half = view === "both" ? Math.floor(canvas.clientWidth / 2) : canvas.clientWidth;
    const above = view === "above" || x >= half;
    const [left, width] = above && view === "both" ? [half, canvas.clientWidth - half] : [0, half];
    const caster = new Raycaster();
    caster.layers.set(above ? ABOVE : INSIDE);
    const at = new Vector2(2 * (x - left) / width - 1, 1 - 2 * y / canvas.clientHeight);
    caster.setFromCamera(at, above ? sky : eye);
    const batch = above ? this.above : this.inside;
    const hits = caster.intersectObjects(batch.meshes, false).filter(({ point }) => !above || point.z <= this.cut.constant);
    // What one sees through is asked for only where nothing is behind it.
    const hit = hits.find(({ object }) => object === batch.meshes[0]) ?? hits[0];
    return hit ? { id: batch.idOf(hit.object, hit.batchId), point: hit.point.toArray() } : null;
  }

  part(camera, left, width, depth) {
    const { renderer } = this;
    renderer.setViewport(left, 0, width, depth);
    renderer.setScissor(left, 0, width, depth);
    renderer.setScissorTest(true);
    renderer.clear();
    renderer.render(this.scene, camera);
  }

  /** Edges of what the eye's picture shows, as far as REACH, 6 numbers each. */
  frustum() {
    const eye = this.held ?? this.eye;
    const corners = this.corners().map((way) => way.multiplyScalar(REACH).add(eye.position).toArray());
    const middle = eye.position.toArray();
    return new Float32Array(corners.flatMap((corner, k) => [...middle, ...corner, ...corner, ...corners[(k + 1) % 4]]));
  }

  /** Turn the view from above. */
  swing(right, up) {
    this.orbit.turn -= 0.006 * right;
    this.orbit.rise = MathUtils.clamp(this.orbit.rise + 0.006 * up, 0.1, 1.5);
  }

  /** Come nearer, or go away. */
  zoom(factor) {
    this.orbit.away = MathUtils.clamp(this.orbit.away * factor, 4, 4 * this.size());
  }
}
