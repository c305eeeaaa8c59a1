// The plan of a storey, drawn on a canvas.
import { boxAt, HIDDEN, SEEN, UNKNOWN, WORD } from "./data.mjs";
import { ink, takeInk } from "./ink.mjs";
import { cutBy, floorArea } from "./storeys.mjs";
import { fitted, outOfSight, rectangle, scaleBar, toX, toY, wantedHeight } from "./view.mjs";

// Cut surfaces in the order of drawing: verdict or role of their object, its colour's name, width and dashes.
const BY_VERDICT = [
  [HIDDEN, "hiddenEdge", 1, []],
  [SEEN, "seenEdge", 2.2, []],
  [UNKNOWN, "unknownEdge", 2.6, [6, 4]],
];
const BY_ROLE = [
  [1, "detail", 0.8, []],
  [2, "glass", 1.4, []],
  [0, "wall", 1.5, []],
];

/** The pattern of what is unknown. */
function makeHatch(pen, pixelRatio) {
  const tile = document.createElement("canvas");
  tile.width = tile.height = Math.round(8 * pixelRatio);
  const p = tile.getContext("2d"),
    n = tile.width;
  p.strokeStyle = ink.hatch;
  p.lineWidth = 1.3 * pixelRatio;
  for (const d of [-n, 0, n]) p.stroke(new Path2D(`M${d} ${n}L${d + n} 0`));
  const pattern = pen.createPattern(tile, "repeat");
  pattern.setTransform(new DOMMatrix().scale(1 / pixelRatio));
  return pattern;
}

/** Fills a path; what is unknown is hatched, too, and the view cell has a border. */
function paintPath({ pen, hatch }, path, look) {
  pen.fillStyle = ink[look];
  pen.fill(path);
  if (look === "unknown") {
    pen.fillStyle = hatch;
    pen.fill(path);
  }
  if (look === "source") {
    Object.assign(pen, { lineWidth: 2.5, strokeStyle: ink.border });
    pen.stroke(path);
  }
}

/** A cell's plan, or an object's box, as a path in pixels. */
function outlineOf({ view, bake }, kind, id) {
  const path = new Path2D();
  if (kind === "object") path.rect(...rectangle(view, bake.box(kind, id)));
  else for (const [x, y] of bake.plan(id)) path.lineTo(toX(view, x), toY(view, y));
  path.closePath();
  return path;
}

/** Adds a line between two points on the ground to the path. */
function addLine({ pen, view }, from, to) {
  pen.moveTo(toX(view, from[0]), toY(view, from[1]));
  pen.lineTo(toX(view, to[0]), toY(view, to[1]));
}

/** What of a storey's plan is in sight, in the order of drawing: {id, b, r}, the box and its rectangle in pixels. */
function inSight({ view, bake, state }, kind) {
  const placed = bake.on(kind, state.storey).map((id) => ({ id, b: bake.box(kind, id) }));
  return placed.map((one) => ({ ...one, r: rectangle(view, one.b) })).filter(({ r }) => !outOfSight(view, r));
}

/** The ground, and on it cells: those that the section cuts lie over view cells above or below it, drawn dashed. */
function drawCells(frame) {
  const { pen, view, bake, state, storey } = frame,
    { inhabitable } = bake.cells,
    coloured = state.layer === "cell",
    shown = inSight(frame, "cell"),
    cut = shown.filter(({ b }) => cutBy(b, storey)),
    apart = shown.filter(({ b }) => !cutBy(b, storey));
  pen.fillStyle = bake.facts.claimsCells ? ink.ground : ink.paper;
  pen.fillRect(0, 0, view.width, view.height);
  for (const { id } of bake.facts.claimsCells ? [...apart, ...cut] : [])
    paintPath(frame, outlineOf(frame, "cell", id), coloured ? WORD[state.verdicts.cell[id]] : inhabitable[id] ? "room" : "other");
  for (const { id, b, r } of [...cut, ...apart]) {
    if (!inhabitable[id] && Math.min(r[2], r[3]) <= 1.5) continue;
    Object.assign(pen, { lineWidth: inhabitable[id] ? 0.9 : 0.4, strokeStyle: inhabitable[id] ? ink.roomEdge : ink.otherEdge });
    pen.setLineDash(cutBy(b, storey) ? [] : [4, 3]);
    pen.stroke(outlineOf(frame, "cell", id));
  }
  pen.setLineDash([]);
  for (const { id } of coloured ? shown.filter(({ id }) => state.from.includes(id)) : [])
    paintPath(frame, outlineOf(frame, "cell", id), "source");
}

function drawObjects(frame) {
  const { pen, bake, state, storey } = frame,
    { low, high } = bake.extent,
    large = 0.04 * (high[0] - low[0]) * (high[1] - low[1]);
  if (state.layer !== "object") return;
  const shown = inSight(frame, "object");
  for (const verdict of [HIDDEN, SEEN, UNKNOWN]) {
    Object.assign(pen, { strokeStyle: ink[`${WORD[verdict]}Edge`], lineWidth: verdict === HIDDEN ? 0.7 : 1.4 });
    pen.setLineDash(verdict === UNKNOWN ? [5, 3] : []);
    for (const { id: object, b, r } of shown.filter(({ id }) => state.verdicts.object[id] === verdict)) {
      const small = floorArea(b) < large;
      if (small) {
        pen.globalAlpha = verdict === HIDDEN ? 0.55 : 0.6;
        paintPath(frame, outlineOf(frame, "object", object), WORD[verdict]);
        pen.globalAlpha = 1;
      }
      if (small || !cutBy(b, storey)) pen.strokeRect(...r);
    }
  }
}

/** Cut surfaces: by verdict of their object where objects are coloured, else by role. */
function drawSurfaces(frame) {
  const { pen, bake, state, storey } = frame,
    { lines, owners, step } = storey;
  const [key, passes] = state.layer === "object" ? [state.verdicts.object, BY_VERDICT] : [bake.objects.role, BY_ROLE];
  pen.lineCap = "round";
  for (const [value, colour, lineWidth, dashes] of passes) {
    pen.beginPath();
    for (let n = 0; n < owners.length; n++) {
      if (key[owners[n]] !== value) continue;
      const [x, y, u, v] = [0, 1, 2, 3].map((k) => lines[4 * n + k] * step);
      addLine(frame, [x, y], [u, v]);
    }
    Object.assign(pen, { strokeStyle: ink[colour], lineWidth });
    pen.setLineDash(dashes);
    pen.stroke();
  }
}

/** The view cells that are looked from, over coloured objects. */
function drawSource(frame) {
  const { pen, bake, state } = frame;
  if (state.layer !== "object") return;
  pen.globalAlpha = 0.55;
  for (const cell of state.from.filter((one) => bake.cells.storey[one] === state.storey))
    paintPath(frame, outlineOf(frame, "cell", cell), "source");
}

function strokePortal(frame, b, lineWidth) {
  frame.pen.lineWidth = lineWidth;
  frame.pen.beginPath();
  addLine(frame, b, b.subarray(3));
  frame.pen.stroke();
}

function drawPortals(frame) {
  const { pen, view, bake, state, storey } = frame,
    { cells, portals } = bake;
  if (!state.portals) return;
  const entered = (cell) => cells.inhabitable[cell] && cutBy(bake.box("cell", cell), storey);
  pen.strokeStyle = ink.portal;
  for (let id = 0; id < portals.axis.length; id++) {
    const b = boxAt(portals.boxes, id);
    if (portals.axis[id] === 2) {
      if (!portals.cells.subarray(2 * id, 2 * id + 2).some(entered)) continue;
      Object.assign(pen, { lineWidth: 0.7, globalAlpha: 0.7 });
      pen.setLineDash([2, 3]);
      pen.strokeRect(...rectangle(view, b));
      pen.setLineDash([]);
      pen.globalAlpha = 1;
    } else if (cutBy(b, storey)) {
      strokePortal(frame, b, Math.max(1, Math.min(2.4, view.scale / bake.facts.gridMetres / 14)));
    }
  }
}

/** Sightlines to all targets of the kinds that are switched on, fainter where there are many. */
function drawSightlines(frame) {
  const { pen, bake, state } = frame;
  for (const kind of bake.kinds) {
    if (!state.lines[kind]) continue;
    const relation = bake.relations[kind],
      targets = state.from.reduce((sum, cell) => sum + relation.numbers(cell).potential, 0);
    Object.assign(pen, { strokeStyle: ink.sight, lineWidth: kind === "cell" ? 0.9 : 0.6 });
    pen.globalAlpha = Math.max(0.25, Math.min(0.8, 60 / Math.max(1, targets)));
    pen.beginPath();
    for (const cell of state.from)
      relation.each(cell, (target, verdict, row) => {
        const sight = relation.sightlineOf(row);
        if (sight) addLine(frame, ...sight.ends);
      });
    pen.stroke();
  }
}

/** Labels of a storey's view cells that have room: {lines, font, x, y} in pixels; `measure(text, font)` is the width. */
export function placeLabels(frame, measure) {
  const { bake, state, storey } = frame,
    { inhabitable, names } = bake.cells,
    placed = [];
  const own = ({ id }) => id === state.cell,
    order = inSight(frame, "cell").reverse();
  for (const one of order.sort((a, b) => own(b) - own(a))) {
    const [x, y, w, h] = one.r,
      [id, name] = [String(one.id), names[one.id]],
      font = `${own(one) ? 700 : 500} 12px system-ui, sans-serif`,
      wide = (text) => measure(text, font);
    if (!inhabitable[one.id] || !(own(one) || cutBy(one.b, storey)) || w < 16 || h < 14) continue;
    const lines = name && wide(name) < w - 6 && h > 32 ? [id, name] : wide(id) < w - 3 ? [id] : [];
    if (!lines.length) continue;
    const half = Math.max(...lines.map(wide)) / 2,
      tall = 8 * lines.length,
      [cx, cy] = [x + w / 2, y + h / 2],
      room = [cx - half, cy - tall, cx + half, cy + tall];
    const meets = (t) => t[0] < room[2] && room[0] < t[2] && t[1] < room[3] && room[1] < t[3];
    if (!placed.some((other) => meets(other.room))) placed.push({ lines, font, x: cx, y: cy, room });
  }
  return placed;
}

function drawLabels(frame) {
  const { pen } = frame;
  Object.assign(pen, { textAlign: "center", textBaseline: "middle", lineWidth: 3.5 });
  Object.assign(pen, { strokeStyle: ink.halo, fillStyle: ink.text });
  const measure = (text, font) => {
    pen.font = font;
    return pen.measureText(text).width;
  };
  for (const { lines, font, x, y } of placeLabels(frame, measure)) {
    pen.font = font;
    lines.forEach((text, n) => {
      const line = y + (n - (lines.length - 1) / 2) * 15;
      pen.strokeText(text, x, line);
      pen.fillText(text, x, line);
    });
  }
}

/** Outline of a target, dashed on another storey, and its sightline with the portals that it passes. */
function drawTarget(frame, { kind, id }) {
  const { pen, view, bake, state } = frame,
    { portals } = bake;
  Object.assign(pen, { strokeStyle: ink.target, lineWidth: 3 });
  pen.setLineDash(bake.storeyOf(kind, id) === state.storey ? [] : [6, 4]);
  pen.strokeRect(...rectangle(view, bake.box(kind, id)));
  pen.setLineDash([]);
  const sight = state.sightline({ kind, id });
  if (!sight) return;
  pen.strokeStyle = ink.portal;
  for (const portal of sight.portals) {
    const b = boxAt(portals.boxes, portal);
    if (portals.axis[portal] === 2) {
      pen.lineWidth = 2;
      pen.strokeRect(...rectangle(view, b));
    } else strokePortal(frame, b, 5);
  }
  drawSight(frame, sight.ends, ink.halo, 5);
  drawSight(frame, sight.ends, ink.target, 2.4);
  drawArrow(pen, ...sight.ends.map(([x, y]) => [toX(view, x), toY(view, y)]));
}

function drawTargets(frame) {
  for (const target of [frame.state.target, frame.state.hover]) if (target) drawTarget(frame, target);
}

/** A line with a dot where it starts. */
function drawSight(frame, [from, to], colour, lineWidth) {
  const { pen, view } = frame;
  Object.assign(pen, { strokeStyle: colour, fillStyle: colour, lineWidth });
  pen.beginPath();
  addLine(frame, from, to);
  pen.stroke();
  pen.beginPath();
  pen.arc(toX(view, from[0]), toY(view, from[1]), lineWidth + 1.5, 0, 7);
  pen.fill();
}

function drawArrow(pen, [ax, ay], [bx, by]) {
  const turn = Math.atan2(by - ay, bx - ax);
  pen.beginPath();
  pen.moveTo(bx, by);
  for (const side of [-0.4, 0.4]) pen.lineTo(bx - 12 * Math.cos(turn + side), by - 12 * Math.sin(turn + side));
  pen.fill();
}

function drawScale({ pen, view, bake }) {
  const { metres, wide } = scaleBar(view, bake.facts.gridMetres),
    x = 14,
    y = view.height - 16;
  pen.fillStyle = ink.halo;
  pen.fillRect(x - 7, y - 22, Math.max(wide, 36) + 14, 32);
  Object.assign(pen, { fillStyle: ink.text, font: "12px system-ui, sans-serif" });
  pen.fillRect(x, y, wide, 3);
  pen.fillText(`${metres} m`, x, y - 6);
}

// What is drawn first lies below.
const AREAS = [drawCells, drawObjects, drawSurfaces, drawSource];
const OVERLAYS = [drawPortals, drawSightlines, drawLabels, drawTargets, drawScale];

/** The canvas that shows what is chosen. */
export class Plan {
  #asked = 0;
  #hatch = null;

  constructor(canvas, state) {
    Object.assign(this, { canvas, state, pen: canvas.getContext("2d") });
    state.on("cell room storey layer lines portals target hover view", () => this.draw());
    new ResizeObserver(() => this.resize()).observe(canvas);
    const dark = window.matchMedia("(prefers-color-scheme: dark)");
    takeInk(dark.matches);
    dark.addEventListener("change", () => {
      takeInk(dark.matches);
      this.resize();
    });
  }

  /** Paints once before the browser shows its next picture, however often it is asked. */
  draw() {
    this.#asked ||= requestAnimationFrame(() => {
      this.#asked = 0;
      this.paint();
    });
  }

  paint() {
    const { canvas, pen, state } = this,
      { bake, view } = state;
    if (!view.width) return;
    const frame = { pen, hatch: this.#hatch, view, bake, state, storey: bake.storeys[state.storey] };
    for (const layer of [...AREAS, ...OVERLAYS]) {
      pen.save();
      layer(frame);
      pen.restore();
    }
    // Where the plan looks, for scripts: its middle [grid steps] and pixels a grid step.
    canvas.dataset.view = `${view.x} ${view.y} ${view.scale}`;
  }

  /** Takes the room that there is; the first time, shows everything. */
  resize() {
    const { canvas, pen, state } = this,
      { extent } = state.bake,
      pixelRatio = window.devicePixelRatio || 1,
      first = !state.view.width,
      width = canvas.clientWidth;
    canvas.style.height = `${wantedHeight(extent, width, window.innerHeight)}px`;
    const height = canvas.clientHeight,
      view = { ...state.view, width, height };
    canvas.width = Math.round(width * pixelRatio);
    canvas.height = Math.round(height * pixelRatio);
    pen.setTransform(pixelRatio, 0, 0, pixelRatio, 0, 0);
    pen.lineJoin = "round";
    this.#hatch = makeHatch(pen, pixelRatio);
    state.set({ view: first ? fitted(view, extent) : view });
    // At once, for a canvas that changes its size is blank.
    this.paint();
  }
}
