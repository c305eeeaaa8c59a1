// "Why do I (not) see this?": what was asked for, and its answer beside and in the picture.

import { answer } from "./answer.mjs";
import { loadReasons } from "./reasons.mjs";

export class Inquiry {
  /** `changed()` hears that there is something else to draw. */
  constructor(database, stage, panel, changed) {
    Object.assign(this, { database, stage, panel, changed });
    this.asked = null;
  }

  /** Ask for an object or a cell (`kind`); null for nothing. */
  async ask(asked) {
    this.asked = asked;
    this.from = undefined;
    if (asked && !(await this.load())) return;
    this.clear();
    this.changed();
  }

  /** What the bake holds; null, and a word about it, where that cannot be read. */
  async load() {
    this.loading ??= loadReasons();
    try {
      this.reasons = await this.loading;
    } catch (error) {
      this.loading = undefined;
      this.panel.note(`No reason can be given: ${error.message}`);
      return null;
    }
    return this.reasons;
  }

  /** Answer anew from another cell. */
  enter(cell) {
    if (!this.asked || !this.reasons || this.from === cell) return;
    this.from = cell;
    const { database, asked } = this;
    this.found = answer(database, this.reasons, cell, asked.kind, asked.id);
    this.stage.marks.show(this.found);
    this.panel.why({ ...this.found, title: this.title() });
  }

  clear() {
    if (this.asked) return;
    this.found = null;
    this.stage.marks.show(null);
    this.panel.why(null);
  }

  title() {
    const { head, kinds, cellIds } = this.database;
    const { kind, id } = this.asked;
    if (kind === "object") return [head.names[id] || `object ${id}`, head.kinds[kinds[id]]].filter(Boolean).join(", ");
    return head.cellNames[id] || `cell ${cellIds[id]}`;
  }
}
