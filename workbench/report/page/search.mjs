// Search over rooms, objects, their kinds and GUIDs.
import { $, make } from "./dom.mjs";
import { count, counted, label, roomName } from "./words.mjs";

const SHOWN = 40;

/** How well a text answers: 0 the whole of it, 1 its beginning, 2 a part, 3 not. */
function rank(text, wanted) {
  const place = text.toLowerCase().indexOf(wanted);
  return place < 0 ? 3 : place > 0 ? 2 : text.length === wanted.length ? 0 : 1;
}

/** The best that any of some texts answers. */
const best = (texts, wanted) => Math.min(...texts.map((text) => rank(text, wanted)));

/**
 * What is found, best first: {what: "room" | "kind" | "object", id, rank}; a kind's id is its place in `objects.kinds`.
 * Rooms answer by short and long name, storey and GUID, objects by name, kind and GUID.
 */
export function findAll({ objects, rooms }, text) {
  const wanted = text.trim().toLowerCase();
  if (!wanted) return [];
  const ofRooms = rooms.words.map((words, id) => {
    const { name, longName, guid, storey } = words;
    return { what: "room", id, rank: best([name, longName, `${name} ${longName}`, guid, storey], wanted) };
  });
  const ofKinds = objects.kinds.map((kind, id) => ({ what: "kind", id, rank: rank(kind, wanted) }));
  const ofObjects = objects.names.map((name, id) => {
    // A whole kind stands for all objects of it; a part of one would bury what is called so.
    const kind = objects.kinds[objects.kind[id]].toLowerCase() === wanted ? 1 : 3;
    return { what: "object", id, rank: Math.min(kind, best([name, objects.guids[id]], wanted)) };
  });
  const found = [...ofRooms, ...ofKinds, ...ofObjects].filter((one) => one.rank < 3);
  return found.sort((a, b) => a.rank - b.rank);
}

/** What a find is called, and what is said beside it. */
export function findWords(bake, { what, id }) {
  const { objects } = bake;
  if (what === "room") {
    const cells = bake.cellsOf(id).length;
    return [`Room ${roomName(bake, id)}`, cells ? counted(cells, "view cell") : "no view cell"];
  }
  if (what === "kind") {
    const own = objects.kind.reduce((sum, kind) => sum + (kind === id), 0);
    return [objects.kinds[id] || "no kind", counted(own, "object")];
  }
  return [label(id, objects.names[id]), objects.kinds[objects.kind[id]]];
}

/** Chooses a find: a room is looked from, an object becomes the target; of a kind the objects are searched for. */
export function takeFind(state, { what, id }) {
  const { bake } = state;
  if (what === "room") state.pickRoom(id);
  if (what === "object") state.set({ target: { kind: "object", id }, storey: bake.storeyOf("object", id) });
  return what === "kind" ? bake.objects.kinds[id] : "";
}

/** Makes the search field find while somebody types. */
export function wireSearch(state) {
  const { bake } = state,
    field = $("search");
  field.placeholder = bake.roomCount ? "room, object, kind or GUID" : "object, kind or GUID";
  field.parentElement.hidden = !bake.roomCount && !bake.objectCount;
  const show = () => {
    const found = findAll(bake, field.value),
      left = found.length - SHOWN;
    const entry = (one) => {
      const [name, beside] = findWords(bake, one);
      const onclick = () => {
        const more = takeFind(state, one);
        if (!more) return;
        field.value = more;
        show();
      };
      const parts = [make("span", { className: "what" }, name), make("span", { className: "size" }, beside)];
      return make("li", {}, make("button", { type: "button", title: name, onclick }, ...parts));
    };
    const items = found.slice(0, SHOWN).map(entry);
    if (left > 0) items.push(make("li", { className: "empty" }, `and ${count(left)} more`));
    if (!found.length && field.value.trim()) items.push(make("li", { className: "empty" }, "Nothing is called so."));
    $("found").replaceChildren(...items);
    $("found").hidden = !items.length;
  };
  field.oninput = show;
}
