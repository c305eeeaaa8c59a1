import assert from "node:assert/strict";
import test from "node:test";
import { factTables } from "../../../../workbench/report/page/numbers.mjs";

const FACTS = {
  counts: { cell_pairs: 12345 },
  seconds: { flood: 1, back_faces: 0.5 },
  settings: { seal: "0.0", method: "" },
  classes: [["objects", "9", "6", "1.500", "3"]],
  source: "",
  gridMetres: 2 ** -10,
  origin: [1, 2, 3],
  snapMetres: null,
  because: "",
  sha256: "",
  faces: [["axial faces", "9, 75.0 % of their area"]],
  kept: [["objects, mean by volume", "11.1 %"]],
};

test("the manifest's numbers are tables", () => {
  const tables = Object.fromEntries(factTables(FACTS).map(({ title, rows }) => [title, rows]));
  assert.deepEqual(tables, {
    "Seen from all view cells": [["objects", "9", "6", "3", "1.500"]],
    "Kept by a view cell": [["objects, mean by volume", "11.1 %"]],
    "Faces of occluders": [["axial faces", "9, 75.0 % of their area"]],
    Counts: [["cell pairs", "12,345"]],
    "Seconds by phase": [
      ["flood", "1.00"],
      ["back faces", "0.50"],
      ["all phases", "1.50"],
    ],
    Settings: [
      ["seal", "0.0"],
      ["method", "default"],
    ],
    Model: [
      ["source", "unknown"],
      ["grid step", "0.9766 mm"],
      ["origin", "(1, 2, 3) m"],
    ],
  });
  const full = factTables({ ...FACTS, kept: [], faces: [], seconds: {}, snapMetres: 0.0005, because: "rooms", sha256: "ab" });
  assert.deepEqual(
    full.map(({ title }) => title),
    ["Seen from all view cells", "Counts", "Settings", "Model"],
  );
  assert.deepEqual(full[3].rows.slice(3), [
    ["moved by snapping at most", "0.500 mm"],
    ["inhabitable cells", "rooms"],
    ["SHA-256", "ab"],
  ]);
});
