// Why something is seen, or not: what a bake holds of it. Sightlines, portal sequences, and occluders that proofs name.

import { arraysOf, unpacked } from "./unpack.mjs";

/** Run a script of the view's own folder; files may not be fetched otherwise from where they lie. */
export function loadScript(source) {
  return new Promise((done, failed) => {
    const script = document.createElement("script");
    script.src = source;
    script.onload = () => done(script.remove());
    script.onerror = () => failed(new Error(`${source} cannot be read`), script.remove());
    document.head.append(script);
  });
}

/** Reasons of the view's own folder. */
export async function loadReasons() {
  await loadScript("why.js");
  const { head, arrays, packed } = globalThis.viewcellReasons;
  delete globalThis.viewcellReasons;
  return new Reasons(head, arraysOf(arrays, await unpacked(packed)));
}

export class Reasons {
  constructor(head, arrays) {
    this.head = head;
    Object.assign(this, arrays);
    this.rows = Object.fromEntries(["object", "cell"].map((kind) => {
      const pairs = this[`${kind}Pairs`] ?? [];
      return [kind, new Map(Array.from({ length: pairs.length / 2 }, (_, row) => [`${pairs[2 * row]} ${pairs[2 * row + 1]}`, row]))];
    }));
  }

  /** Whether anything is held. */
  get held() {
    return this.head.certified !== null;
  }

  /** Ends of the sightline from a cell to an object or a cell (`kind`), or null; for a cell with the portals it passes. */
  sightline(kind, cell, target) {
    const row = this.rows[kind].get(`${cell} ${target}`);
    if (row === undefined) return null;
    const line = Array.from(this[`${kind}Lines`].subarray(6 * row, 6 * row + 6));
    const portals = kind === "cell" ? [...this.sequences.subarray(this.sequenceStarts[row], this.sequenceStarts[row + 1])] : [];
    return { from: line.slice(0, 3), to: line.slice(3), portals };
  }

  /** Sightlines from a cell to all other cells that it sees, as above. */
  sightlinesOf(cell) {
    const found = [];
    for (let row = 0; row < (this.cellPairs?.length ?? 0) / 2; row++) {
      const target = this.cellPairs[2 * row + 1];
      if (this.cellPairs[2 * row] === cell && target !== cell) found.push(this.sightline("cell", cell, target));
    }
    return found;
  }

  /** Proofs whose boxes meet a box, from a cell, and rectangles of all occluders that they name, 12 numbers each. */
  blockers(cell, box) {
    const named = new Set();
    let proofs = 0;
    for (let proof = 0; proof < (this.proofCells?.length ?? 0); proof++) {
      const own = this.proofBoxes.subarray(6 * proof, 6 * proof + 6);
      if (this.proofCells[proof] !== cell || [0, 1, 2].some((k) => own[k] > box[k + 3] || own[k + 3] < box[k])) continue;
      proofs++;
      for (let k = this.proofStarts[proof]; k < this.proofStarts[proof + 1]; k++) named.add(this.proofBlockers[k]);
    }
    const corners = [...named].flatMap((one) =>
      [...this.blockerCorners.subarray(12 * this.blockerStarts[one], 12 * this.blockerStarts[one + 1])]);
    return { proofs, occluders: named.size, corners };
  }
}
