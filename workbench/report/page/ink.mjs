// Colours of the plan, for light and for dark; after Okabe and Ito, which colour-blind readers tell apart.

const LIGHT = {
  paper: "#fff",
  ground: "#e1e6ea",
  room: "#fbf3e2",
  seen: "#a9d8f3",
  unknown: "#f6d38a",
  hidden: "#fff",
  other: "#fff",
  unclaimed: "#eceff1",
  source: "#d55e00",
  seenEdge: "#0072b2",
  unknownEdge: "#c27a00",
  hiddenEdge: "#a3acb4",
  roomEdge: "#8a949d",
  otherEdge: "#c4ccd3",
  hatch: "#9a6700",
  border: "#111",
  wall: "#20262c",
  detail: "#7d7268",
  glass: "#56a5cf",
  portal: "#007a58",
  sight: "#0072b2",
  target: "#a8437c",
  halo: "rgba(255,255,255,.9)",
  text: "#1d2329",
};
const DARK = {
  paper: "#14181c",
  ground: "#262c32",
  room: "#2b2a25",
  seen: "#17507a",
  unknown: "#6b4c0c",
  hidden: "#14181c",
  other: "#14181c",
  unclaimed: "#1f2429",
  source: "#d55e00",
  seenEdge: "#56b4e9",
  unknownEdge: "#e6a023",
  hiddenEdge: "#59626b",
  roomEdge: "#727c86",
  otherEdge: "#3a434b",
  hatch: "#e6a023",
  border: "#fff",
  wall: "#dfe5ea",
  detail: "#a3988d",
  glass: "#56a5cf",
  portal: "#2fc698",
  sight: "#7cc7f2",
  target: "#e58bbd",
  halo: "rgba(20,24,28,.88)",
  text: "#eef2f5",
};

/** The colours that the plan is drawn in, by name. */
export const ink = { ...LIGHT };

/** Takes the colours for dark, or for light. */
export const takeInk = (dark) => Object.assign(ink, dark ? DARK : LIGHT);
