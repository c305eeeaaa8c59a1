// The view cell and the chosen target in words and numbers.
import { SEEN, UNKNOWN, WORD } from "./data.mjs";
import { $, button, make, paragraph, tableCell } from "./dom.mjs";
import { count, counted, describe, label, nature, ratio, roomName, size } from "./words.mjs";

const VERDICT = ["HIDDEN", "UNKNOWN", "VISIBLE", "NOT CLAIMED"];
const REASON = [
  "proved: no open sightline joins the view cell to it.",
  "neither a sightline nor a proof was found; it stays in the potentially visible set.",
  "a stored sightline, checked exactly, shows it.",
  "one of the two stands at an angle, or follows a room: only objects are looked at from there.",
];
const ELSEWHERE = "Its sightline is in the bake's folder; this page holds those to the largest targets only.";

// View cells of a room that are named.
const NUMBERED = 16;

/** Classes of targets that are counted apart: name, kind, which of the kind, and how many there are. */
export function classesOf({ cells, facts, sources, cellCount, objectCount }) {
  const ofCells = [
    ["Inhabitable cells", "cell", (id) => cells.inhabitable[id], sources.filter((id) => id < cells.firstPlan).length],
    ["Other cells", "cell", (id) => !cells.inhabitable[id], cellCount - sources.length],
  ];
  const ofObjects = [["Objects", "object", () => true, objectCount]];
  return [...(facts.claimsCells ? ofCells : []), ...(objectCount ? ofObjects : [])];
}

/** How much of all objects the view cell keeps, in words; nothing in a bare graph. */
export function keptWords({ objectCount, relations }, cell) {
  if (!objectCount) return "";
  return `; keeps ${((100 * relations.object.numbers(cell).potential) / objectCount).toFixed(1)} % of the objects`;
}

/** Where a view cell lies, and how much it keeps. */
function cellFacts(bake, cell) {
  const b = bake.box("cell", cell),
    [low, high] = [b[2], b[5]].map((z) => bake.metres(z).toFixed(2));
  const where = `${bake.level} ${bake.cells.storey[cell]}; ${size(bake, b)}; z ${low} to ${high} m`;
  return where + keptWords(bake, cell);
}

/** A room's view cells, how much of it they hold, and what it is by the model's file. */
export function roomFacts(bake, room) {
  const { covered, elevation, guid } = bake.rooms.words[room],
    cells = bake.cellsOf(room),
    one = cells.length === 1,
    numbers = [...cells.slice(0, NUMBERED), ...(cells.length > NUMBERED ? ["..."] : [])].join(", ");
  const words = [
    `${counted(cells.length, "view cell")} (${numbers}) together`,
    covered === null ? "" : `${one ? "it holds" : "they hold"} ${(100 * covered).toFixed(0)} % of where eyes may be in it`,
    elevation === null ? "" : `storey at ${elevation.toFixed(2)} m by the file`,
    guid,
  ];
  const silent = "some of them stand at an angle or follow the room: nothing is claimed of the cells that these see";
  return [...words, silentFrom(bake, cells) ? silent : ""].filter(Boolean).join("; ");
}

/** Whether nothing is claimed of the cells that some of these see. */
const silentFrom = ({ cells: { firstPlan } }, cells) => cells.some((cell) => cell >= firstPlan);

/** How many of the chosen targets of a kind are potential, seen and unknown from where is looked from. */
export function numbersFrom({ bake, cell, room, verdicts }, kind, chosen) {
  if (room < 0) return bake.relations[kind].numbers(cell, chosen);
  const found = [0, 0, 0, 0];
  verdicts[kind].forEach((verdict, id) => (found[verdict] += chosen(id) ? 1 : 0));
  const [unknown, seen] = [found[UNKNOWN], found[SEEN]],
    potential = unknown + seen;
  return { potential, seen, unknown, over: seen ? potential / seen : potential ? Infinity : 1 };
}

/** Name, whereabouts and numbers of the view cell, or of the room. */
export function showCell(state) {
  const { bake, cell, room } = state;
  $("cell-input").value = label(cell, bake.cells.names[cell]);
  $("picker-error").hidden = true;
  $("cell-title").textContent = room < 0 ? describe(bake, "cell", cell) : `Room ${roomName(bake, room)}`;
  $("cell-facts").textContent = room < 0 ? cellFacts(bake, cell) : roomFacts(bake, room);
  $("cell-numbers").tBodies[0].replaceChildren(
    ...classesOf(bake)
      .filter(([, kind]) => kind === "object" || !silentFrom(bake, state.from))
      .flatMap(([name, kind, chosen, all]) => {
      const n = numbersFrom(state, kind, chosen);
      const texts = [count(n.potential), count(n.seen), count(n.unknown), ratio(n.over)];
      const row = make("tr", { className: "with-bar" }, make("th", { scope: "row" }, name));
      row.append(...texts.map((text, k) => tableCell(text, { className: k === 3 ? "strong" : "" })));
      return [row, barRow(n, all, name)];
    }),
  );
}

/** Seen, unknown and hidden as parts of all targets. */
function barRow(n, all, name) {
  const parts = [n.seen, n.unknown, all - n.potential].map((k, i) => `${count(k)} ${["seen", "unknown", "hidden"][i]}`);
  const words = `${name}: ${parts.join(", ")} of ${count(all)}`;
  const strip = make("div", { className: "bar", role: "img", title: words, "aria-label": words });
  for (const part of ["seen", "unknown"]) {
    // A single unknown target in thousands still shows.
    const style = `width: ${(100 * n[part]) / Math.max(1, all)}%;${n[part] ? " min-width: 4px;" : ""}`;
    strip.append(make("span", { className: part, style }));
  }
  return make("tr", { className: "bar-row" }, tableCell(strip, { colSpan: 5 }));
}

/** How many targets of the coloured kind are of each verdict on each storey; of cells, the inhabitable ones. */
export function reached({ bake, cell, layer, room, verdicts }) {
  const found = bake.storeys.map(() => [0, 0, 0]);
  const add = (id, verdict) => {
    if (layer === "object" || bake.cells.inhabitable[id]) found[bake.storeyOf(layer, id)][verdict]++;
  };
  if (room < 0) bake.relations[layer].each(cell, add);
  else verdicts[layer].forEach((verdict, id) => [UNKNOWN, SEEN].includes(verdict) && add(id, verdict));
  return found;
}

/** Targets reached on each storey, as buttons that go there. */
export function showReach(state) {
  const { level, storeys } = state.bake,
    what = state.layer === "cell" ? "Inhabitable cells reached" : "Objects reached";
  if (storeys.length < 2) return;
  const buttons = reached(state).map((n, number) => {
    const words = `${level} ${number}: ${count(n[SEEN])} seen${n[UNKNOWN] ? `, ${count(n[UNKNOWN])} unknown` : ""}`;
    const chosen = { "aria-pressed": String(number === state.storey) };
    return n[SEEN] || n[UNKNOWN] ? button(words, () => state.show(number), chosen) : "";
  });
  $("reach").replaceChildren(`${what}, by ${level.toLowerCase()}:`, ...buttons.filter(Boolean));
}

/** The card of the chosen target: verdict and its reason, what the target is, its sightline, and what can be done. */
export function showTarget(state) {
  const { bake, storey, target, verdicts } = state,
    card = $("target");
  card.hidden = !target;
  card.replaceChildren();
  if (!target) return;
  const { kind, id } = target,
    verdict = verdicts[kind][id],
    level = bake.level.toLowerCase(),
    own = bake.storeyOf(kind, id),
    mark = make("span", { className: `mark ${WORD[verdict]}` });
  card.append(
    make("h3", {}, describe(bake, kind, id)),
    paragraph("verdict", mark, make("b", {}, VERDICT[verdict]), ": ", REASON[verdict]),
    paragraph("quiet small", `${nature(bake, kind, id)}; ${level} ${own}; box ${size(bake, bake.box(kind, id))}`),
    ...(verdict === SEEN ? sightWords(state, target) : []),
  );
  const buttons = make("div");
  if (own !== storey) buttons.append(button(`Show ${level} ${own}`, () => state.show(own)));
  const room = kind === "cell" && bake.cells.inhabitable[id];
  if (room) buttons.append(button("Make it the view cell", () => state.pick(id)));
  buttons.append(button("Close", () => state.set({ target: null })));
  card.append(buttons);
}

/** Cells that a sightline enters, each with the portal before it. */
export function pathOf({ portals }, cell, crossed) {
  let here = cell;
  return crossed.map((portal) => {
    const [low, high] = portals.cells.subarray(2 * portal, 2 * portal + 2);
    here = low === here ? high : low;
    return { portal, cell: here };
  });
}

/** Where the sightline to a seen target runs. */
function sightWords(state, target) {
  const { bake } = state,
    cell = state.seenFrom(target),
    sight = state.sightline(target),
    itself = target.kind === "cell" && state.from.includes(target.id);
  if (!sight) return [paragraph("small", itself ? "A view cell sees itself." : ELSEWHERE)];
  const [a, b] = sight.ends,
    at = (p) => `(${bake.inModel(p).map((v) => v.toFixed(2)).join(", ")})`,
    long = bake.metres(Math.hypot(...a.map((v, k) => b[k] - v))),
    n = sight.portals.length;
  const parts = [paragraph("small", `Sightline of ${long.toFixed(2)} m from ${at(a)} to ${at(b)} m in the model's own coordinates.`)];
  if (target.kind !== "cell" || !n) return parts;
  const path = paragraph("path", `Through ${counted(n, "portal")}: cell ${cell}`);
  for (const { portal, cell: next } of pathOf(bake, cell, sight.portals))
    path.append(" → ", make("b", { title: `portal ${portal}` }, `portal ${portal}`), ` → cell ${next}`);
  return [...parts, path];
}
