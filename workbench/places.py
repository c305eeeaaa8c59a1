"""What users mean by a place to look from: a view cell, a room by any of its names, or a point of the model."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ..data.errors import InputError

if TYPE_CHECKING:
    from ..data.store.bake_folder import BakeFolder

# A cell's id; a room's or a cell's name, a room's long name or GUID; or x, y, z in the model's own metres.
Place: TypeAlias = int | str | Sequence[float]
# Names that are told when one is not found.
SHOWN = 5


def cells_at(bake: "BakeFolder", place: Place) -> np.ndarray:
    """Inhabitable view cells of a place, ascending, shape (n,), int64, at least one.

    Raises:
        InputError: there is no such cell, no room or cell of that name, or the point is in no view cell.
    """
    if isinstance(place, str):
        return _named(bake, place)
    if isinstance(place, int | np.integer) and not isinstance(place, bool):
        if not (0 <= place < bake.graph.cell_count and bake.graph.inhabitable[place]):
            raise InputError(f"cell: expected the id of an inhabitable cell, found {place}")
        return np.array([place], np.int64)
    return np.array([cell_at(bake, place)], np.int64)


def cell_at(bake: "BakeFolder", point: Sequence[float]) -> int:
    """The inhabitable view cell that holds a point, the smallest if several do.

    Args:
        bake: the bake.
        point: x, y, z in the model's own metres.

    Raises:
        InputError: it is no point, or in no inhabitable view cell.
    """
    try:
        own = np.asarray(point, np.float64)
    except (TypeError, ValueError):
        own = np.zeros(0)
    if own.shape != (3,) or not np.isfinite(own).all():
        raise InputError(f"point: expected x, y and z in metres, found {_short(point)}")
    graph, steps = bake.graph, bake.in_bake(own) / bake.grid_m
    cells = np.flatnonzero(graph.inhabitable)
    boxes = graph.cells[cells].astype(float)
    beyond = np.maximum(boxes[:, 0] - steps, steps - boxes[:, 1]).clip(min=0)
    held = ~beyond.any(axis=1)
    held &= graph.plans.hold(cells, np.repeat(steps[None], len(cells), axis=0), graph.cell_count)
    if not held.any():
        where = ", ".join(f"{c:g}" for c in own)
        raise InputError(
            f"point: expected a point in an inhabitable view cell, found ({where}){_nearest(bake, beyond, cells)}"
        )
    sizes = (boxes[:, 1] - boxes[:, 0]).prod(axis=1)
    return int(cells[held][sizes[held].argmin()])


def _nearest(bake: "BakeFolder", beyond: np.ndarray, cells: np.ndarray) -> str:
    """How far the nearest cell's box is, in words."""
    if not len(cells):
        return ""
    away = np.linalg.norm(beyond, axis=1) * bake.grid_m
    best = int(away.argmin())
    return f"; the nearest is cell {bake.cell_text(int(cells[best]))}, {away[best]:.3g} m away" if away[best] else ""


def _named(bake: "BakeFolder", name: str) -> np.ndarray:
    graph = bake.graph
    found = {int(cell) for cell in np.flatnonzero([str(own) == name for own in graph.cell_names])}
    known = {str(own) for own in graph.cell_names[graph.inhabitable] if own}
    for room in bake.rooms.to_pylist():
        words = {room["name"], room["long_name"], room["guid"]} - {None, ""}
        known |= {room["name"]} - {None, ""}
        if name in words:
            found |= set(room["cells"])
    cells = np.array(sorted(cell for cell in found if graph.inhabitable[cell]), np.int64)
    if not len(cells):
        some = ", ".join(sorted(known)[:SHOWN]) + (f" and {len(known) - SHOWN} more" if len(known) > SHOWN else "")
        expected = (
            f"the name of a room with view cells ({some})" if known else "a cell's id or a point: nothing is named"
        )
        raise InputError(f"room: expected {expected}, found {name!r}")
    return cells


def object_at(bake: "BakeFolder", wanted: int | str) -> int:
    """The object of an id, a GUID, or a name that only one bears.

    Raises:
        InputError: there is none, or there are several.
    """
    objects = [] if bake.scene is None else bake.scene.objects
    if isinstance(wanted, str):
        found = [k for k, placed in enumerate(objects) if placed.guid == wanted] or [
            k for k, placed in enumerate(objects) if placed.name == wanted
        ]
        if len(found) != 1:
            told = "none" if not found else f"{len(found)} of them"
            raise InputError(f"object: expected the name or GUID of one object, found {told}: {wanted!r}")
        return found[0]
    if isinstance(wanted, bool) or not isinstance(wanted, int | np.integer) or not 0 <= wanted < len(objects):
        raise InputError(
            f"object: expected an id from 0 to {len(objects) - 1}, a name or a GUID, found {_short(wanted)}"
        )
    return int(wanted)


def _short(value: object) -> str:
    """What was found, on a line and not a scene's whole self."""
    text = repr(value).split("\n")[0]
    return text if len(text) <= 60 else f"{text[:57]}..."
