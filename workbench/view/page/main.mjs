// The viewer: walk through a display database, from inside and from above.

import { Database } from "./database.mjs";
import { eyeSees } from "./eye.mjs";
import { Inquiry } from "./inquiry.mjs";
import { Keys } from "./keys.mjs";
import { Panel } from "./panel.mjs";
import { Stage } from "./stage.mjs";
import { arraysOf, unpacked } from "./unpack.mjs";
import { Visitor } from "./visitor.mjs";

const VIEWS = ["inside", "both", "above"];
const MODES = ["set", "eye", "whole"];
// Seconds that a frame may count for: what a hidden tab misses is not walked.
const LONGEST = 0.1;

class Viewer {
  constructor(database) {
    this.database = database;
    this.visitor = new Visitor(database);
    this.canvas = document.getElementById("canvas");
    this.stage = new Stage(this.canvas, database);
    this.chosen = { view: "both", mode: "set", verdicts: true, outlines: false };
    const [low, high] = [this.stage.bounds[2], this.stage.bounds[5] + 0.1];
    this.panel = new Panel(database.rooms(), [low, high], (name, value) => this.choose(name, value));
    for (const [name, value] of Object.entries(this.chosen)) this.panel.set(name, value);
    this.choose("height", this.storeyTop());
    this.keys = new Keys(this.canvas, this.visitor, (code) => this.pressed(code), (x, y) => this.why(x, y));
    this.inquiry = new Inquiry(database, this.stage, this.panel, () => (this.stale = true));
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.stage.zoom(Math.exp(event.deltaY * 0.001));
      this.stale = true;
    }, { passive: false });
    const look = this.keys.look.bind(this.keys);
    this.keys.look = (right, down) => (this.onSky ? this.stage.swing(right, down) : look(right, -down));
    this.canvas.addEventListener("pointerdown", (event) => (this.onSky = this.isSky(event)));
    addEventListener("resize", () => (this.stale = true));
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const dress = () => {
      this.stage.dress(dark.matches ? 0x10161b : 0xdfe9f1);
      this.stale = true;
    };
    dark.addEventListener("change", dress);
    dress();
    this.times = [];
    this.last = performance.now();
    requestAnimationFrame((now) => this.frame(now));
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
    if (code === "KeyV") this.choose("view", VIEWS[(VIEWS.indexOf(this.chosen.view) + 1) % 3]);
    if (code === "KeyM") this.choose("mode", MODES[(MODES.indexOf(this.chosen.mode) + 1) % 3]);
    if (code === "KeyO") this.choose("outlines", !this.chosen.outlines);
    if (code === "KeyY") this.why(this.canvas.clientWidth / (this.chosen.view === "both" ? 4 : 2), this.canvas.clientHeight / 2);
    if (code === "Escape") this.inquiry.ask(null);
    if (code === "KeyC") this.choose("verdicts", !this.chosen.verdicts);
  }

  /** Ask why one sees what is at a place of the picture; from above a second click on it asks for the room there. */
  why(x, y) {
    const found = this.stage.pick(x, y, this.chosen.view);
    const { asked } = this.inquiry;
    const again = found && asked?.kind === "object" && asked.id === found.id;
    const room = again ? this.database.maze.cellAt([found.point[0], found.point[1], found.point[2] + 0.5]) : -1;
    return this.inquiry.ask(found && (room >= 0 ? { kind: "cell", id: room } : { kind: "object", id: found.id }));
  }

  /** Take a choice: of the panel, a key, or a test. */
  choose(name, value) {
    if (name === "object" || name === "room") {
      this.inquiry.ask({ kind: name === "room" ? "cell" : name, id: value });
    } else if (name === "cell") {
      this.visitor.goTo(value);
      this.choose("height", this.storeyTop());
    } else {
      this.chosen[name] = name === "height" ? Number(value) : value;
      this.panel.set(name, value);
    }
    this.cell = undefined;
    this.stale = true;
  }

  /** What the eye sees of its cell's set, as an array of 0 and 1; or all of the set where that cannot be told. */
  sight(shown) {
    const { database, visitor, stage } = this;
    const found = database.maze.axes.length
      ? eyeSees(database.maze, visitor.point, stage.planes(), (id) => database.aroundOf(id),
        (cell) => database.objectsIn(cell), shown, database.reachOf(visitor.cell))
      : null;
    if (!found) return shown;
    const out = new Uint8Array(database.objects);
    for (const id of found.objects) out[id] = 1;
    return out;
  }

  /** Show what the eye sees and nothing else. */
  look() {
    this.stage.aim(this.visitor, this.chosen.view);
    const shown = this.sight(this.kept);
    this.stage.inside.show(shown);
    this.tell(Array.from(shown.keys()).filter((id) => shown[id]));
  }

  /** Bring what is shown up to where the visitor is. */
  enter() {
    const { database, visitor, stage, chosen } = this;
    const set = database.setOf(visitor.cell);
    const potential = set ? set.potential : Array.from({ length: database.objects }, (_, id) => id);
    const shown = new Uint8Array(database.objects).fill(chosen.mode === "whole" ? 1 : 0);
    for (const id of potential) shown[id] = 1;
    this.kept = shown;
    const verdicts = new Array(database.objects).fill("hidden");
    for (const id of potential) verdicts[id] = !set || set.unknown.has(id) ? "unknown" : "seen";
    stage.show(shown, chosen.verdicts ? verdicts : null);
    const near = (chosen.outlines && database.reachOf(visitor.cell)) || new Set();
    const { sides, axes } = database.maze;
    const portals = Array.from(axes, (_, k) => k).filter((k) => near.has(sides[2 * k]) && near.has(sides[2 * k + 1]));
    stage.outline(visitor.cell, [...near], portals);
    this.tell(chosen.mode === "whole" ? null : potential);
    this.cell = visitor.cell;
  }

  /** Say where the visitor is, and how much is drawn: these objects, or all. */
  tell(drawn) {
    const { database, visitor } = this;
    const set = database.setOf(visitor.cell);
    const count = (number) => number.toLocaleString("en");
    const sum = (ids) => ids.reduce((all, id) => all + database.triangleCounts[id], 0);
    const whole = this.whole ??= database.triangleCounts.reduce((all, one) => all + one, 0);
    const [here, potential] = [drawn?.length ?? database.objects, set?.potential.length ?? database.objects];
    const cell = visitor.cell;
    const name = cell < 0 ? "outside all cells" : `cell ${database.cellIds[cell]} ${database.head.cellNames[cell]}`;
    this.counts = { drawn: here, potential, objects: database.objects };
    this.panel.say({
      cell: set ? name : `${name}: no view cell, so everything is kept`,
      drawn: `${count(here)} drawn, ${count(potential)} potential (${set ? set.unknown.size : "all"} unknown), of ${count(database.objects)}`,
      triangles: `${count(drawn ? sum(drawn) : whole)} of ${count(whole)}`,
    });
  }

  frame(now) {
    const seconds = Math.min(LONGEST, (now - this.last) / 1000);
    this.last = now;
    const before = this.visitor.point.join();
    const asked = this.keys.tick(seconds);
    if (this.cell !== this.visitor.cell) {
      if (this.cell !== undefined) this.choose("height", this.storeyTop());
      this.enter();
      this.stale = true;
    }
    this.inquiry.enter(this.cell);
    const turned = `${this.visitor.yaw} ${this.visitor.pitch} ${JSON.stringify(this.stage.orbit)}`;
    if (this.stale || asked || before !== this.visitor.point.join() || turned !== this.turned) {
      const start = performance.now();
      if (this.chosen.mode === "eye") this.look();
      this.stage.draw(this.visitor, this.chosen.view, this.chosen.height);
      this.times = [...this.times.slice(-29), performance.now() - start];
      this.panel.say({ rate: `${(this.times.reduce((a, b) => a + b) / this.times.length).toFixed(1)} ms a frame on the processor` });
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
