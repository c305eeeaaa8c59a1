"""Inspect a model: everything that tells whether it is fit to bake."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...data.carving import find_faces
from ...data.errors import InputError
from ...data.plausible import warned
from ...data.prepared import PreparedModel
from ...data.scene import Scene
from .cells import find_cells
from .inspection import Inspection
from .surfaces import find_directions, find_surfaces
from .words import lines, warnings

if TYPE_CHECKING:
    from collections.abc import Mapping

# A part is astray if it is so many times as far from the middle of all as three in four of them are.
STRAY_TIMES, STRAY_M = 10.0, 100.0
# Formats that state their unit; the rest is taken at its word, or for metres.
STATES_UNIT = {".ifc": "as the file says", ".ifczip": "as the file says", ".xml": "as the file says"}
STATES_UNIT |= {".glb": "as glTF always is", ".gltf": "as glTF always is", ".dxf": "as the file says"}


def inspect(
    model: Scene | str | Path, *, referee: bool = False, estimate: bool = True, **reading: object
) -> Inspection:
    """Look through a model before it is baked.

    Args:
        model: a scene, or a path as `read` takes it.
        referee: read the file a second time, by another way, and compare.
        estimate: bake a few cells to tell how long all of them take.
        reading: options of `read`.

    Returns:
        What was found. Nothing is repaired or written.

    Raises:
        InputError: the model is unreadable, or there is no second reader for its format.
    """
    scene = warned(_scene(model, reading))
    prepared = PreparedModel(scene)
    found = Inspection(
        scene=scene,
        unit_because=_unit_because(model, reading),
        size_m=np.diff(scene.bounds(), axis=0)[0] * scene.grid_m,
        kinds=Counter((placed.kind or "object", placed.role) for placed in scene.objects),
        told=Counter(_told(placed.why, placed.kind) for placed in scene.objects if placed.why),
        stray=_stray(scene),
        surfaces=find_surfaces(prepared),
        directions=find_directions(scene),
        faces=find_faces(scene),
        cells=find_cells(prepared, **({} if estimate else {"tried": 0})),
    )
    if referee:
        found.differences = _differences(model, scene, reading)
    found.warnings = warnings(found)
    found.lines = lines(found)
    return found


def _scene(model: Scene | str | Path, reading: "Mapping[str, object]") -> Scene:
    # As a bake takes it.
    reading = {"yaw": "auto"} | dict(reading)
    if isinstance(model, Scene):
        from ...data.frame import in_frame

        return in_frame(model, reading["yaw"])
    from ...data.readers import read

    return read(model, **reading)


def _unit_because(model: Scene | str | Path, reading: "Mapping[str, object]") -> str:
    if reading.get("unit") is not None:
        return "as asked"
    if isinstance(model, Scene) or Path(model).is_dir():
        return "scenes are in metres"
    return STATES_UNIT.get(Path(model).suffix.lower(), "assumed: the format does not say")


def _told(why: str, kind: str) -> str:
    """Why, without what differs from part to part of one kind."""
    what, _, rest = why.partition(": ")
    rule = rest.split(" ")[0]
    words = f"the words in their {rule}s" if rule in ("name", "material") else rest
    return f"{'glass' if what == 'glass' else 'door'} by {words}" + ("" if "class" in rest else f" ({kind})")


def _stray(scene: Scene) -> list[tuple[str, float]]:
    """Parts far from the rest, farthest first."""
    boxes = scene.object_bounds()
    there = np.flatnonzero(boxes[:, 0, 0] <= boxes[:, 1, 0])
    middle = boxes[there].mean(axis=1) * scene.grid_m
    away = np.linalg.norm(middle - np.median(middle, axis=0), axis=1)
    far = away > np.maximum(STRAY_M, STRAY_TIMES * np.quantile(away, 0.75))
    order = np.flatnonzero(far)[np.argsort(-away[far], kind="stable")]
    return [(scene.objects[there[i]].name, float(away[i])) for i in order]


def _differences(model: Scene | str | Path, scene: Scene, reading: "Mapping[str, object]") -> list[str]:
    if isinstance(model, Scene) or Path(model).is_dir():
        raise InputError(f"{scene.source or 'scene'}: expected a model file to read a second time, found a scene")
    if reading.get("leave_out"):
        raise InputError(f"{model}: expected the whole file to read a second time, found something left out")
    from ...data.readers.units import metres_per_unit
    from ...verify.readers.second_reader import disagreements

    unit = reading.get("unit")
    metres = None if unit is None else metres_per_unit(unit)[0]
    return disagreements(scene, Path(model), metres=metres, up=reading.get("up"))
