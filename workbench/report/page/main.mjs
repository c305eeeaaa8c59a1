// The page: its data, what is chosen, and all parts that show it.
import { showCurves } from "./charts.mjs";
import { Bake, unpack } from "./data.mjs";
import { $, complain, make, offer } from "./dom.mjs";
import { showCell, showReach, showTarget } from "./inspector.mjs";
import { showLegend } from "./legend.mjs";
import { findSource, markRow, markTarget, showList, showWorst, sortedCells } from "./list.mjs";
import { showNumbers } from "./numbers.mjs";
import { Plan } from "./plan.mjs";
import { listenTo } from "./pointing.mjs";
import { wireSearch } from "./search.mjs";
import { LISTED, State } from "./state.mjs";
import { counted, label } from "./words.mjs";

const KIND_WORD = { cell: "cells, all kinds", object: "objects" };

function showHead({ cellCount, facts, objectCount, portals, sources }) {
  const shown = [
    counted(sources.length, "view cell"),
    facts.claimsCells && `${counted(cellCount, "cell")} in all`,
    portals.axis.length && counted(portals.axis.length, "portal"),
    objectCount && counted(objectCount, "object"),
  ];
  $("subtitle").textContent =
    `Potentially visible sets: ${shown.filter(Boolean).join(", ")}. viewcell ${facts.version}.`;
  $("footer").textContent =
    `Written by viewcell ${facts.version} from ${facts.source || "a bake"}. Lengths in metres, relative to the bake's origin, z up. This page is complete in itself and loads nothing.`;
  document.querySelector("main").hidden = false;
}

/** The page's address names the room or the view cell, so that a link leads back to it. */
function showAddress({ cell, room }) {
  try {
    history.replaceState(null, "", room < 0 ? `#cell-${cell}` : `#room-${room}`);
  } catch {
    /* a sandboxed frame has no address of its own */
  }
}

/** Choices of a storey, what is coloured, what a click does, and what is drawn; zoom. */
function wireTools(state) {
  const { bake } = state,
    { cells, kinds, level, sources, storeys } = bake;
  const choices = storeys.map(({ floor }, n) => {
    const own = sources.filter((cell) => cells.storey[cell] === n).length;
    return [String(n), `${n}: floor at ${bake.metres(floor).toFixed(2)} m, ${counted(own, "cell")}`];
  });
  offer($("storey"), choices, "0");
  $("storey").parentElement.firstChild.textContent = `${level} `;
  $("storey").onchange = ({ target }) => state.show(Number(target.value));
  state.on("storey", () => {
    $("storey").value = String(state.storey);
  });
  for (const kind of ["cell", "object"]) {
    $(`${kind}-lines`).onchange = ({ target }) => state.set({ lines: { ...state.lines, [kind]: target.checked } });
    for (const element of document.querySelectorAll(`.of-${kind}s`)) element.hidden = !kinds.includes(kind);
  }
  $("portals").onchange = ({ target }) => state.set({ portals: target.checked });
  if (kinds.length < 2) {
    $("layers").hidden = $("worst-kind-label").hidden = $("list-kind").hidden = true;
    $("object-lines").nextSibling.textContent = kinds[0] === "object" ? "sightlines" : "to objects";
  }
  for (const radio of document.querySelectorAll("input[type=radio]")) {
    radio.checked = radio.value === state[radio.name];
    radio.onchange = () => {
      // What is coloured is listed, too.
      const list = radio.name === "layer" ? { listKind: radio.value, listed: LISTED } : {};
      state.set({ [radio.name]: radio.value, hover: null, ...list });
    };
  }
  $("zoom-in").onclick = () => state.zoomHere(1.4);
  $("zoom-out").onclick = () => state.zoomHere(1 / 1.4);
  $("zoom-fit").onclick = () => state.fit();
}

/** Ways to a view cell other than the plan. */
function wirePicker(state) {
  const { cells, sources } = state.bake;
  $("previous").onclick = () => state.step(-1);
  $("next").onclick = () => state.step(1);
  $("cell-names").append(...sources.map((cell) => make("option", { value: label(cell, cells.names[cell]) })));
  $("cell-input").onfocus = ({ target }) => target.select();
  $("cell-input").onchange = ({ target }) => {
    const cell = findSource(state.bake, target.value);
    $("picker-error").hidden = cell !== undefined;
    $("picker-error").textContent = `No view cell has the id or name "${target.value.trim()}".`;
    state.pick(cell);
  };
}

function wireLists(state) {
  const listed = state.bake.kinds.map((kind) => [kind, `${kind}s`]),
    counted = state.bake.kinds.map((kind) => [kind, KIND_WORD[kind]]);
  offer($("list-kind"), listed, state.listKind);
  offer($("worst-kind"), counted, state.worstKind);
  $("list-kind").onchange = ({ target }) => state.set({ listKind: target.value, listed: LISTED });
  for (const tab of document.querySelectorAll(".tabs button"))
    tab.onclick = () => state.set({ listVerdict: Number(tab.dataset.verdict), listed: LISTED });
  $("more").onclick = () => state.set({ listed: state.listed + LISTED });
  $("worst-kind").onchange = ({ target }) => state.set({ worstKind: target.value });
  $("all-cells").onclick = () => state.set({ allCells: !state.allCells });
}

/** What is shown anew after which change. */
function wireViews(state) {
  state.on("cell", showAddress);
  state.on("cell", showCell);
  state.on("cell layer storey", showReach);
  state.on("target", showTarget);
  state.on("target", markTarget);
  state.on("cell listKind listVerdict listed", showList);
  state.on("cell", markRow);
  state.on("worstKind sort allCells", showWorst);
  state.on("layer", showLegend);
}

async function start() {
  if (typeof DecompressionStream === "undefined") {
    complain("This page needs a browser of 2023 or later: yours cannot unpack the data in it (DecompressionStream).");
    return;
  }
  const bake = new Bake(await unpack(JSON.parse($("data").textContent)));
  showHead(bake);
  showNumbers(bake.facts);
  if (bake.curves) showCurves(bake.curves);
  if (!bake.sources.length || !bake.kinds.length) {
    complain("This bake has no inhabitable cell, so there is no set to show.");
    $("plan-section").hidden = $("cells-section").hidden = true;
    return;
  }
  const state = new State(bake);
  new Plan($("plan"), state);
  listenTo($("plan"), state);
  for (const wire of [wireTools, wirePicker, wireSearch, wireLists, wireViews]) wire(state);
  showLegend(state);
  showWorst(state);
  const [, what, id] = /^#(cell|room)-(\d+)$/.exec(location.hash) ?? [],
    [worst] = sortedCells(bake, state.worstKind, state.sort);
  state.pick(what === "cell" && bake.cells.inhabitable[Number(id)] ? Number(id) : worst.cell);
  if (what === "room" && Number(id) < bake.roomCount) state.pickRoom(Number(id));
  document.documentElement.dataset.ready = "yes";
}

start();
