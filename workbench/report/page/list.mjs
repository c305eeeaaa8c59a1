// Lists: targets of the view cell by verdict, all view cells by a column, and view cells by what was typed.
import { WORD } from "./data.mjs";
import { $, button, make, tableCell, tableRow } from "./dom.mjs";
import { LISTED } from "./state.mjs";
import { count, counted, describe, label, nature, ratio } from "./words.mjs";

const ROWS_SHOWN = 12;
// Columns of the table of view cells; a first click on one of the latter four sorts the largest first.
const COLUMNS = ["cell", "name", "storey", "potential", "seen", "unknown", "over"];

/** Ids of all targets of a kind by verdict; the view cells that are looked from are left out. */
export function targetsByVerdict({ from, verdicts }, kind) {
  const found = [[], [], [], []];
  verdicts[kind].forEach((verdict, id) => {
    if (kind !== "cell" || !from.includes(id)) found[verdict].push(id);
  });
  // Of the rest nothing is claimed.
  return found.slice(0, 3);
}

/** The ids, inhabitable cells first, then by the diagonal of their boxes, largest first. */
export function bySize(bake, kind, ids) {
  const inhabitable = (id) => (kind === "cell" ? bake.cells.inhabitable[id] : 0);
  return ids
    .map((id) => [inhabitable(id), bake.diagonal(kind, id), id])
    .sort((a, b) => b[0] - a[0] || b[1] - a[1])
    .map(([, , id]) => id);
}

/** What the list shows: how many targets there are of each verdict, the ids listed, and how many more there are. */
export function listing(state) {
  const { bake, listed, listKind, listVerdict } = state,
    found = targetsByVerdict(state, listKind),
    ids = bySize(bake, listKind, found[listVerdict]);
  return { counts: found.map((one) => one.length), ids: ids.slice(0, listed), left: ids.length - listed };
}

/** The list of targets, as far as it is shown. */
export function showList(state) {
  const { listKind: kind, listVerdict } = state,
    { counts, ids, left } = listing(state);
  $("list-kind").value = kind;
  for (const tab of document.querySelectorAll(".tabs button")) {
    const verdict = Number(tab.dataset.verdict);
    tab.textContent = `${WORD[verdict]} ${count(counts[verdict])}`;
    tab.setAttribute("aria-pressed", String(verdict === listVerdict));
  }
  $("targets").replaceChildren(...ids.map((id) => listItem(state, kind, id)));
  if (!ids.length)
    $("targets").append(make("li", { className: "empty" }, `Nothing is ${WORD[listVerdict]} from here.`));
  $("more").hidden = left <= 0;
  $("more").textContent = `Show ${count(Math.min(LISTED, left))} more of ${count(counts[listVerdict])}`;
}

function listItem(state, kind, id) {
  const { cells, objects } = state.bake;
  const name =
    kind === "cell"
      ? cells.names[id] || (cells.inhabitable[id] ? "" : "wall, sliver or exterior")
      : objects.names[id] || objects.kinds[objects.kind[id]];
  const title = `${describe(state.bake, kind, id)}, ${nature(state.bake, kind, id)}`;
  const onclick = () => state.set({ target: { kind, id } });
  const entry = make(
    "button",
    { type: "button", title, onclick, "data-target": `${kind} ${id}` },
    make("span", { className: `mark ${WORD[state.verdicts[kind][id]]}` }),
    make("span", { className: "what" }, label(id, name)),
    make("span", { className: "size" }, `${state.bake.diagonal(kind, id).toFixed(1)} m`),
  );
  return make("li", {}, entry);
}

/** Marks the chosen target in the list. */
export function markTarget({ target }) {
  const chosen = target && `${target.kind} ${target.id}`;
  for (const entry of $("targets").querySelectorAll("button"))
    entry.setAttribute("aria-current", String(entry.dataset.target === chosen));
}

/** The view cell that was typed: by id, alone or before its name, else by name, else by part of a name; or undefined. */
export function findSource({ cells, sources }, text) {
  const wanted = text.trim().toLowerCase(),
    id = /^(\d+)(\s*·.*)?$/.exec(wanted);
  if (id) return cells.inhabitable[Number(id[1])] ? Number(id[1]) : undefined;
  const named = (test) => sources.find((cell) => wanted && test(cells.names[cell].toLowerCase()));
  return named((name) => name === wanted) ?? named((name) => name.includes(wanted));
}

/** All view cells with their numbers of a kind of targets, sorted; ties by what is unknown, most first, then by id. */
export function sortedCells({ cells, relations, sources }, kind, { key, down }) {
  const { names, storey } = cells;
  const row = (cell) => ({ cell, name: names[cell], storey: storey[cell], ...relations[kind].numbers(cell) });
  const byName = (a, b) => a.name.localeCompare(b.name, "en", { numeric: true }),
    // Of two that are infinite the difference is not a number, which counts as 0 below.
    compare = key === "name" ? byName : (a, b) => a[key] - b[key];
  const order = (a, b) => (down ? -1 : 1) * compare(a, b) || b.unknown - a.unknown || a.cell - b.cell;
  return sources.map(row).sort(order);
}

/** The table of view cells, the first rows or all. */
export function showWorst(state) {
  const rows = sortedCells(state.bake, state.worstKind, state.sort),
    most = Math.max(0, ...rows.map((r) => r.over - 1).filter(Number.isFinite)),
    others = state.allCells ? `${ROWS_SHOWN} cells only` : `all ${counted(rows.length, "cell")}`;
  const meter = make("th", { className: "meter", "aria-hidden": "true" });
  $("worst").tHead.replaceChildren(tableRow(...COLUMNS.map((key, n) => heading(state, key, n > 2)), meter));
  const shown = state.allCells ? rows : rows.slice(0, ROWS_SHOWN);
  $("worst").tBodies[0].replaceChildren(...shown.map((r) => worstRow(state, r, most)));
  $("all-cells").hidden = rows.length <= ROWS_SHOWN;
  $("all-cells").textContent = `Show ${others}`;
  markRow(state);
}

function heading(state, key, downFirst) {
  const { bake, sort } = state,
    word = { storey: bake.level.toLowerCase(), over: "overestimate" }[key] ?? key,
    chosen = sort.key === key,
    sign = chosen ? (sort.down ? " ▼" : " ▲") : "";
  const act = () => {
    state.set({ sort: { key, down: chosen ? !sort.down : downFirst } });
    document.querySelector(`#worst th button[data-key=${key}]`).focus();
  };
  const head = make("th", { scope: "col", className: key === "name" ? "text" : "" });
  head.append(button(word + sign, act, { "data-key": key }));
  if (chosen) head.setAttribute("aria-sort", sort.down ? "descending" : "ascending");
  return head;
}

function worstRow(state, r, most) {
  const texts = [r.storey, count(r.potential), count(r.seen), count(r.unknown), ratio(r.over)],
    wide = Number.isFinite(r.over) ? (most ? (110 * (r.over - 1)) / most : 0) : 110;
  const onclick = () => {
    state.pick(r.cell);
    $("plan-section").scrollIntoView({ block: "start" });
  };
  const pick = make("button", { type: "button", title: `Pick view cell ${r.cell}` }, String(r.cell)),
    meter = make("span", { className: "over", style: `width: ${wide}px` });
  return make(
    "tr",
    { "data-cell": r.cell, onclick },
    tableCell(pick),
    tableCell(r.name, { className: "text" }),
    ...texts.map((text) => tableCell(text)),
    tableCell(meter, { className: "meter", "aria-hidden": "true" }),
  );
}

/** Marks the view cell in the table. */
export function markRow({ cell }) {
  for (const row of $("worst").tBodies[0].rows)
    row.setAttribute("aria-selected", String(Number(row.dataset.cell) === cell));
}
