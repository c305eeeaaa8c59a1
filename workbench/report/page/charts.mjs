// Curves of time against error: their numbers, picture and table.
import { $, make, shape, tableCell, tableRow } from "./dom.mjs";
import { labelPlaces } from "./labels.mjs";

const SERIES = ["#0072b2", "#d55e00", "#009e73", "#a8437c", "#555555", "#56b4e9"];
// Marks of the series: corners about the middle [pixels]; the first is a circle.
const MARKS = ["", "-5,-5 5,-5 5,5 -5,5", "0,-7 6,5 -6,5", "0,-7 6,0 0,7 -6,0", "-6,-5 6,-5 0,7"];
// The picture's size, and where its axes end [pixels].
const PLOT = { width: 1000, height: 520, left: 76, right: 700, top: 16, bottom: 468 };
// Halfway clear, for light and dark paper.
const GRID = "#7b858f55";
// Of the values beside marks [pixels].
const VALUE_SIZE = 11;
const HEAD = ["method", "knob", "value", "seconds", "error", "unknown", "wrong-hidden", "on the front", "view cells"];
// The error axis is logarithmic above 1; an exact result has a place on it all the same.
const EXACT = 1e-4;

/** What the error axis shows of a point: its overestimate beyond 1. */
export const aboveOne = (p) => Math.max(p.error - 1, EXACT);

/** Series that can be drawn. A method that hides something visible at any setting is not safe at the others either. */
export function safeSeries(series) {
  return series
    .filter((one) => one.points.every((p) => !p.wrong_hidden))
    .map((one) => ({ ...one, points: one.points.filter((p) => p.seconds > 0 && p.error !== null) }))
    .filter((one) => one.points.length);
}

/** Series of the same view cells, which the front speaks of, and those of others, which it cannot be compared with. */
export const ofSameCells = (series) => [series.filter((one) => !one.apart), series.filter((one) => one.apart)];

/** Points of the Pareto front, which the bake's own curves mark, fastest first. */
export const frontOf = (series) =>
  series
    .flatMap((one) => one.points)
    .filter((p) => p.front)
    .sort((a, b) => a.seconds - b.seconds);

/** Round values between two powers of ten, `low` and `high`: 1, 2 and 5 of each power, 1 alone over many powers. */
export function ticksBetween(low, high) {
  const out = [];
  for (let power = Math.floor(low); power <= high; power++)
    for (const n of high - low > 4 ? [1] : [1, 2, 5]) {
      const log = Math.log10(n) + power;
      if (log >= low && log <= high) out.push(n * 10 ** power);
    }
  return out;
}

/** A logarithmic axis with some room about all values: `at` is a value's place [pixels] between two, and its ticks. */
export function logAxis(values, from, to) {
  const logs = values.map(Math.log10),
    low = Math.min(...logs) - 0.15,
    high = Math.max(...logs) + 0.15;
  const at = (value) => from + ((Math.log10(value) - low) / (high - low)) * (to - from);
  return { at, ticks: ticksBetween(low, high) };
}

/** Shows the section of the curves, if anything can be drawn. */
export function showCurves({ scene, series }) {
  const safe = safeSeries(series),
    [same, others] = ofSameCells(safe);
  if (!safe.length) return;
  $("curves-section").hidden = $("curves-link").hidden = false;
  $("curves-about").textContent =
    `${scene}. Each mark is one setting of a knob, whose value stands beside it; to the left is ` +
    "faster, further down is tighter. The thick black line is the Pareto front: no setting in that picture is both " +
    "faster and tighter. Methods that hide something visible are left out of the pictures, and listed in the table.";
  const about = "Overestimate against seconds, with the Pareto front";
  if (same.length) $("curves").append(curvePicture(same, safe, about));
  if (others.length) {
    const apart =
      "The same from other view cells than the rest, smaller or more of them: each line is to be read by itself, and " +
      "none takes part in the front.";
    $("curves").append(make("p", { className: "quiet" }, apart), curvePicture(others, safe, "Other view cells"));
  }
  $("curves").append(curveTable(series));
}

const words = (x, y, text, more = {}) => shape("text", { x, y, ...more }, text);
const rule = (x1, x2, y1, y2, stroke, more = {}) => shape("line", { x1, x2, y1, y2, stroke, ...more });

/** A picture of some series; `safe` are all that are drawn, so that each keeps its colour and its mark. */
function curvePicture(series, safe, about) {
  const { width, height, left, right, top, bottom } = PLOT,
    points = series.flatMap((one) => one.points),
    seconds = points.map((p) => p.seconds),
    across = logAxis(seconds, left, right),
    up = logAxis(points.map(aboveOne), bottom, top),
    front = frontOf(series);
  const at = (p) => [across.at(p.seconds), up.at(aboveOne(p))];
  const svg = shape("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": about });
  drawAxes(svg, across, up);
  const heavy = { fill: "none", stroke: "currentColor", "stroke-width": 3, "stroke-opacity": 0.8 };
  const steps = front.map((p, n) => (n ? `H${at(p)[0]}V${at(p)[1]}` : `M${at(p).join(" ")}`)).join("");
  if (front.length) svg.append(shape("path", { d: `${steps}H${right}`, ...heavy }));
  const methods = [...new Set(safe.map((one) => one.method))];
  series.forEach((one, place) => {
    const n = safe.indexOf(one),
      colour = SERIES[methods.indexOf(one.method) % SERIES.length];
    const y = top + 16 + 34 * place;
    svg.append(curveMarks(one, n, colour, at), marker(n, right + 26, y, colour));
    svg.append(words(right + 40, y + 4, one.method));
    if (one.knob !== "no knob") svg.append(words(right + 40, y + 19, one.knob, { class: "knob" }));
  });
  svg.append(valueLabels(series, at));
  if (front.length) {
    const y = top + 16 + 34 * series.length;
    svg.append(rule(right + 16, right + 36, y, y, "currentColor", { "stroke-width": 3 }));
    svg.append(words(right + 40, y + 4, "Pareto front"));
  }
  return svg;
}

/** The marks of one series, joined in the order of the knob's values. */
function curveMarks(one, n, colour, at) {
  const points = [...one.points].sort((a, b) => a.value - b.value);
  const line = { fill: "none", stroke: colour, "stroke-width": 1.5, "stroke-opacity": 0.7 };
  const group = shape("g", {}, shape("polyline", { points: points.map(at).join(" "), ...line }));
  for (const p of points) {
    const dot = marker(n, ...at(p), colour);
    const numbers = `${p.seconds.toPrecision(3)} s, overestimate ${p.error.toFixed(4)}`;
    dot.append(shape("title", {}, `${one.method}, ${one.knob} ${p.value}: ${numbers}`));
    if (p.front) dot.setAttribute("class", "on-front");
    group.append(dot);
  }
  return group;
}

/** The knobs' values beside the marks, none over another. */
function valueLabels(series, at) {
  const group = shape("g", { class: "values" }),
    { left, right, top, bottom } = PLOT;
  const placed = ({ points }) => points.map((p) => ({ x: at(p)[0], y: at(p)[1], text: String(p.value) }));
  const labels = series.filter((one) => one.points.length > 1).flatMap(placed),
    marks = series.filter((one) => one.points.length === 1).flatMap(placed);
  labelPlaces(labels, marks, [left, top, right, bottom], VALUE_SIZE).forEach(({ x, y, far }, n) => {
    if (far) group.append(rule(labels[n].x, x, labels[n].y, y, GRID));
    group.append(words(x, y + VALUE_SIZE / 3, labels[n].text, { "text-anchor": "middle" }));
  });
  return group;
}

function marker(n, x, y, colour) {
  const paint = { fill: colour, stroke: "#fff", "stroke-width": 1 },
    corners = MARKS[n % MARKS.length];
  if (!corners) return shape("circle", { cx: x, cy: y, r: 5.5, ...paint });
  const placed = corners.replace(/(\S+),(\S+)/g, (_, a, b) => `${x + Number(a)},${y + Number(b)}`);
  return shape("polygon", { points: placed, ...paint });
}

function drawAxes(svg, across, up) {
  const { height, left, right, top, bottom } = PLOT;
  const short = (value, digits) => String(Number(value.toPrecision(digits)));
  for (const v of across.ticks) {
    const x = across.at(v);
    svg.append(rule(x, x, top, bottom, GRID));
    svg.append(words(x, bottom + 18, short(v, 2), { "text-anchor": "middle" }));
  }
  for (const v of up.ticks) {
    const y = up.at(v);
    svg.append(rule(left, right, y, y, GRID));
    svg.append(words(left - 8, y + 4, short(1 + v, 6), { "text-anchor": "end" }));
  }
  const middle = (top + bottom) / 2,
    turned = { transform: `rotate(-90 16 ${middle})`, "text-anchor": "middle" };
  svg.append(
    shape("rect", { x: left, y: top, width: right - left, height: bottom - top, fill: "none", stroke: "#7b858f" }),
    words((left + right) / 2, height - 10, "seconds of visibility (logarithmic)", { "text-anchor": "middle" }),
    words(16, middle, "overestimate, potential / seen (logarithmic above 1)", turned),
  );
}

function curveTable(series) {
  const show = (v, digits = 4) => (v === null ? "" : String(Number(v.toPrecision(digits))));
  const rows = series.flatMap((one) =>
    one.points.map((p) => {
      const unknown = p.unknown === null ? "" : `${(100 * p.unknown).toFixed(2)} %`;
      const values = [show(p.value), show(p.seconds), show(p.error), unknown, show(p.wrong_hidden, 9)];
      const names = [one.method, one.knob].map((text) => tableCell(text, { className: "text" }));
      const places = [p.front ? "yes" : "", one.apart ? "others" : ""];
      return tableRow(...names, ...[...values, ...places].map((text) => tableCell(text)));
    }),
  );
  const head = HEAD.map((word, n) => make("th", { scope: "col", className: n < 2 ? "text" : "" }, word));
  const table = make("table", { className: "rows plain" });
  table.append(make("thead", {}, tableRow(...head)), make("tbody", {}, ...rows));
  const summary = make("summary", {}, "All settings as a table");
  return make("details", {}, summary, make("div", { className: "scroll" }, table));
}
