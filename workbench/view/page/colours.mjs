// Colours of what is drawn: the model's own where it has some, else by what a thing is; what colours may mean, from
// those that colour-blind readers tell apart (after Okabe and Ito).

export const VERDICTS = { seen: 0x56b4e9, unknown: 0xe69f00, hidden: 0x9aa5ad };
export const MEMORY = { read: 0xd55e00, release: 0xcc79a7, resident: 0x56b4e9, ahead: 0xf0e442, absent: 0x9aa5ad };
// From the finest level to the coarsest.
const LEVELS = [0x0072b2, 0x56b4e9, 0x009e73, 0xf0e442, 0xe69f00, 0xd55e00];
const KINDS = [
  [/door/i, 0xb08457],
  [/window|glass|pane|curtain/i, 0xa9d3e6],
  [/slab|floor|ceiling|covering|roof/i, 0xd8d2c6],
  [/wall|beam|column|frame/i, 0xece8df],
  [/stair|ramp|rail/i, 0xbfc4c9],
  [/pipe|duct|flow|member/i, 0x9fb4a5],
  [/furn|book|desk|chair|table|shelf|lamp/i, 0xc79f73],
];
const OTHER = 0xc8cdd2;

/** Red, green, blue of an object, from 0 to 1, from its own colour (0xRRGGBBAA, 0 for none) or its kind and name. */
export function colourOf(own, kind, name) {
  return rgb(own ? own >>> 8 : (KINDS.find(([word]) => word.test(kind) || word.test(name)) ?? [0, OTHER])[1]);
}

/** The same three numbers of a colour such as 0xff8000. */
export function rgb(colour) {
  return [colour >> 16, (colour >> 8) & 255, colour & 255].map((part) => part / 255);
}

/** Of a level of detail. */
export function levelColour(level) {
  return rgb(LEVELS[Math.min(level, LEVELS.length - 1)]);
}

/** What each colour of a way to colour means, as pairs of a word and a colour. */
export function legend(colours) {
  if (colours === "levels") return LEVELS.map((colour, level) => [level ? `${level}` : "level 0, the finest", colour]);
  if (colours === "backs") return [["faces away from the view cell", 0x993061]];
  return Object.entries({ verdicts: VERDICTS, memory: MEMORY }[colours] ?? {});
}
