// The legend of the plan.
import { $, make } from "./dom.mjs";

/** The legend's marks and words for what a plan of this bake shows with cells or objects coloured. */
export function legendItems({ objectCount, objects, portals }, layer) {
  const cells = layer === "cell";
  return [
    ["source", "view cell"],
    ...["seen", "unknown", "hidden"].map((word) => [cells ? word : `line box-${word}`, `${layer} ${word}`]),
    cells && ["none", "no cell"],
    cells && objectCount && ["line wall", "occluder"],
    cells && objectCount && ["line detail", "detail"],
    cells && objects.role.includes(2) && ["line glass", "transparent"],
    portals.axis.length && ["line portal", "portal"],
    ["line sight", "sightline"],
    ["target", "target"],
  ].filter(Boolean);
}

/** The legend, and how the plan was cut. */
export function showLegend({ bake, layer }) {
  const [storey] = bake.storeys,
    cut = bake.metres(storey.level - storey.floor).toFixed(1),
    step = (100 * bake.metres(storey.step)).toFixed(1);
  const item = ([mark, word]) =>
    make("li", {}, make("span", { className: `mark ${mark}`, "aria-hidden": "true" }), word);
  $("legend").replaceChildren(...legendItems(bake, layer).map(item));
  $("plan-note").textContent =
    `The plan is cut ${cut} m above the floor${bake.objectCount ? ` and drawn to ${step} cm` : ""}; dashed cells lie above or below the cut. Sightlines are drawn whole, also where they leave the storey.`;
}
