"use strict";
(async () => {
  // Verdicts, in the order of certainty that something is visible.
  const HIDDEN = 0,
    UNKNOWN = 1,
    SEEN = 2;
  const WORD = ["hidden", "unknown", "seen"];
  // Codes of the page's rows; what has no row is hidden.
  const ROW_UNKNOWN = 0,
    ROW_SIGHTLINE = 1;
  const ROLE_WORD = ["occluder", "detail", "transparent"];
  const PLAN_LEAST = 400;
  const LISTED = 200,
    ROWS_SHOWN = 12;
  const FILL = {
    none: "#e1e6ea",
    other: "#ffffff",
    room: "#fbf3e2",
    seen: "#a9d8f3",
    unknown: "#f6d38a",
    hidden: "#ffffff",
    source: "#d55e00",
  };
  const STROKE = {
    wall: "#20262c",
    detail: "#7d7268",
    glass: "#56a5cf",
    portal: "#007a58",
    sight: "#0072b2",
    target: "#a8437c",
    seen: "#0072b2",
    unknown: "#c27a00",
    hidden: "#a3acb4",
    hatch: "#9a6700",
  };
  const SERIES = ["#0072b2", "#d55e00", "#009e73", "#a8437c", "#555555", "#56b4e9"];
  const $ = (id) => document.getElementById(id);
  const count = (n) => n.toLocaleString("en-US");

  /** An element with properties and children; text is never read as HTML. */
  function make(tag, properties = {}, ...children) {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(properties)) {
      if (name in element) element[name] = value;
      else element.setAttribute(name, value);
    }
    element.append(...children);
    return element;
  }

  function complain(text) {
    $("notice").textContent = text;
    $("notice").hidden = false;
  }

  // ---------------------------------------------------------------- data

  async function unzip(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).arrayBuffer();
  }

  const TYPES = { u1: Uint8Array, i1: Int8Array, u2: Uint16Array, i2: Int16Array, u4: Uint32Array, i4: Int32Array };

  /** Replaces every packed array by a typed array, every packed value by itself. */
  async function unpack(node) {
    if (node === null || typeof node !== "object") return node;
    if ("gzip" in node) {
      const buffer = await unzip(node.gzip);
      return node.dtype === "json" ? JSON.parse(new TextDecoder().decode(buffer)) : new TYPES[node.dtype](buffer);
    }
    const names = Object.keys(node);
    const values = await Promise.all(names.map((name) => unpack(node[name])));
    names.forEach((name, i) => {
      node[name] = values[i];
    });
    return node;
  }

  /** Rows of a table: verdicts of a source, and the sightline of a row if the page holds it. */
  class Relation {
    constructor(rows, targetCount) {
      Object.assign(this, rows);
      this.targetCount = targetCount;
      this.targets = new Int32Array(this.gaps.length);
      for (let cell = 0; cell + 1 < this.starts.length; cell++) {
        let target = 0;
        for (let row = this.starts[cell]; row < this.starts[cell + 1]; row++) {
          target += this.gaps[row];
          this.targets[row] = target;
        }
      }
      this.lineOf = new Int32Array(this.codes.length).fill(-1);
      let line = 0;
      this.codes.forEach((code, row) => {
        if (code === ROW_SIGHTLINE) this.lineOf[row] = line++;
      });
      this.portalStarts = new Uint32Array(line + 1);
      for (let i = 0; i < line; i++) this.portalStarts[i + 1] = this.portalStarts[i] + this.crossings[i];
    }

    verdicts(source) {
      const out = new Uint8Array(this.targetCount);
      for (let row = this.starts[source]; row < this.starts[source + 1]; row++) {
        out[this.targets[row]] = this.codes[row] === ROW_UNKNOWN ? UNKNOWN : SEEN;
      }
      return out;
    }

    row(source, target) {
      for (let row = this.starts[source]; row < this.starts[source + 1]; row++) {
        if (this.targets[row] === target) return row;
      }
      return -1;
    }

    /** Both ends [grid steps] and the portals passed, or null. */
    sightline(row) {
      const line = row < 0 ? -1 : this.lineOf[row];
      if (line < 0) return null;
      const ends = [0, 1].map((end) =>
        [0, 1, 2].map((k) => this.low[k] + this.unit[k] * this.lines[6 * line + 3 * end + k]),
      );
      return { ends, portals: Array.from(this.portals.subarray(this.portalStarts[line], this.portalStarts[line + 1])) };
    }
  }

  if (typeof DecompressionStream === "undefined") {
    complain("This page needs a browser of 2023 or later: yours cannot unpack the data in it (DecompressionStream).");
    return;
  }
  const data = await unpack(JSON.parse($("data").textContent));
  const { facts, cells, portals, objects, storeys } = data;
  const cellCount = cells.inhabitable.length,
    objectCount = objects.names.length;
  const relations = {
    cell: new Relation(data.cellRows, cellCount),
    object: new Relation(data.objectRows, objectCount),
  };
  const boxesOf = { cell: cells.boxes, object: objects.boxes };
  const sources = [];
  cells.inhabitable.forEach((yes, cell) => {
    if (yes) sources.push(cell);
  });
  const kinds = [...(facts.claimsCells ? ["cell"] : []), ...(objectCount ? ["object"] : [])];
  const metres = (steps) => steps * facts.gridMetres;
  const level = facts.claimsCells ? "Storey" : "Level";

  const box = (kind, id) => boxesOf[kind].subarray(6 * id, 6 * id + 6);
  const area = (b) => (b[3] - b[0]) * (b[4] - b[1]);
  const diagonal = (b) => (b[3] < b[0] ? 0 : metres(Math.hypot(b[3] - b[0], b[4] - b[1], b[5] - b[2])));
  const cellName = (cell) => (cells.names[cell] ? `${cell} (${cells.names[cell]})` : `${cell}`);
  const size = (b) => [0, 1, 2].map((k) => metres(b[k + 3] - b[k]).toFixed(2)).join(" × ") + " m";

  function describe(kind, id) {
    if (kind === "object") return `Object ${id}${objects.names[id] ? ` (${objects.names[id]})` : ""}`;
    return `Cell ${cellName(id)}`;
  }

  /** What a target is, beside its name. */
  function nature(kind, id) {
    if (kind === "object") return `${objects.kinds[objects.kind[id]] || "object"}, ${ROLE_WORD[objects.role[id]]}`;
    return cells.inhabitable[id] ? "inhabitable cell" : "wall, sliver or exterior cell";
  }

  /** The storey that a box stands in: the highest whose floor is not above its middle; a view cell's own is stored. */
  function storeyOf(kind, id) {
    if (kind === "cell" && cells.storey[id] >= 0) return cells.storey[id];
    const b = box(kind, id),
      middle = (b[2] + b[5]) / 2;
    let found = 0;
    storeys.forEach((storey, n) => {
      if (storey.floor <= middle) found = n;
    });
    return found;
  }

  // ---------------------------------------------------------------- what is chosen

  const state = {
    storey: 0,
    cell: -1,
    target: null,
    hover: null,
    mode: "pick",
    layer: kinds[0] || "cell",
    lines: { cell: false, object: false },
    portals: true,
    listed: LISTED,
    listKind: kinds[0],
    listVerdict: UNKNOWN,
    view: { x: 0, y: 0, scale: 1 },
    sort: { key: "over", down: true },
    allCells: false,
    worstKind: kinds[0],
  };
  let verdicts = { cell: null, object: null };

  function numbers(kind, cell, chosen = () => true) {
    const relation = relations[kind];
    let potential = 0,
      seen = 0;
    for (let row = relation.starts[cell]; row < relation.starts[cell + 1]; row++) {
      if (!chosen(relation.targets[row])) continue;
      potential++;
      if (relation.codes[row] !== ROW_UNKNOWN) seen++;
    }
    const over = seen ? potential / seen : potential ? Infinity : 1;
    return { potential, seen, unknown: potential - seen, over };
  }

  const ratio = (over) => (Number.isFinite(over) ? over.toFixed(3) : "no witness");

  function pick(cell, { keepStorey = false } = {}) {
    if (cell === undefined || !cells.inhabitable[cell]) return;
    const moved = !keepStorey && cells.storey[cell] !== state.storey;
    state.cell = cell;
    state.target = state.hover = null;
    state.listed = LISTED;
    verdicts = { cell: relations.cell.verdicts(cell), object: relations.object.verdicts(cell) };
    if (moved) setStorey(cells.storey[cell]);
    try {
      history.replaceState(null, "", `#cell-${cell}`);
    } catch {
      /* a sandboxed frame has no address of its own */
    }
    showCell();
    markRow();
    draw();
  }

  function inspect(kind, id) {
    state.target = id === null ? null : { kind, id };
    showTarget();
    for (const button of $("targets").querySelectorAll("button")) {
      button.setAttribute("aria-current", String(state.target !== null && button.dataset.target === `${kind} ${id}`));
    }
    draw();
  }

  function setStorey(number) {
    state.storey = Math.max(0, Math.min(storeys.length - 1, number));
    $("storey").value = String(state.storey);
    showReach();
    draw();
  }

  // ---------------------------------------------------------------- plan

  const canvas = $("plan"),
    pen = canvas.getContext("2d");
  let width = 0,
    height = 0,
    hatch = null;

  function extent() {
    const low = [Infinity, Infinity],
      high = [-Infinity, -Infinity];
    const include = (b) => {
      for (const k of [0, 1]) {
        low[k] = Math.min(low[k], b[k]);
        high[k] = Math.max(high[k], b[k + 3]);
      }
    };
    sources.forEach((cell) => include(box("cell", cell)));
    if (!facts.claimsCells)
      for (let id = 0; id < objectCount; id++)
        if (objects.boxes[6 * id] <= objects.boxes[6 * id + 3]) include(box("object", id));
    return { low, high };
  }

  function fit() {
    const { low, high } = extent(),
      margin = 28;
    const across = Math.max(1, high[0] - low[0]),
      up = Math.max(1, high[1] - low[1]);
    const scale = Math.min((width - 2 * margin) / across, (height - 2 * margin) / up);
    state.view = { x: (low[0] + high[0]) / 2, y: (low[1] + high[1]) / 2, scale: Math.max(scale, 1e-9) };
    draw();
  }

  function zoom(factor, px, py) {
    const [x, y] = ground(px, py),
      view = state.view;
    view.scale = Math.min(Math.max(view.scale * factor, 1e-6), 10);
    view.x = x - (px - width / 2) / view.scale;
    view.y = y + (py - height / 2) / view.scale;
    draw();
  }

  /** Zooms about the view cell where it is in sight, else about the middle. */
  function zoomHere(factor) {
    const b = box("cell", state.cell),
      px = sx((b[0] + b[3]) / 2),
      py = sy((b[1] + b[4]) / 2);
    const near = cells.storey[state.cell] === state.storey && px > 0 && px < width && py > 0 && py < height;
    zoom(factor, near ? px : width / 2, near ? py : height / 2);
  }

  const sx = (x) => width / 2 + (x - state.view.x) * state.view.scale;
  const sy = (y) => height / 2 - (y - state.view.y) * state.view.scale;
  const ground = (px, py) => [
    state.view.x + (px - width / 2) / state.view.scale,
    state.view.y - (py - height / 2) / state.view.scale,
  ];

  const cutBy = (b, storey) => b[2] < storey.level && storey.level < b[5];
  /** Cells drawn on a storey's plan: those that its section cuts, and its own view cells above or below the cut. */
  function cellsOn(number) {
    const out = [],
      storey = storeys[number];
    for (let cell = 0; cell < cellCount; cell++) {
      const cut = cutBy(box("cell", cell), storey);
      if (facts.claimsCells ? cut || cells.storey[cell] === number : cells.storey[cell] === number) out.push(cell);
    }
    return out.sort(
      (a, b) => cells.inhabitable[a] - cells.inhabitable[b] || area(box("cell", b)) - area(box("cell", a)),
    );
  }
  /** Objects that stand on a storey's floor or are cut by its section; slabs are neither. */
  function objectsOn(number) {
    const storey = storeys[number],
      step = 0.05 / facts.gridMetres,
      out = [];
    for (let id = 0; id < objectCount; id++) {
      const b = box("object", id);
      if (b[0] <= b[3] && b[2] < storey.level && b[5] > storey.floor + step) out.push(id);
    }
    return out.sort((a, b) => area(box("object", b)) - area(box("object", a)));
  }
  const memo = { cell: [], object: [] };
  const on = (kind, n) => (memo[kind][n] ??= kind === "cell" ? cellsOn(n) : objectsOn(n));

  function rectangle(b) {
    const x = sx(b[0]),
      y = sy(b[4]);
    return [x, y, sx(b[3]) - x, sy(b[1]) - y];
  }

  const outside = ([x, y, w, h]) => x > width || y > height || x + w < 0 || y + h < 0;

  function makeHatch() {
    const tile = document.createElement("canvas"),
      ratioOf = window.devicePixelRatio || 1;
    tile.width = tile.height = Math.round(8 * ratioOf);
    const p = tile.getContext("2d"),
      n = tile.width;
    p.strokeStyle = STROKE.hatch;
    p.lineWidth = 1.3 * ratioOf;
    for (const d of [-n, 0, n]) {
      p.beginPath();
      p.moveTo(d, n);
      p.lineTo(d + n, 0);
      p.stroke();
    }
    hatch = pen.createPattern(tile, "repeat");
    hatch.setTransform(new DOMMatrix().scale(1 / ratioOf));
  }

  function paintBox(r, verdict) {
    pen.fillStyle = FILL[verdict];
    pen.fillRect(...r);
    if (verdict === "unknown") {
      pen.fillStyle = hatch;
      pen.fillRect(...r);
    }
    if (verdict === "source") {
      pen.lineWidth = 2.5;
      pen.strokeStyle = "#111";
      pen.strokeRect(...r);
    }
  }

  /** Cells that the section cuts lie over view cells of the storey above or below it, whose outlines are dashed. */
  function drawCells(storey) {
    const coloured = state.layer === "cell" && state.cell >= 0,
      shown = on("cell", state.storey);
    const cut = shown.filter((cell) => cutBy(box("cell", cell), storey));
    const apart = shown.filter((cell) => !cutBy(box("cell", cell), storey));
    for (const cell of [...apart, ...cut]) {
      const look = coloured ? WORD[verdicts.cell[cell]] : cells.inhabitable[cell] ? "room" : "other";
      const r = rectangle(box("cell", cell));
      if (facts.claimsCells && !outside(r)) paintBox(r, look);
    }
    for (const cell of [...cut, ...apart]) {
      const r = rectangle(box("cell", cell)),
        room = cells.inhabitable[cell];
      if (outside(r) || !(room || Math.min(r[2], r[3]) > 1.5)) continue;
      pen.lineWidth = room ? 0.9 : 0.4;
      pen.strokeStyle = room ? "#8a949d" : "#c4ccd3";
      pen.setLineDash(cutBy(box("cell", cell), storey) ? [] : [4, 3]);
      pen.strokeRect(...r);
    }
    pen.setLineDash([]);
    if (coloured && shown.includes(state.cell)) paintBox(rectangle(box("cell", state.cell)), "source");
  }

  function drawObjects(storey) {
    const whole = extent(),
      large = 0.04 * (whole.high[0] - whole.low[0]) * (whole.high[1] - whole.low[1]);
    for (const verdict of [HIDDEN, SEEN, UNKNOWN]) {
      pen.strokeStyle = STROKE[WORD[verdict]];
      pen.lineWidth = verdict === HIDDEN ? 0.7 : 1.4;
      pen.setLineDash(verdict === UNKNOWN ? [5, 3] : []);
      for (const id of on("object", state.storey)) {
        const b = box("object", id),
          r = rectangle(b);
        if (verdicts.object[id] !== verdict || outside(r)) continue;
        if (area(b) < large) {
          pen.globalAlpha = verdict === HIDDEN ? 0.55 : 0.6;
          paintBox(r, WORD[verdict]);
          pen.globalAlpha = 1;
        }
        if (!cutBy(b, storey) || area(b) < large) pen.strokeRect(...r);
      }
    }
    pen.setLineDash([]);
  }

  /** Cut surfaces: by verdict of their object where objects are coloured, else by role. */
  function drawSurfaces(storey) {
    const byVerdict = state.layer === "object" && state.cell >= 0;
    const passes = byVerdict
      ? [
          [HIDDEN, STROKE.hidden, 1],
          [SEEN, STROKE.seen, 2.2],
          [UNKNOWN, STROKE.unknown, 2.6],
        ]
      : [
          [1, STROKE.detail, 0.8],
          [2, STROKE.glass, 1.4],
          [0, STROKE.wall, 1.5],
        ];
    const key = byVerdict ? verdicts.object : objects.role;
    pen.lineCap = "round";
    for (const [value, colour, line] of passes) {
      pen.beginPath();
      for (let n = 0; n < storey.owners.length; n++) {
        if (key[storey.owners[n]] !== value) continue;
        const at = 4 * n,
          l = storey.lines;
        pen.moveTo(sx(l[at] * storey.step), sy(l[at + 1] * storey.step));
        pen.lineTo(sx(l[at + 2] * storey.step), sy(l[at + 3] * storey.step));
      }
      pen.strokeStyle = colour;
      pen.lineWidth = line;
      pen.setLineDash(byVerdict && value === UNKNOWN ? [6, 4] : []);
      pen.stroke();
    }
    pen.setLineDash([]);
    pen.lineCap = "butt";
  }

  function drawPortals(storey) {
    pen.strokeStyle = STROKE.portal;
    for (let id = 0; id < portals.axis.length; id++) {
      const b = portals.boxes.subarray(6 * id, 6 * id + 6),
        flat = portals.axis[id] === 2;
      if (flat) {
        const [a, c] = [portals.cells[2 * id], portals.cells[2 * id + 1]];
        if (![a, c].some((cell) => cells.inhabitable[cell] && cutBy(box("cell", cell), storey))) continue;
        pen.lineWidth = 0.7;
        pen.globalAlpha = 0.7;
        pen.setLineDash([2, 3]);
        pen.strokeRect(...rectangle(b));
        pen.setLineDash([]);
        pen.globalAlpha = 1;
      } else if (cutBy(b, storey)) {
        strokePortal(b, Math.max(1, Math.min(2.4, state.view.scale / facts.gridMetres / 14)));
      }
    }
  }

  function strokePortal(b, line) {
    pen.lineWidth = line;
    pen.beginPath();
    pen.moveTo(sx(b[0]), sy(b[1]));
    pen.lineTo(sx(b[3]), sy(b[4]));
    pen.stroke();
  }

  function drawSightlines() {
    for (const kind of kinds) {
      if (!state.lines[kind]) continue;
      const relation = relations[kind],
        first = relation.starts[state.cell],
        last = relation.starts[state.cell + 1];
      pen.strokeStyle = STROKE.sight;
      pen.lineWidth = kind === "cell" ? 0.9 : 0.6;
      pen.globalAlpha = Math.max(0.25, Math.min(0.8, 60 / Math.max(1, last - first)));
      pen.beginPath();
      for (let row = first; row < last; row++) {
        const sight = relation.sightline(row);
        if (!sight) continue;
        const [a, b] = sight.ends;
        pen.moveTo(sx(a[0]), sy(a[1]));
        pen.lineTo(sx(b[0]), sy(b[1]));
      }
      pen.stroke();
      pen.globalAlpha = 1;
    }
  }

  function drawTarget({ kind, id }) {
    const r = rectangle(box(kind, id));
    pen.strokeStyle = STROKE.target;
    pen.lineWidth = 3;
    pen.setLineDash(storeyOf(kind, id) === state.storey ? [] : [6, 4]);
    pen.strokeRect(...r);
    pen.setLineDash([]);
    const sight = relations[kind].sightline(relations[kind].row(state.cell, id));
    if (!sight) return;
    pen.strokeStyle = STROKE.portal;
    for (const portal of sight.portals) {
      const b = portals.boxes.subarray(6 * portal, 6 * portal + 6);
      if (portals.axis[portal] === 2) {
        pen.lineWidth = 2;
        pen.strokeRect(...rectangle(b));
      } else strokePortal(b, 5);
    }
    const [a, b] = sight.ends.map(([x, y]) => [sx(x), sy(y)]);
    for (const [colour, line] of [
      ["#ffffff", 5],
      [STROKE.target, 2.4],
    ]) {
      pen.strokeStyle = pen.fillStyle = colour;
      pen.lineWidth = line;
      pen.beginPath();
      pen.moveTo(...a);
      pen.lineTo(...b);
      pen.stroke();
      pen.beginPath();
      pen.arc(...a, line + 1.5, 0, 7);
      pen.fill();
    }
    arrow(a, b);
  }

  function arrow([ax, ay], [bx, by]) {
    const turn = Math.atan2(by - ay, bx - ax),
      reach = 12;
    pen.beginPath();
    pen.moveTo(bx, by);
    for (const side of [-0.4, 0.4]) pen.lineTo(bx - reach * Math.cos(turn + side), by - reach * Math.sin(turn + side));
    pen.closePath();
    pen.fill();
  }

  function drawLabels(storey) {
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    const taken = [];
    for (const cell of [...on("cell", state.storey)]
      .reverse()
      .sort((a, b) => (b === state.cell) - (a === state.cell))) {
      const b = box("cell", cell);
      if (!cells.inhabitable[cell] || (!cutBy(b, storey) && cell !== state.cell)) continue;
      const [x, y, w, h] = rectangle(b);
      if (w < 16 || h < 14 || outside([x, y, w, h])) continue;
      pen.font = `${cell === state.cell ? 700 : 500} 12px system-ui, sans-serif`;
      const name = cells.names[cell],
        id = String(cell);
      const lines =
        name && pen.measureText(name).width < w - 6 && h > 32
          ? [id, name]
          : pen.measureText(id).width < w - 3
            ? [id]
            : [];
      if (!lines.length) continue;
      const half = Math.max(...lines.map((t) => pen.measureText(t).width)) / 2,
        tall = 8 * lines.length;
      const cx = x + w / 2,
        cy = y + h / 2,
        room = [cx - half, cy - tall, cx + half, cy + tall];
      if (taken.some((t) => t[0] < room[2] && room[0] < t[2] && t[1] < room[3] && room[1] < t[3])) continue;
      taken.push(room);
      pen.lineWidth = 3.5;
      pen.strokeStyle = "rgba(255,255,255,.9)";
      pen.fillStyle = "#1d2329";
      lines.forEach((text, n) => {
        const line = cy + (n - (lines.length - 1) / 2) * 15;
        pen.strokeText(text, cx, line);
        pen.fillText(text, cx, line);
      });
    }
  }

  function drawScale() {
    const wanted = (110 / state.view.scale) * facts.gridMetres,
      power = 10 ** Math.floor(Math.log10(wanted));
    const long = [5, 2, 1].map((n) => n * power).find((n) => n <= wanted) ?? power;
    const wide = (long / facts.gridMetres) * state.view.scale,
      x = 14,
      y = height - 16;
    pen.fillStyle = "rgba(255,255,255,.88)";
    pen.fillRect(x - 7, y - 22, Math.max(wide, 36) + 14, 32);
    pen.fillStyle = "#20262c";
    pen.fillRect(x, y, wide, 3);
    pen.font = "12px system-ui, sans-serif";
    pen.textAlign = "left";
    pen.textBaseline = "alphabetic";
    pen.fillText(`${Number(long.toPrecision(1))} m`, x, y - 6);
  }

  let asked = 0;
  const draw = () => {
    asked ||= requestAnimationFrame(() => {
      asked = 0;
      paint();
    });
  };

  function paint() {
    if (!width || !storeys.length) return;
    const storey = storeys[state.storey];
    pen.fillStyle = facts.claimsCells ? FILL.none : "#fff";
    pen.fillRect(0, 0, width, height);
    drawCells(storey);
    if (state.layer === "object" && state.cell >= 0) drawObjects(storey);
    drawSurfaces(storey);
    if (state.layer === "object" && state.cell >= 0 && cells.storey[state.cell] === state.storey) {
      pen.globalAlpha = 0.55;
      paintBox(rectangle(box("cell", state.cell)), "source");
      pen.globalAlpha = 1;
    }
    if (state.portals) drawPortals(storey);
    if (state.cell >= 0) drawSightlines();
    drawLabels(storey);
    if (state.cell >= 0)
      [state.target, state.hover].forEach((t) => {
        if (t) drawTarget(t);
      });
    drawScale();
    // Where the plan looks, for scripts: its middle [grid steps] and pixels a grid step.
    canvas.dataset.view = `${state.view.x} ${state.view.y} ${state.view.scale}`;
  }

  /** As high as the building needs at this width, and the window has room for. */
  function wantedHeight() {
    const { low, high } = extent();
    const needed = (1.1 * width * (high[1] - low[1])) / Math.max(1, high[0] - low[0]) + 60;
    const room = Math.max(PLAN_LEAST, window.innerHeight - 270);
    return Math.round(Math.min(Math.max(needed, PLAN_LEAST), room));
  }

  function resize() {
    const ratioOf = window.devicePixelRatio || 1,
      first = !width;
    width = canvas.clientWidth;
    canvas.style.height = `${wantedHeight()}px`;
    height = canvas.clientHeight;
    canvas.width = Math.round(width * ratioOf);
    canvas.height = Math.round(height * ratioOf);
    pen.setTransform(ratioOf, 0, 0, ratioOf, 0, 0);
    pen.lineJoin = "round";
    makeHatch();
    if (first) fit();
    else paint();
  }

  // ---------------------------------------------------------------- pointing at the plan

  const holds = (b, x, y, slack) => b[0] - slack <= x && x <= b[3] + slack && b[1] - slack <= y && y <= b[4] + slack;

  /** View cells under a point, those that the section cuts first, then the smallest. */
  function sourcesAt(x, y) {
    const storey = storeys[state.storey];
    const found = on("cell", state.storey).filter(
      (cell) => cells.inhabitable[cell] && holds(box("cell", cell), x, y, 0),
    );
    return found.sort(
      (a, b) =>
        cutBy(box("cell", b), storey) - cutBy(box("cell", a), storey) || area(box("cell", a)) - area(box("cell", b)),
    );
  }

  function targetAt(x, y) {
    const kind = state.layer,
      slack = kind === "object" ? 3 / state.view.scale : 0;
    const found = on(kind, state.storey).filter(
      (id) => holds(box(kind, id), x, y, slack) && !(kind === "cell" && id === state.cell),
    );
    const cut = (id) => cutBy(box(kind, id), storeys[state.storey]);
    found.sort((a, b) => (kind === "cell" ? cut(b) - cut(a) : 0) || area(box(kind, a)) - area(box(kind, b)));
    return found.length ? { kind, id: found[0] } : null;
  }

  function click(px, py, asking) {
    const [x, y] = ground(px, py);
    if (asking && state.cell >= 0) {
      const found = targetAt(x, y);
      inspect(found?.kind, found ? found.id : null);
      return;
    }
    const found = sourcesAt(x, y);
    // Where view cells lie above each other, another click picks the next.
    if (found.length) pick(found[(found.indexOf(state.cell) + 1) % found.length], { keepStorey: true });
  }

  function hover(event) {
    const rect = canvas.getBoundingClientRect(),
      px = event.clientX - rect.left,
      py = event.clientY - rect.top;
    const [x, y] = ground(px, py),
      tip = $("tip"),
      found = targetAt(x, y),
      under = sourcesAt(x, y);
    state.hover = found && state.cell >= 0 ? found : null;
    let text = "";
    if (found) {
      text = describe(found.kind, found.id);
      if (state.cell >= 0)
        text += `\n${WORD[verdicts[found.kind][found.id]].toUpperCase()} from view cell ${state.cell}`;
    } else if (under.includes(state.cell)) {
      text = `The view cell, ${cellName(state.cell)}`;
    }
    if (under.length > 1 && state.mode === "pick")
      text += `\n${under.length} view cells above each other: click again for the next`;
    tip.hidden = !text;
    tip.textContent = text;
    tip.style.left = `${px + 316 > width ? Math.max(4, px - tip.offsetWidth - 12) : px + 14}px`;
    tip.style.top = `${Math.min(py + 14, height - tip.offsetHeight - 4)}px`;
    draw();
  }

  let drag = null;
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button) return;
    drag = { x: event.clientX, y: event.clientY, moved: false };
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!drag) {
      hover(event);
      return;
    }
    const dx = event.clientX - drag.x,
      dy = event.clientY - drag.y;
    if (!drag.moved && Math.hypot(dx, dy) < 4) return;
    Object.assign(drag, { x: event.clientX, y: event.clientY, moved: true });
    $("tip").hidden = true;
    state.view.x -= dx / state.view.scale;
    state.view.y += dy / state.view.scale;
    draw();
  });
  canvas.addEventListener("pointerup", (event) => {
    const rect = canvas.getBoundingClientRect();
    if (drag && !drag.moved)
      click(event.clientX - rect.left, event.clientY - rect.top, state.mode === "inspect" || event.shiftKey);
    drag = null;
  });
  canvas.addEventListener("pointercancel", () => {
    drag = null;
  });
  canvas.addEventListener("pointerleave", () => {
    state.hover = null;
    $("tip").hidden = true;
    draw();
  });
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const rect = canvas.getBoundingClientRect();
      zoom(
        Math.exp(-Math.max(-200, Math.min(200, event.deltaY)) * 0.0022),
        event.clientX - rect.left,
        event.clientY - rect.top,
      );
    },
    { passive: false },
  );

  const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

  /** The view cell of this storey that lies nearest in a direction, off it by less than it is away. */
  function neighbour([dx, dy]) {
    const centre = (cell) => {
      const b = box("cell", cell);
      return [(b[0] + b[3]) / 2, (b[1] + b[4]) / 2];
    };
    const [x, y] = centre(state.cell);
    let best,
      least = Infinity;
    for (const cell of sources) {
      if (cells.storey[cell] !== state.storey || cell === state.cell) continue;
      const [cx, cy] = centre(cell),
        along = (cx - x) * dx + (cy - y) * dy,
        off = Math.abs((cx - x) * dy) + Math.abs((cy - y) * dx);
      if (along > 0 && off <= along && along + 2 * off < least) {
        least = along + 2 * off;
        best = cell;
      }
    }
    return best;
  }

  canvas.addEventListener("keydown", (event) => {
    const way = ARROWS[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (way && event.shiftKey) {
      state.view.x += (way[0] * 60) / state.view.scale;
      state.view.y += (way[1] * 60) / state.view.scale;
      draw();
    } else if (way)
      pick(
        cells.storey[state.cell] === state.storey
          ? neighbour(way)
          : sources.find((c) => cells.storey[c] === state.storey),
      );
    else if (event.key === "+" || event.key === "=") zoomHere(1.3);
    else if (event.key === "-") zoomHere(1 / 1.3);
    else if (event.key === "0") fit();
    else if (event.key === "PageUp") setStorey(state.storey + 1);
    else if (event.key === "PageDown") setStorey(state.storey - 1);
    else if (event.key === "Escape") inspect(null, null);
    else return;
    event.preventDefault();
  });

  // ---------------------------------------------------------------- the view cell in words

  const CLASSES = [
    ...(facts.claimsCells
      ? [
          ["Inhabitable cells", "cell", (id) => cells.inhabitable[id], sources.length],
          ["Other cells", "cell", (id) => !cells.inhabitable[id], cellCount - sources.length],
        ]
      : []),
    ...(objectCount ? [["Objects", "object", () => true, objectCount]] : []),
  ];

  function showCell() {
    const cell = state.cell,
      b = box("cell", cell);
    $("cell-input").value = cells.names[cell] ? `${cell} · ${cells.names[cell]}` : String(cell);
    $("picker-error").hidden = true;
    $("cell-title").textContent = describe("cell", cell);
    $("cell-facts").textContent =
      `${level} ${cells.storey[cell]}; ${size(b)}; z ${metres(b[2]).toFixed(2)} to ${metres(b[5]).toFixed(2)} m`;
    $("cell-numbers").tBodies[0].replaceChildren(
      ...CLASSES.flatMap(([name, kind, chosen, all]) => {
        const n = numbers(kind, cell, chosen);
        const row = make("tr", { className: "with-bar" }, make("th", { scope: "row" }, name));
        [count(n.potential), count(n.seen), count(n.unknown), ratio(n.over)].forEach((text, k) =>
          row.append(make("td", { className: k === 3 ? "strong" : "" }, text)),
        );
        return [row, bar(n, all, name)];
      }),
    );
    showReach();
    showTarget();
    showList();
  }

  /** Seen, unknown and hidden as parts of all targets. */
  function bar(n, all, name) {
    const hidden = all - n.potential,
      share = (k) => `${(100 * k) / Math.max(1, all)}%`;
    const words = `${name}: ${count(n.seen)} seen, ${count(n.unknown)} unknown, ${count(hidden)} hidden of ${count(all)}`;
    const strip = make("div", { className: "bar", role: "img", title: words, "aria-label": words });
    for (const [word, k] of [
      ["seen", n.seen],
      ["unknown", n.unknown],
    ]) {
      const part = make("span", { className: word });
      part.style.width = share(k);
      // A single unknown target in thousands still shows.
      if (k) part.style.minWidth = "4px";
      strip.append(part);
    }
    return make("tr", { className: "bar-row" }, make("td", { colSpan: 5 }, strip));
  }

  /** Targets reached on each storey, as buttons that go there. */
  function showReach() {
    const kind = state.layer,
      place = $("reach");
    if (state.cell < 0 || storeys.length < 2) {
      place.replaceChildren();
      return;
    }
    const found = storeys.map(() => [0, 0, 0]),
      relation = relations[kind];
    for (let row = relation.starts[state.cell]; row < relation.starts[state.cell + 1]; row++) {
      const id = relation.targets[row];
      if (kind === "cell" && !cells.inhabitable[id]) continue;
      found[storeyOf(kind, id)][relation.codes[row] === ROW_UNKNOWN ? UNKNOWN : SEEN]++;
    }
    const what = kind === "cell" ? "Inhabitable cells reached" : "Objects reached";
    place.replaceChildren(
      `${what}, by ${level.toLowerCase()}:`,
      ...found.flatMap((n, number) => {
        if (!n[SEEN] && !n[UNKNOWN]) return [];
        const words = `${level} ${number}: ${count(n[SEEN])} seen${n[UNKNOWN] ? `, ${count(n[UNKNOWN])} unknown` : ""}`;
        const button = make("button", { type: "button" }, words);
        button.setAttribute("aria-pressed", String(number === state.storey));
        button.addEventListener("click", () => setStorey(number));
        return [button];
      }),
    );
  }

  const REASON = [
    "proved: no open sightline joins the view cell to it.",
    "neither a sightline nor a proof was found; it stays in the potentially visible set.",
    "a stored sightline, checked exactly, shows it.",
  ];

  function showTarget() {
    const card = $("target"),
      target = state.target;
    card.hidden = !target;
    if (!target) {
      card.replaceChildren();
      return;
    }
    const { kind, id } = target,
      verdict = verdicts[kind][id],
      sight = relations[kind].sightline(relations[kind].row(state.cell, id));
    const parts = [make("h3", {}, describe(kind, id))];
    parts.push(
      make(
        "p",
        { className: "verdict" },
        make("span", { className: `mark ${WORD[verdict]}` }),
        make("b", {}, ["HIDDEN", "UNKNOWN", "VISIBLE"][verdict]),
        ": ",
        REASON[verdict],
      ),
    );
    parts.push(
      make(
        "p",
        { className: "quiet small" },
        `${nature(kind, id)}; ${level.toLowerCase()} ${storeyOf(kind, id)}; box ${size(box(kind, id))}`,
      ),
    );
    if (verdict === SEEN && sight) parts.push(...sightWords(kind, id, sight));
    if (verdict === SEEN && !sight)
      parts.push(
        make(
          "p",
          { className: "small" },
          kind === "cell" && id === state.cell
            ? "A view cell sees itself."
            : "Its sightline is in the bake's folder; this page holds those to the largest targets only.",
        ),
      );
    const buttons = make("div");
    const add = (text, act) => {
      const b = make("button", { type: "button" }, text);
      b.addEventListener("click", act);
      buttons.append(b);
    };
    if (storeyOf(kind, id) !== state.storey)
      add(`Show ${level.toLowerCase()} ${storeyOf(kind, id)}`, () => setStorey(storeyOf(kind, id)));
    if (kind === "cell" && cells.inhabitable[id]) add("Make it the view cell", () => pick(id));
    add("Close", () => inspect(null, null));
    card.replaceChildren(...parts, buttons);
  }

  function sightWords(kind, id, sight) {
    const at = (p) => `(${p.map((v) => metres(v).toFixed(2)).join(", ")})`,
      [a, b] = sight.ends;
    const long = metres(Math.hypot(...a.map((v, k) => b[k] - v)));
    const said = make("p", { className: "small" }, `Sightline of ${long.toFixed(2)} m from ${at(a)} to ${at(b)} m.`);
    if (kind !== "cell") return [said];
    const path = make("p", { className: "path" }),
      n = sight.portals.length;
    if (!n) return [said];
    path.append(`Through ${n} portal${n === 1 ? "" : "s"}: cell ${state.cell}`);
    let here = state.cell;
    for (const portal of sight.portals) {
      const [low, high] = portals.cells.subarray(2 * portal, 2 * portal + 2);
      here = low === here ? high : low;
      path.append(" → ", make("b", { title: `portal ${portal}` }, `portal ${portal}`), ` → cell ${here}`);
    }
    return [said, path];
  }

  function showList() {
    const kind = state.listKind,
      list = $("targets");
    if (!kind) return;
    const found = [[], [], []],
      boxes = boxesOf[kind];
    verdicts[kind].forEach((verdict, id) => {
      if (!(kind === "cell" && id === state.cell)) found[verdict].push(id);
    });
    for (const button of document.querySelectorAll(".tabs button")) {
      const verdict = Number(button.dataset.verdict);
      button.textContent = `${WORD[verdict]} ${count(found[verdict].length)}`;
      button.setAttribute("aria-pressed", String(verdict === state.listVerdict));
    }
    const large = (id) =>
      diagonal(boxes.subarray(6 * id, 6 * id + 6)) + (kind === "cell" && cells.inhabitable[id] ? 1e6 : 0);
    const ids = found[state.listVerdict]
      .map((id) => [large(id), id])
      .sort((a, b) => b[0] - a[0])
      .map(([, id]) => id);
    list.replaceChildren(...ids.slice(0, state.listed).map((id) => listItem(kind, id)));
    if (!ids.length)
      list.append(make("li", { className: "empty" }, `Nothing is ${WORD[state.listVerdict]} from here.`));
    $("more").hidden = ids.length <= state.listed;
    $("more").textContent = `Show ${count(Math.min(LISTED, ids.length - state.listed))} more of ${count(ids.length)}`;
  }

  function listItem(kind, id) {
    const name =
      kind === "cell"
        ? cells.names[id] || (cells.inhabitable[id] ? "" : "wall, sliver or exterior")
        : objects.names[id] || objects.kinds[objects.kind[id]];
    const button = make(
      "button",
      { type: "button", title: `${describe(kind, id)}, ${nature(kind, id)}` },
      make("span", { className: `mark ${WORD[verdicts[kind][id]]}` }),
      make("span", { className: "what" }, `${id}${name ? ` · ${name}` : ""}`),
      make("span", { className: "size" }, `${diagonal(box(kind, id)).toFixed(1)} m`),
    );
    button.dataset.target = `${kind} ${id}`;
    button.addEventListener("click", () => inspect(kind, id));
    return make("li", {}, button);
  }

  // ---------------------------------------------------------------- the worst cells

  const COLUMNS = [
    ["cell", "cell", false],
    ["name", "name", true],
    ["storey", level.toLowerCase(), false],
    ["potential", "potential", false],
    ["seen", "seen", false],
    ["unknown", "unknown", false],
    ["over", "overestimate", false],
  ];
  const KIND_WORD = { cell: "cells, all kinds", object: "objects" };

  function worstRows() {
    const rows = sources.map((cell) => ({
      cell,
      name: cells.names[cell],
      storey: cells.storey[cell],
      ...numbers(state.worstKind, cell),
    }));
    const { key, down } = state.sort,
      way = down ? -1 : 1;
    const compare =
      key === "name"
        ? (a, b) => a.name.localeCompare(b.name, "en", { numeric: true })
        : (a, b) => (a[key] === b[key] ? 0 : a[key] < b[key] ? -1 : 1);
    return rows.sort((a, b) => way * compare(a, b) || b.unknown - a.unknown || a.cell - b.cell);
  }

  function showWorst() {
    const table = $("worst");
    table.tHead.replaceChildren(
      make(
        "tr",
        {},
        ...COLUMNS.map(([key, word, text]) => {
          const chosen = state.sort.key === key,
            sign = chosen ? (state.sort.down ? " ▼" : " ▲") : "";
          const button = make("button", { type: "button" }, word + sign);
          button.dataset.key = key;
          button.addEventListener("click", () => {
            state.sort = { key, down: chosen ? !state.sort.down : !["cell", "name", "storey"].includes(key) };
            showWorst();
            document.querySelector(`#worst th button[data-key=${key}]`).focus();
          });
          const head = make("th", { scope: "col", className: text ? "text" : "" }, button);
          if (chosen) head.setAttribute("aria-sort", state.sort.down ? "descending" : "ascending");
          return head;
        }),
        make("th", { className: "meter", "aria-hidden": "true" }),
      ),
    );
    const rows = worstRows(),
      most = Math.max(0, ...rows.map((r) => (Number.isFinite(r.over) ? r.over - 1 : 0)));
    table.tBodies[0].replaceChildren(
      ...rows.slice(0, state.allCells ? rows.length : ROWS_SHOWN).map((r) => worstRow(r, most)),
    );
    $("all-cells").hidden = rows.length <= ROWS_SHOWN;
    $("all-cells").textContent = state.allCells
      ? `Show ${ROWS_SHOWN} cells only`
      : `Show all ${count(rows.length)} cells`;
    markRow();
  }

  function worstRow(r, most) {
    const button = make("button", { type: "button", title: `Pick view cell ${r.cell}` }, String(r.cell));
    const row = make("tr", {}, make("td", {}, button), make("td", { className: "text" }, r.name));
    for (const text of [r.storey, count(r.potential), count(r.seen), count(r.unknown), ratio(r.over)])
      row.append(make("td", {}, String(text)));
    const meter = make("span", { className: "over" });
    meter.style.width = `${Number.isFinite(r.over) ? (most ? (110 * (r.over - 1)) / most : 0) : 110}px`;
    row.append(make("td", { className: "meter", "aria-hidden": "true" }, meter));
    row.dataset.cell = r.cell;
    row.addEventListener("click", () => {
      pick(r.cell);
      $("plan-section").scrollIntoView({ block: "start" });
    });
    return row;
  }

  function markRow() {
    for (const row of $("worst").tBodies[0].rows)
      row.setAttribute("aria-selected", String(Number(row.dataset.cell) === state.cell));
  }

  // ---------------------------------------------------------------- numbers

  function twoColumns(title, rows, head = null) {
    const digits = /^[\d.,]+( %)?$/;
    const body = rows.map(([name, ...values]) =>
      make(
        "tr",
        {},
        make("th", { scope: "row" }, name),
        ...values.map((v) => make("td", { className: digits.test(v) ? "digits" : "" }, v)),
      ),
    );
    const table = make("table", {}, make("tbody", {}, ...body));
    if (head)
      table.prepend(make("thead", {}, make("tr", {}, ...head.map((text) => make("th", { scope: "col" }, text)))));
    return make("div", {}, make("h3", {}, title), table);
  }

  function showNumbers() {
    const spaced = (key) => key.replaceAll("_", " ");
    const place = $("numbers"),
      seconds = Object.entries(facts.seconds);
    const classes = twoColumns(
      "Seen from all view cells",
      facts.classes.map(([name, potential, seen, over, unknown]) => [name, potential, seen, unknown, over]),
      ["targets", "potential", "seen", "unknown", "overestimate"],
    );
    place.append(classes);
    place.append(
      twoColumns(
        "Counts",
        Object.entries(facts.counts).map(([k, v]) => [spaced(k), count(v)]),
      ),
    );
    if (seconds.length) {
      const total = seconds.reduce((sum, [, v]) => sum + v, 0);
      place.append(
        twoColumns("Seconds by phase", [
          ...seconds.map(([k, v]) => [spaced(k), v.toFixed(2)]),
          ["all phases", total.toFixed(2)],
        ]),
      );
    }
    place.append(
      twoColumns(
        "Settings",
        Object.entries(facts.settings).map(([k, v]) => [spaced(k), v || "default"]),
      ),
    );
    const model = [
      ["source", facts.source || "unknown"],
      ["grid step", `${(1000 * facts.gridMetres).toFixed(4)} mm`],
      ["origin", `(${facts.origin.join(", ")}) m`],
    ];
    if (facts.snapMetres !== null)
      model.push(["moved by snapping at most", `${(1000 * facts.snapMetres).toFixed(3)} mm`]);
    if (facts.because) model.push(["inhabitable cells", facts.because]);
    if (facts.sha256) model.push(["SHA-256", facts.sha256]);
    place.append(twoColumns("Model", model));
    if (facts.skippedCount) {
      const more = facts.skippedCount > facts.skipped.length ? `, the first ${facts.skipped.length}` : "";
      const block = make(
        "details",
        {},
        make("summary", {}, `Skipped parts of the model (${count(facts.skippedCount)}${more})`),
        twoColumns(
          "",
          facts.skipped.map((s) => [s.what, s.why]),
        ),
      );
      place.append(make("div", {}, block));
    }
    const warnings = [...facts.warnings];
    if (facts.leakCells.length)
      warnings.unshift(
        `The outside leaks into the middle of the building, through cells ${facts.leakCells.slice(0, 12).join(", ")}${facts.leakCells.length > 12 ? ", ..." : ""}.`,
      );
    if (facts.budgetSpent)
      warnings.push("The time budget ended the bake early: what was left is unknown, never hidden.");
    $("warnings").replaceChildren(...warnings.map((text) => make("p", { className: "notice" }, `Warning: ${text}`)));
  }

  // ---------------------------------------------------------------- curves

  const SVG = "http://www.w3.org/2000/svg";
  function shape(tag, attributes, ...children) {
    const element = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...children);
    return element;
  }

  const plot = { W: 1000, H: 520, left: 76, right: 300, top: 16, bottom: 52 };
  // The error axis is logarithmic above 1; an exact result has a place on it all the same.
  const EXACT = 1e-4;
  const above = (p) => Math.max(p.error - 1, EXACT);

  /** Points that no other one beats in both time and error, fastest first. */
  function paretoFront(points) {
    const front = [];
    for (const p of [...points].sort((a, b) => a.seconds - b.seconds || a.error - b.error)) {
      if (!front.length || p.error < front[front.length - 1].error) front.push(p);
    }
    return front;
  }

  function showCurves() {
    // A method that hides something visible at any setting is not safe at the others either.
    const series = data.curves.series
      .filter((one) => one.points.every((p) => !p.wrong_hidden))
      .map((one) => ({ ...one, points: one.points.filter((p) => p.seconds > 0 && p.error !== null) }))
      .filter((one) => one.points.length);
    const points = series.flatMap((one) => one.points);
    if (!points.length) return;
    $("curves-section").hidden = $("curves-link").hidden = false;
    $("curves-about").textContent =
      `${data.curves.scene}. Each mark is one setting of a knob, whose value stands beside it; to the left is ` +
      "faster, further down is tighter. The thick black line is the Pareto front: no setting on this page is both " +
      "faster and tighter. Methods that hide something visible are left out of the picture, and listed in the table.";
    // Series of other view cells than the rest are not to be compared with it point by point.
    const front = paretoFront(series.filter((one) => !one.apart).flatMap((one) => one.points));
    $("curves").append(curvePicture(series, points, front), curveTable(front));
  }

  function curvePicture(series, points, front) {
    const { W, H, left, right, top, bottom } = plot;
    const span = (values) => {
      const logs = values.map(Math.log10);
      return [Math.min(...logs) - 0.15, Math.max(...logs) + 0.15];
    };
    const xs = span(points.map((p) => p.seconds));
    const ys = span(points.map(above));
    const X = (s) => left + ((Math.log10(s) - xs[0]) / (xs[1] - xs[0])) * (W - left - right);
    const Y = (e) => H - bottom - ((Math.log10(e) - ys[0]) / (ys[1] - ys[0])) * (H - top - bottom);
    const at = (p) => [X(p.seconds), Y(above(p))];
    const words = "Overestimate against seconds, with the Pareto front";
    const svg = shape("svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": words });
    axes(svg, xs, ys, X, Y);
    const steps = front.map((p, n) => (n ? `H${at(p)[0]}V${at(p)[1]}` : `M${at(p).join(" ")}`)).join("");
    const heavy = { fill: "none", stroke: "#111", "stroke-width": 3, "stroke-opacity": 0.8 };
    svg.append(shape("path", { d: `${steps}H${W - right}`, ...heavy }));
    const methods = [...new Set(series.map((one) => one.method))];
    series.forEach((one, n) => {
      const colour = SERIES[methods.indexOf(one.method) % SERIES.length];
      const y = top + 16 + 34 * n;
      svg.append(curveMarks(one, n, colour, at, front), marker(n, W - right + 26, y, colour));
      svg.append(shape("text", { x: W - right + 40, y: y + 4 }, one.method));
      if (one.knob !== "no knob") svg.append(shape("text", { x: W - right + 40, y: y + 19, class: "knob" }, one.knob));
    });
    const y = top + 16 + 34 * series.length;
    svg.append(
      shape("line", { x1: W - right + 16, x2: W - right + 36, y1: y, y2: y, stroke: "#111", "stroke-width": 3 }),
    );
    svg.append(shape("text", { x: W - right + 40, y: y + 4 }, "Pareto front"));
    return svg;
  }

  /** The marks of one series, joined in the order of the knob's values. */
  function curveMarks(one, n, colour, at, front) {
    const points = [...one.points].sort((a, b) => a.value - b.value);
    const line = { fill: "none", stroke: colour, "stroke-width": 1.5, "stroke-opacity": 0.7 };
    const group = shape("g", { class: "values" }, shape("polyline", { points: points.map(at).join(" "), ...line }));
    for (const p of points) {
      const [x, y] = at(p);
      const dot = marker(n, x, y, colour);
      const numbers = `${p.seconds.toPrecision(3)} s, overestimate ${p.error.toFixed(4)}`;
      dot.append(shape("title", {}, `${one.method}, ${one.knob} ${p.value}: ${numbers}`));
      if (front.includes(p)) dot.setAttribute("class", "on-front");
      group.append(dot);
      if (points.length > 1) group.append(shape("text", { x: x + 7, y: y - 6 }, String(p.value)));
    }
    return group;
  }

  function marker(n, x, y, colour) {
    const paint = { fill: colour, stroke: "#fff", "stroke-width": 1 };
    const at = (points) =>
      shape("polygon", { points: points.map(([a, b]) => `${x + a},${y + b}`).join(" "), ...paint });
    return [
      () => shape("circle", { cx: x, cy: y, r: 5.5, ...paint }),
      () =>
        at([
          [-5, -5],
          [5, -5],
          [5, 5],
          [-5, 5],
        ]),
      () =>
        at([
          [0, -7],
          [6, 5],
          [-6, 5],
        ]),
      () =>
        at([
          [0, -7],
          [6, 0],
          [0, 7],
          [-6, 0],
        ]),
      () =>
        at([
          [-6, -5],
          [6, -5],
          [0, 7],
        ]),
    ][n % 5]();
  }

  function axes(svg, [x0, x1], [y0, y1], X, Y) {
    const { W, H, left, right, top, bottom } = plot;
    const ticks = (low, high) => {
      const out = [];
      for (let power = Math.floor(low); power <= high; power++)
        for (const n of high - low > 4 ? [1] : [1, 2, 5]) {
          if (Math.log10(n) + power >= low && Math.log10(n) + power <= high) out.push(n * 10 ** power);
        }
      return out;
    };
    const plain = (v) => String(Number(v.toPrecision(2)));
    for (const v of ticks(x0, x1)) {
      svg.append(shape("line", { x1: X(v), x2: X(v), y1: top, y2: H - bottom, stroke: "#e1e6ea" }));
      svg.append(shape("text", { x: X(v), y: H - bottom + 18, "text-anchor": "middle" }, plain(v)));
    }
    for (const v of ticks(y0, y1)) {
      svg.append(shape("line", { x1: left, x2: W - right, y1: Y(v), y2: Y(v), stroke: "#e1e6ea" }));
      svg.append(
        shape("text", { x: left - 8, y: Y(v) + 4, "text-anchor": "end" }, String(Number((1 + v).toPrecision(6)))),
      );
    }
    svg.append(
      shape("rect", {
        x: left,
        y: top,
        width: W - left - right,
        height: H - top - bottom,
        fill: "none",
        stroke: "#7b858f",
      }),
    );
    svg.append(
      shape(
        "text",
        { x: (left + W - right) / 2, y: H - 10, "text-anchor": "middle" },
        "seconds of visibility (logarithmic)",
      ),
    );
    const middle = (top + H - bottom) / 2;
    svg.append(
      shape(
        "text",
        { x: 16, y: middle, transform: `rotate(-90 16 ${middle})`, "text-anchor": "middle" },
        "overestimate, potential / seen (logarithmic above 1)",
      ),
    );
  }

  function curveTable(front) {
    const show = (v, digits = 4) => (v === null ? "" : String(Number(v.toPrecision(digits))));
    const rows = data.curves.series.flatMap((one) =>
      one.points.map((p) =>
        make(
          "tr",
          {},
          make("td", { className: "text" }, one.method),
          make("td", { className: "text" }, one.knob),
          ...[
            show(p.value),
            show(p.seconds),
            show(p.error),
            p.unknown === null ? "" : `${(100 * p.unknown).toFixed(2)} %`,
            show(p.wrong_hidden, 9),
            front.includes(p) ? "yes" : "",
          ].map((text) => make("td", {}, text)),
        ),
      ),
    );
    const head = make(
      "tr",
      {},
      ...["method", "knob", "value", "seconds", "error", "unknown", "wrong-hidden", "on the front"].map((text, n) =>
        make("th", { scope: "col", className: n < 2 ? "text" : "" }, text),
      ),
    );
    return make(
      "details",
      {},
      make("summary", {}, "All settings as a table"),
      make(
        "div",
        { className: "scroll" },
        make("table", { className: "rows plain" }, make("thead", {}, head), make("tbody", {}, ...rows)),
      ),
    );
  }

  // ---------------------------------------------------------------- controls

  function legend() {
    const cellsShown = state.layer === "cell";
    const items = [["source", "view cell"]];
    if (cellsShown)
      items.push(["seen", "cell seen"], ["unknown", "cell unknown"], ["hidden", "cell hidden"], ["none", "no cell"]);
    else
      items.push(
        ["line box-seen", "object seen"],
        ["line box-unknown", "object unknown"],
        ["line box-hidden", "object hidden"],
      );
    if (cellsShown && objectCount) items.push(["line wall", "occluder"], ["line detail", "detail"]);
    if (cellsShown && objects.role.includes(2)) items.push(["line glass", "transparent"]);
    if (portals.axis.length) items.push(["line portal", "portal"]);
    items.push(["line sight", "sightline"], ["target", "target"]);
    $("legend").replaceChildren(
      ...items.map(([kind, word]) =>
        make("li", {}, make("span", { className: `mark ${kind}`, "aria-hidden": "true" }), word),
      ),
    );
    const step = storeys.length ? (100 * metres(storeys[0].step)).toFixed(1) : "";
    const cut = storeys.length ? metres(storeys[0].level - storeys[0].floor).toFixed(1) : "";
    $("plan-note").textContent =
      `The plan is cut ${cut} m above the floor${objectCount ? ` and drawn to ${step} cm` : ""}; dashed cells lie above or below the cut. Sightlines are drawn whole, also where they leave the storey.`;
  }

  function setMode(name, value) {
    state[name] = value;
    state.hover = null;
    if (name === "layer") {
      $("list-kind").value = state.listKind = value;
      state.listed = LISTED;
      showList();
      showReach();
      legend();
    }
    draw();
  }

  function options(select, pairs, value) {
    select.replaceChildren(...pairs.map(([v, text]) => make("option", { value: v, selected: v === value }, text)));
  }

  function find(text) {
    const wanted = text.trim(),
      id = /^(\d+)(\s*·.*)?$/.exec(wanted);
    if (id) return cells.inhabitable[Number(id[1])] ? Number(id[1]) : undefined;
    const low = wanted.toLowerCase(),
      named = (test) => sources.find((cell) => wanted && test(cells.names[cell].toLowerCase()));
    return named((name) => name === low) ?? named((name) => name.includes(low));
  }

  function wire() {
    options(
      $("storey"),
      storeys.map((s, n) => [
        String(n),
        `${n}: floor at ${metres(s.floor).toFixed(2)} m, ${count(sources.filter((c) => cells.storey[c] === n).length)} cells`,
      ]),
      "0",
    );
    $("storey").parentElement.firstChild.textContent = `${level} `;
    $("storey").addEventListener("change", (event) => setStorey(Number(event.target.value)));
    for (const kind of ["cell", "object"]) {
      $(`${kind}-lines`).addEventListener("change", (event) => {
        state.lines[kind] = event.target.checked;
        draw();
      });
      if (!kinds.includes(kind))
        document.querySelectorAll(`.of-${kind}s`).forEach((e) => {
          e.hidden = true;
        });
    }
    if (kinds.length < 2) {
      $("layers").hidden = $("worst-kind-label").hidden = $("list-kind").hidden = true;
      $("object-lines").nextSibling.textContent = kinds[0] === "object" ? "sightlines" : "to objects";
    }
    $("portals").addEventListener("change", (event) => {
      state.portals = event.target.checked;
      draw();
    });
    for (const name of ["layer", "mode"]) {
      for (const radio of document.querySelectorAll(`input[name=${name}]`)) {
        radio.checked = radio.value === state[name];
        radio.addEventListener("change", () => {
          setMode(name, radio.value);
        });
      }
    }
    $("zoom-in").addEventListener("click", () => zoomHere(1.4));
    $("zoom-out").addEventListener("click", () => zoomHere(1 / 1.4));
    $("zoom-fit").addEventListener("click", fit);
    const step = (way) => pick(sources[(sources.indexOf(state.cell) + way + sources.length) % sources.length]);
    $("previous").addEventListener("click", () => step(-1));
    $("next").addEventListener("click", () => step(1));
    $("cell-names").append(
      ...sources.map((cell) =>
        make("option", { value: cells.names[cell] ? `${cell} · ${cells.names[cell]}` : String(cell) }),
      ),
    );
    $("cell-input").addEventListener("focus", (event) => event.target.select());
    $("cell-input").addEventListener("change", (event) => {
      const cell = find(event.target.value);
      $("picker-error").hidden = cell !== undefined;
      $("picker-error").textContent = `No view cell has the id or name "${event.target.value.trim()}".`;
      if (cell !== undefined) pick(cell);
    });
    options(
      $("list-kind"),
      kinds.map((k) => [k, `${k}s`]),
      state.listKind,
    );
    $("list-kind").addEventListener("change", (event) => {
      state.listKind = event.target.value;
      state.listed = LISTED;
      showList();
    });
    for (const button of document.querySelectorAll(".tabs button")) {
      button.addEventListener("click", () => {
        state.listVerdict = Number(button.dataset.verdict);
        state.listed = LISTED;
        showList();
      });
    }
    $("more").addEventListener("click", () => {
      state.listed += LISTED;
      showList();
    });
    options(
      $("worst-kind"),
      kinds.map((k) => [k, KIND_WORD[k]]),
      state.worstKind,
    );
    $("worst-kind").addEventListener("change", (event) => {
      state.worstKind = event.target.value;
      showWorst();
    });
    $("all-cells").addEventListener("click", () => {
      state.allCells = !state.allCells;
      showWorst();
    });
    new ResizeObserver(resize).observe(canvas);
  }

  function start() {
    const shown = [
      `${count(sources.length)} view cells`,
      facts.claimsCells ? `${count(cellCount)} cells in all` : "",
      portals.axis.length ? `${count(portals.axis.length)} portals` : "",
      objectCount ? `${count(objectCount)} objects` : "",
    ];
    $("subtitle").textContent =
      `Potentially visible sets: ${shown.filter(Boolean).join(", ")}. viewcell ${facts.version}.`;
    $("footer").textContent =
      `Written by viewcell ${facts.version} from ${facts.source || "a bake"}. Lengths in metres, relative to the bake's origin, z up. This page is complete in itself and loads nothing.`;
    document.querySelector("main").hidden = false;
    showNumbers();
    if (data.curves) showCurves();
    if (!sources.length || !kinds.length) {
      complain("This bake has no inhabitable cell, so there is no set to show.");
      $("plan-section").hidden = $("cells-section").hidden = true;
      return;
    }
    wire();
    legend();
    showWorst();
    const linked = /^#cell-(\d+)$/.exec(location.hash);
    const first = linked && cells.inhabitable[Number(linked[1])] ? Number(linked[1]) : worstRows()[0].cell;
    state.storey = cells.storey[first];
    $("storey").value = String(state.storey);
    pick(first);
    document.documentElement.dataset.ready = "yes";
  }
  start();
})();
