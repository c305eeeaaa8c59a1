// The numbers of the bake.
import { $, make, paragraph, tableCell, tableRow } from "./dom.mjs";
import { count } from "./words.mjs";

const DIGITS = /^[\d.,]+( %)?$/;

/** Tables of what the manifest says, each {title, rows, head}; a row is its name and one or more values. */
export function factTables(facts) {
  const named = (values, show) => Object.entries(values).map(([key, v]) => [key.replaceAll("_", " "), show(v)]);
  const total = Object.values(facts.seconds).reduce((sum, value) => sum + value, 0);
  const model = [
    ["source", facts.source || "unknown"],
    ["grid step", `${(1000 * facts.gridMetres).toFixed(4)} mm`],
    ["origin", `(${facts.origin.join(", ")}) m`],
    facts.yawDegrees && ["turned back by", `${facts.yawDegrees}°`],
    facts.snapMetres !== null && ["moved by snapping at most", `${(1000 * facts.snapMetres).toFixed(3)} mm`],
    facts.because && ["inhabitable cells", facts.because],
    facts.sha256 && ["SHA-256", facts.sha256],
  ];
  const seconds = [...named(facts.seconds, (v) => v.toFixed(2)), ["all phases", total.toFixed(2)]];
  return [
    {
      title: "Seen from all view cells",
      rows: facts.classes.map(([name, potential, seen, over, unknown]) => [name, potential, seen, unknown, over]),
      head: ["targets", "potential", "seen", "unknown", "overestimate"],
    },
    ...(facts.kept.length ? [{ title: "Kept by a view cell", rows: facts.kept }] : []),
    ...(facts.faces.length ? [{ title: "Faces of occluders", rows: facts.faces }] : []),
    { title: "Counts", rows: named(facts.counts, count) },
    ...(seconds.length > 1 ? [{ title: "Seconds by phase", rows: seconds }] : []),
    { title: "Settings", rows: named(facts.settings, (v) => v || "default") },
    { title: "Model", rows: model.filter(Boolean) },
  ];
}

function factTable({ title, rows, head }) {
  const cell = (text) => tableCell(text, { className: DIGITS.test(text) ? "digits" : "" });
  const body = rows.map(([name, ...values]) => tableRow(make("th", { scope: "row" }, name), ...values.map(cell)));
  const table = make("table", {}, make("tbody", {}, ...body));
  if (head) table.prepend(make("thead", {}, tableRow(...head.map((text) => make("th", { scope: "col" }, text)))));
  return make("div", {}, make("h3", {}, title), table);
}

/** The tables, parts of the model that were skipped, and warnings. */
export function showNumbers(facts) {
  const { skipped, skippedCount } = facts;
  $("numbers").append(...factTables(facts).map(factTable));
  if (skippedCount) {
    const more = skippedCount > skipped.length ? `, the first ${skipped.length}` : "";
    const summary = make("summary", {}, `Skipped parts of the model (${count(skippedCount)}${more})`);
    const table = factTable({ title: "", rows: skipped.map(({ what, why }) => [what, why]) });
    $("numbers").append(make("div", {}, make("details", {}, summary, table)));
  }
  // What the reader must know first stands at the top of the page.
  $("warnings").append(...facts.warnings.map((text) => paragraph("notice", `Warning: ${text}`)));
}
