"""Sets, view cells, rooms and objects as one JSON file, for scripts and pages."""

import json

from ...data.store.bake_folder import BakeFolder
from ...data.version import __version__
from .sets import ViewSets, view_sets

FORMAT = 1
_COMMA = ",\n"


def sets_as_json(bake: BakeFolder) -> bytes:
    """A JSON text with a line for each object, view cell and room; docs/guides/export.md says what they hold.

    Raises:
        InputError: the bake is of a bare cell graph.
    """
    sets = view_sets(bake)
    head = {
        "format": FORMAT,
        "generator": f"viewcell {__version__}",
        "source": bake.manifest.get("model", {}).get("path", ""),
        "frame": {"unit": "metre", "up": "z", "of": "the model's own coordinates"},
        "outside": "an eye in no view cell: draw everything",
    }
    lists = {"objects": _objects(bake), "cells": _cells(bake, sets), "rooms": _rooms(bake)}
    parts = [_line(head)[1:-1], *(f"{json.dumps(name)}:[\n{_lines(rows)}]" for name, rows in lists.items())]
    return f"{{{_COMMA.join(parts)}}}\n".encode()


def _lines(rows: list[dict]) -> str:
    return _COMMA.join(map(_line, rows)) + "\n" * bool(rows)


def _line(value: dict) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)


def _objects(bake: BakeFolder) -> list[dict]:
    return [
        {"id": number, "name": placed.name, "kind": placed.kind, "role": placed.role.value}
        | ({"guid": placed.guid} if placed.guid else {})
        for number, placed in enumerate(bake.scene.objects)
    ]


def _cells(bake: BakeFolder, sets: ViewSets) -> list[dict]:
    names = bake.graph.cell_names
    return [
        {
            "id": int(cell),
            "name": str(names[cell]),
            "plan": sets.plans[row].tolist(),
            "bottom": float(sets.heights[row, 0]),
            "top": float(sets.heights[row, 1]),
            "potential": sets.of(row).tolist(),
            "unknown": sets.of(row)[sets.unknown[sets.starts[row] : sets.starts[row + 1]]].tolist(),
        }
        for row, cell in enumerate(sets.cells)
    ]


def _rooms(bake: BakeFolder) -> list[dict]:
    told = ("room_id", "name", "long_name", "guid", "storey", "cells")
    rows = [{name: room[name] for name in told if room[name] is not None} for room in bake.rooms.to_pylist()]
    return [{"id": row.pop("room_id")} | row for row in rows]
