// Colours of what is drawn: the model's own where it has some, else by what a thing is; verdicts as in the report.

export const VERDICTS = { seen: 0x56b4e9, unknown: 0xe69f00, hidden: 0x9aa5ad };
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
  const found = own ? own >>> 8 : (KINDS.find(([word]) => word.test(kind) || word.test(name)) ?? [0, OTHER])[1];
  return [found >> 16, (found >> 8) & 255, found & 255].map((part) => part / 255);
}

/** The same three numbers of a colour such as 0xff8000. */
export function rgb(colour) {
  return [colour >> 16, (colour >> 8) & 255, colour & 255].map((part) => part / 255);
}
