// The viewer: walk through a display database, from inside and from above.

import { Ahead } from "./ahead.mjs";
import { Database } from "./database.mjs";
import { eyeSees } from "./eye.mjs";
import { Far } from "./far.mjs";
import { Inquiry } from "./inquiry.mjs";
import { Keys } from "./keys.mjs";
import { Labels } from "./labels.mjs";
import { Levels } from "./levels.mjs";
import { Numbers } from "./numbers.mjs";
import { Panel } from "./panel.mjs";
import { Stage } from "./stage.mjs";
import { Files, Inline } from "./supply.mjs";
import { Tour, download } from "./tour.mjs";
import { arraysOf, unpacked } from "./unpack.mjs";
import { Visitor } from "./visitor.mjs";

const VIEWS = ["inside", "both", "above"];
const MODES = ["set", "eye", "whole"];
const COLOURS = ["verdicts", "memory", "levels", "backs", "model"];
// Seconds that a frame may count for: what a hidden tab misses is not walked.
const LONGEST = 0.1;

class Viewer {
  constructor(database) {
    this.database = database;
    this.visitor = new Visitor(database);
    this.canvas = document.getElementById("canvas");
    this.stage = new Stage(this.canvas, database);
    this.levels = new Levels(database);
    this.far = new Far(database, this.stage.inside.colours, () => (this.restage = true), (error) => this.panel.note(error.message));
    this.stage.scene.add(this.far.group);
    this.numbers = new Numbers(document.getElementById("plot"));
    this.chosen = {
      view: "both", mode: "set", colours: "verdicts", outlines: false, wedge: false, sequences: false, labels: true, edges: !this.stage.slow, depth: true, freeze: false, speed: this.visitor.speed, target: 0, cache: 64, pace: 1,
    };
    const [low, high] = [this.stage.bounds[2], this.stage.bounds[5] + 0.1];
    this.panel = new Panel(database, [low, high], (name, value) => this.choose(name, value));
    this.ahead = new Ahead(database, new (database.head.streams ? Files : Inline)(database), this.chosen.cache * 1e6, {
      arrived: () => (this.restage = true),
      gone: (items) => this.gone(items),
      failed: (error) => this.panel.note(`${error.message}: what is drawn is what is there`),
    });
    this.tour = new Tour(database, (text) => this.panel.note(text));
    this.keys = new Keys(this.canvas, this.visitor, (code) => this.pressed(code), (x, y) => this.why(x, y));
    this.inquiry = new Inquiry(database, this.stage, this.panel, () => (this.stale = true));
    for (const [name, value] of Object.entries(this.chosen)) this.choose(name, value);
    this.choose("height", this.storeyTop());
    this.labels = new Labels(document.getElementById("labels-over"), database);
    this.listen();
    this.last = performance.now();
    requestAnimationFrame((now) => this.frame(now));
  }

  listen() {
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.stage.zoom(Math.exp(event.deltaY * 0.001));
      this.stale = true;
    }, { passive: false });
    const look = this.keys.look.bind(this.keys);
    this.keys.look = (right, down) => (this.onSky ? this.stage.swing(right, down) : look(right, -down));
    this.canvas.addEventListener("pointerdown", (event) => (this.onSky = this.isSky(event)));
    this.canvas.addEventListener("dblclick", (event) => {
      const found = this.isSky(event) && this.stage.pick(event.offsetX, event.offsetY, this.chosen.view);
      if (found) this.jump(found.point);
    });
    addEventListener("resize", () => (this.stale = true));
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const dress = () => {
      this.stage.dress(dark.matches ? [0x10161b, 0x20282c] : [0xdfe9f1, 0xc9cfc0]);
      this.stale = true;
    };
    dark.addEventListener("change", dress);
    dress();
  }

  isSky(event) {
    const { view } = this.chosen;
    return view === "above" || (view === "both" && event.offsetX > this.canvas.clientWidth / 2);
  }

  /** Height at which the visitor's storey is cut open: a little below their cell's ceiling. */
  storeyTop() {
    const { cell, point } = this.visitor;
    return cell < 0 ? this.stage.bounds[5] + 0.1 : Math.max(point[2] + 0.1, this.database.cellBoxes[6 * cell + 5] - 0.35);
  }

  pressed(code) {
    const next = (name, values) => this.choose(name, values[(values.indexOf(this.chosen[name]) + 1) % values.length]);
    if (code === "KeyV") next("view", VIEWS);
    if (code === "KeyM") next("mode", MODES);
    if (code === "KeyC") next("colours", COLOURS);
    if (code === "KeyP") this.choose("sequences", !this.chosen.sequences);
    if (code === "KeyX") this.choose("edges", !this.chosen.edges);
    if (code === "KeyN") this.choose("labels", !this.chosen.labels);
    if (code === "KeyT") this.choose("depth", !this.chosen.depth);
    if (code === "KeyG") this.choose("wedge", !this.chosen.wedge);
    if (code === "Minus" || code === "Equal") this.stage.zoom(code === "Minus" ? 1.15 : 1 / 1.15);
    if (code === "KeyQ" || code === "KeyE") this.stage.swing(code === "KeyQ" ? -40 : 40, 0);
    if (code === "BracketLeft" || code === "BracketRight") this.choose("height", this.chosen.height + (code === "BracketLeft" ? -0.3 : 0.3));
    if (code === "KeyO") this.choose("outlines", !this.chosen.outlines);
    if (code === "KeyF") this.choose("freeze", !this.chosen.freeze);
    if (code === "KeyJ" && this.inquiry.asked) {
      const { kind, id } = this.inquiry.asked;
      const box = kind === "object" ? this.database.boxOf(id) : this.database.cellBoxes.subarray(6 * id, 6 * id + 6);
      this.jump([0, 1, 2].map((axis) => (box[axis] + box[axis + 3]) / 2));
    }
    if (code === "KeyR") this.choose("record");
    if (code === "KeyY") this.why(this.canvas.clientWidth / (this.chosen.view === "both" ? 4 : 2), this.canvas.clientHeight / 2);
    if (code === "Escape") {
      this.inquiry.ask(null);
      this.tour.stop();
    }
  }

  /** Ask why one sees what is at a place of the picture; a second time on it, why one sees the room there. */
  why(x, y) {
    const found = this.stage.pick(x, y, this.chosen.view);
    const { asked } = this.inquiry;
    const again = found && asked?.kind === "object" && asked.id === found.id;
    const room = again ? this.database.maze.cellAt([found.point[0], found.point[1], found.point[2] + 0.5]) : -1;
    return this.inquiry.ask(found && (room >= 0 ? { kind: "cell", id: room } : { kind: "object", id: found.id }));
  }

  /** Stand in the view cell that holds a point, or eyes above it. */
  jump([x, y, z]) {
    const { database } = this;
    const cells = [0.5, 0, 1.5].map((up) => database.maze.cellAt([x, y, z + up]));
    const found = cells.find((cell) => database.rowOfCell.has(cell));
    if (found === undefined) this.panel.note("no view cell is there");
    else this.choose("cell", found);
  }

  /** Take a choice: of the panel, a key, or a test. */
  choose(name, value) {
    const actions = {
      object: () => this.inquiry.ask({ kind: "object", id: value }),
      room: () => this.inquiry.ask({ kind: "cell", id: value }),
      cell: () => {
        this.visitor.goTo(value);
        this.choose("height", this.storeyTop());
      },
      path: () => this.tour.play(value),
      stop: () => this.tour.stop(),
      record: () => {
        const text = this.tour.record(performance.now());
        if (text) download("path.csv", text);
        this.panel.recording(this.tour.recording);
      },
    };
    if (actions[name]) actions[name]();
    else {
      this.chosen[name] = typeof this.chosen[name] === "number" || name === "height" ? Number(value) : value;
      this.panel.set(name, value);
    }
    const { chosen } = this;
    if (name === "freeze") this.frozen = value ? this.stage.hold(this.visitor) : this.stage.hold(null);
    if (name === "edges") this.stage.edges(value);
    if (name === "speed") this.visitor.speed = chosen.speed;
    if (name === "pace") this.tour.speed = chosen.pace;
    if (name === "target") this.levels.target = chosen.target;
    if (name === "cache") {
      this.ahead.memory.capacity = chosen.cache * 1e6;
      this.ahead.stale = true;
    }
    this.cell = undefined;
    this.stale = true;
  }

  /** Who looks: the visitor, or where they were when the view was frozen. */
  get observer() {
    return this.frozen ?? this.visitor;
  }

  /** What the eye sees of its cell's set, as an array of 0 and 1; or all of the set where that cannot be told. */
  sight(shown, passed = null) {
    const { database, observer, stage } = this;
    const found = database.maze.axes.length
      ? eyeSees(database.maze, observer.point, stage.planes(), (id) => database.boxOf(id),
        (cell) => database.objectsIn(cell), shown, database.reachOf(observer.cell), passed)
      : null;
    if (!found) return shown;
    const out = new Uint8Array(database.objects);
    for (const id of found.objects) out[id] = 1;
    return out;
  }

  /** Bring what is shown up to where the observer is. */
  enter() {
    const { database, observer, stage, chosen } = this;
    const set = database.setOf(observer.cell);
    const potential = set ? set.potential : Array.from({ length: database.objects }, (_, id) => id);
    this.kept = new Uint8Array(database.objects).fill(chosen.mode === "whole" ? 1 : 0);
    for (const id of potential) this.kept[id] = 1;
    this.verdicts = new Array(database.objects).fill("hidden");
    for (const id of potential) this.verdicts[id] = !set || set.unknown.has(id) ? "unknown" : "seen";
    const near = (chosen.outlines && database.reachOf(observer.cell)) || new Set();
    const { sides, axes } = database.maze;
    const portals = Array.from(axes, (_, k) => k).filter((k) => near.has(sides[2 * k]) && near.has(sides[2 * k + 1]));
    stage.outline(observer.cell, [...near], portals);
    this.sequences();
    this.look();
    stage.all(chosen.colours);
    this.colour();
    this.cell = observer.cell;
  }

  /** Show stabbing lines of the cell, if they are asked for, as soon as they are here. */
  async sequences() {
    const { chosen, stage, inquiry } = this;
    if (!chosen.sequences) return stage.sequences([]);
    const reasons = await inquiry.load();
    if (!reasons || !chosen.sequences) return undefined;
    stage.sequences(reasons.sightlinesOf(this.observer.cell));
    if (!reasons.held) this.panel.note("The view was made without its bake, so no stabbing line is held.");
    return (this.stale = true);
  }

  /** Show what is kept, or what the eye sees of it, at the levels that are chosen and here. */
  look() {
    const { database, stage, observer, levels } = this;
    if (!this.frozen) stage.aim(this.visitor, this.chosen.view);
    const shown = this.chosen.mode === "eye" ? this.sight(this.kept) : this.kept;
    if (this.chosen.wedge) {
      const polygons = [];
      this.sight(this.kept, (polygon) => polygons.push(polygon));
      stage.wedge(observer.point, polygons);
    } else stage.wedge(observer.point, []);
    const focal = stage.focal();
    this.wanted = [];
    const coarsest = [];
    let missing = 0;
    const itemOf = (id) => {
      const level = levels.of(id, observer.point, focal);
      this.wanted.push(database.items[database.itemStarts[id] + level]);
      coarsest.push(database.items[database.itemStarts[id + 1] - 1]);
      const item = database.itemNear(id, level);
      if (item < 0) missing++;
      return item;
    };
    const row = this.far.show(this.chosen.depth && this.chosen.mode !== "whole" ? observer.cell : -1);
    // What stands on depth meshes is drawn by them.
    const standing = row < 0 ? [] : this.far.farOf(row);
    const near = Uint8Array.from(shown);
    for (const id of standing) near[id] = 0;
    stage.inside.show(near, itemOf);
    this.wanted = [...coarsest, ...this.wanted];
    this.missing = missing;
    this.restage = false;
    this.tell(shown);
  }

  /** Colours, of the view from above or, for levels, of both. */
  colour() {
    const { stage, chosen, ahead, verdicts } = this;
    stage.colour(chosen.colours, { verdicts, stateOf: (id) => ahead.stateOf(id, performance.now()), cell: this.observer.cell });
    stage.range(chosen.colours === "memory" ? ahead.cells : []);
  }

  /** Chunks that are no longer held: nothing is drawn of them. */
  gone(items) {
    this.stage.drop(items);
    this.restage = true;
  }

  /** Say where the observer is, and how much is drawn. */
  tell(shown) {
    const { database, observer, ahead } = this;
    const set = database.setOf(observer.cell);
    const count = (number) => number.toLocaleString("en");
    const drawn = shown.reduce((sum, one) => sum + one, 0);
    const sum = (ids) => ids.reduce((all, id) => all + database.triangleCounts[id], 0);
    const whole = this.whole ??= database.triangleCounts.reduce((all, one) => all + one, 0);
    const potential = set?.potential.length ?? database.objects;
    const { cell } = observer;
    const name = cell < 0 ? "outside all cells" : `cell ${database.cellIds[cell]} ${database.head.cellNames[cell]}`;
    this.triangles = this.stage.inside.triangles + this.far.triangles;
    this.counts = { drawn, potential, objects: database.objects };
    if (this.potentialOf !== cell) [this.potentialOf, this.potentialTriangles] = [cell, set ? sum(set.potential) : whole];
    this.panel.say({
      cell: set ? name : `${name}: no view cell, so everything is kept`,
      drawn: `${count(drawn)} drawn, ${count(potential)} potential (${set ? set.unknown.size : "all"} unknown), of ${count(database.objects)}`,
      triangles: `${count(this.triangles)} drawn, ${count(this.potentialTriangles)} potential, of ${count(whole)}`,
      levels: this.levels.target ? `within ${this.levels.tolerance.toFixed(1)} pixels` : "the finest",
    });
    const bytes = (number) => `${(number / 1e6).toFixed(number < 1e7 ? 2 : 0)} MB`;
    const { memory } = ahead;
    this.panel.say({
      memory: `${bytes(memory.claimed)} held, ${bytes(memory.fetched)} fetched${ahead.supply.streams ? "" : " as it would be"}`,
      misses: `${count(this.missing)} objects not yet here, ${count(ahead.misses)} chunks failed`,
    });
  }

  frame(now) {
    // A frame's time may be from before the page was ready.
    const elapsed = Math.max(0, now - this.last);
    const seconds = Math.min(LONGEST, elapsed / 1000);
    this.last = now;
    const before = this.visitor.point.join();
    const replays = this.tour.tick(this.visitor, seconds);
    const asked = replays || this.keys.tick(seconds);
    this.tour.recorder?.tick(this.visitor, now);
    if (this.cell !== this.observer.cell) {
      if (this.cell !== undefined && !this.frozen) this.choose("height", this.storeyTop());
      this.enter();
      this.stale = true;
    }
    this.inquiry.enter(this.cell);
    this.ahead.look(this.observer.point, this.observer.cell, this.wanted, now);
    const turned = `${this.visitor.yaw} ${this.visitor.pitch} ${JSON.stringify(this.stage.orbit)}`;
    const moves = asked || before !== this.visitor.point.join() || turned !== this.turned;
    if (this.stale || this.restage || moves || (this.chosen.colours === "memory" && this.ahead.fades(now))) {
      if (this.restage) this.stage.all(this.chosen.colours);
      const again = moves && this.levels.heard(elapsed);
      if (this.restage || again || (moves && (this.chosen.mode === "eye" || this.chosen.wedge || this.levels.target))) this.look();
      if (this.chosen.colours === "memory" || this.chosen.colours === "levels") this.colour();
      this.stage.draw(this.visitor, this.chosen.view, this.chosen.height);
      const { left, width } = this.stage.skyPart(this.chosen.view);
      this.labels.draw(this.stage.sky, left, this.chosen.labels ? width : 0, this.canvas.clientHeight, this.chosen.height);
      if (moves) this.numbers.add(elapsed, this.triangles);
      this.panel.say({ rate: this.numbers.rate ? `${this.numbers.rate.toFixed(0)} frames a second` : "" });
      this.panel.plot(this.numbers, this.levels.target);
      this.turned = turned;
      this.stale = false;
      this.frames = (this.frames ?? 0) + 1;
    }
    requestAnimationFrame((later) => this.frame(later));
  }
}

async function start() {
  try {
    const { head, arrays, packed } = globalThis.viewcellData;
    const database = new Database(head, arraysOf(arrays, await unpacked(packed)));
    delete globalThis.viewcellData;
    globalThis.viewer = new Viewer(database);
    document.documentElement.dataset.ready = "1";
  } catch (error) {
    document.getElementById("note").textContent = `This view cannot be shown: ${error.message}`;
    document.documentElement.dataset.failed = error.message;
  }
}

start();
