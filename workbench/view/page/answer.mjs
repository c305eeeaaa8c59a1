// The answer to "why do I (not) see this?", in words and as what is to be drawn.

import { clearance } from "./clearance.mjs";

const metres = (x) => (x < 0.01 ? `${(1000 * x).toFixed(1)} mm` : `${x.toFixed(2)} m`);
const many = (count, word) => `${count.toLocaleString("en")} ${word}${count === 1 ? "" : "s"}`;

/** Verdict of an object or a cell (`kind`) from a cell: seen, unknown or hidden; null where nothing is claimed. */
export function verdictOf(database, cell, kind, target) {
  const set = database.setOf(cell);
  if (!set) return null;
  if (kind === "cell") {
    const cells = database.reachOf(cell);
    return cells && (cells.has(target) ? "unknown" : "hidden");
  }
  if (!database.isPotential(cell, target)) return "hidden";
  return set.unknown.has(target) ? "unknown" : "seen";
}

/** Words, and what to draw: `line` (from, to, portals), `clear` (see clearance.mjs), `corners` of occluders. */
export function answer(database, reasons, cell, kind, target) {
  const box = kind === "object" ? database.boxOf(target) : database.cellBoxes.slice(6 * target, 6 * target + 6);
  const line = reasons.sightline(kind, cell, target);
  let verdict = verdictOf(database, cell, kind, target);
  // Sets of cells do not tell what is seen from what may be: sightlines do.
  if (kind === "cell" && verdict === "unknown" && (line || cell === target)) verdict = "seen";
  const found = { verdict, box, line, clear: null, corners: [] };
  const none = "The view was made without its bake, so no sightline and no proof is held.";
  if (verdict === null) return { ...found, text: "Nothing is claimed from here: it is kept." };
  if (cell === target && kind === "cell") return { ...found, text: "You are in it." };
  if (verdict === "seen") return seen(database, found, kind, target, reasons.held ? "No sightline is held." : none);
  if (verdict === "unknown") {
    return { ...found, text: reasons.held || kind === "object"
      ? "No sightline was found, and it is not proved hidden: it is kept." : `It may be visible. ${none}` };
  }
  if (!reasons.head.certified) {
    return { ...found, text: reasons.held
      ? "It was proved hidden when the model was baked; the proof was not kept (bake --certify keeps it)." : none };
  }
  const { proofs, occluders, corners } = reasons.blockers(cell, box);
  const text = proofs
    ? `Proved hidden: ${many(proofs, "proof")} for where it is, by ${many(occluders, "occluder")}, drawn.`
    : "No proof is held for the place where it is.";
  return { ...found, corners, text };
}

function seen(database, found, kind, target, none) {
  if (!found.line) return { ...found, text: none };
  const { from, to, portals } = found.line;
  const ids = [...database.clear.keys()].filter((id) => !database.clear[id] && !(kind === "object" && id === target));
  const clear = clearance(from, to, ids, (id) => database.boxOf(id), (id) => database.trianglesOf(id));
  const length = Math.hypot(...to.map((x, k) => x - from[k]));
  const way = portals.length ? ` through ${many(portals.length, "portal")}` : "";
  const by = clear ? `, clear of everything else by ${metres(clear.distance)} (${database.head.names[clear.id] || `object ${clear.id}`})` : "";
  return { ...found, clear, text: `A sightline of ${metres(length)}${way} leads from this cell to it${by}.` };
}
