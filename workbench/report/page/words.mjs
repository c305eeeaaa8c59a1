// Numbers and things in words.

const ROLE_WORD = ["occluder", "detail", "transparent"];

/** A whole number with commas. */
export const count = (n) => n.toLocaleString("en-US");

/** A number of things, in words. */
export const counted = (n, what) => `${count(n)} ${what}${n === 1 ? "" : "s"}`;

/** An overestimate to three digits. */
export const ratio = (over) => (Number.isFinite(over) ? over.toFixed(3) : "no witness");

/** Sides of a box [m]. */
export const size = (bake, b) => [0, 1, 2].map((k) => bake.metres(b[k + 3] - b[k]).toFixed(2)).join(" × ") + " m";

/** A list's entry for something that may have a name. */
export const label = (id, name) => (name ? `${id} · ${name}` : `${id}`);

/** A cell's number and, if it has one, name. */
export const cellName = ({ cells }, cell) => (cells.names[cell] ? `${cell} (${cells.names[cell]})` : `${cell}`);

/** What a room is called: its names, and the storey that the model's file puts it on. */
export function roomName({ rooms }, room) {
  const { name, longName, storey } = rooms.words[room],
    names = [...new Set([name, longName])].filter(Boolean).join(" ") || `room ${room}`;
  return storey ? `${names}, ${storey}` : names;
}

/** What a target is called, with a capital letter. */
export function describe(bake, kind, id) {
  if (kind === "cell") return `Cell ${cellName(bake, id)}`;
  const name = bake.objects.names[id];
  return `Object ${id}${name ? ` (${name})` : ""}`;
}

/** What a target is, beside its name. */
export function nature({ cells, objects }, kind, id) {
  if (kind === "object") return `${objects.kinds[objects.kind[id]] || "object"}, ${ROLE_WORD[objects.role[id]]}`;
  return cells.inhabitable[id] ? "inhabitable cell" : "wall, sliver or exterior cell";
}
