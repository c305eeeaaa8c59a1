"""Whether a model's sizes are those of a building: a wrong unit, or a wrong axis up, shows in what people fit into."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .progress import LOG
from .readers.units import METRES
from .scene import OPAQUE, Scene

# Formats whose numbers are taken for metres, and z for up, unless told otherwise.
STATES_NOTHING = (".obj", ".ply", ".stl")
# Heights [m] that people build, and the usual one, of what is measured, best evidence first.
ROOM, DOOR, STOREY = "rooms", "doors", "storeys"
USUAL = {ROOM: (1.6, 25.0, 2.8), DOOR: (1.2, 9.0, 2.1), STOREY: (1.6, 45.0, 3.0)}
# Longest side [m] of what nothing else is known of.
SHORTEST_M, LONGEST_M = 0.5, 5000.0
# A level is a height at which so much of the model's plan is horizontal.
LEVEL_SHARE = 0.2
# Lying on its side: a building that is so much lower along y than otherwise, or so many doors longest along y.
LYING_SHARE, DOORS_SHARE = 0.5, 0.5
FEW = 3


@dataclass(frozen=True)
class Implausible:
    """What cannot be of a building that is read right, and which option reads it otherwise."""

    what: str
    do: str

    def line(self) -> str:
        """Both, in a line."""
        return f"as it is read, {self.what}; {self.do}"


def implausible(scene: Scene) -> list[Implausible]:
    """What is wrong with the sizes of a model as it was read from a file; empty where nothing is."""
    if not scene.source:
        return []
    # A model on its side has no heights to judge its unit by.
    return _axis(scene) or _unit(scene)


def warned(scene: Scene) -> Scene:
    """The scene itself; says in the log at once what is implausible of it, as what follows may take hours in vain."""
    for fault in implausible(scene):
        LOG.warning("warning: %s", fault.line())
    return scene


def _unit(scene: Scene) -> list[Implausible]:
    for what, heights in ((ROOM, _rooms), (DOOR, _doors), (STOREY, _storeys)):
        height = heights(scene)
        if height is not None:
            low, high, usual = USUAL[what]
            if low <= height <= high:
                return []
            return [Implausible(f"its {what} are {metres(height)} m high", _tell(scene, usual / height))]
    size = np.diff(scene.bounds(), axis=0)[0].max() * scene.grid_m
    if SHORTEST_M <= size <= LONGEST_M:
        return []
    # A building, or a part of one.
    return [Implausible(f"it is {metres(size)} m long", _tell(scene, 20.0 / size))]


def _tell(scene: Scene, wanted: float) -> str:
    """What to say of the unit, if lengths should be so many times as long."""
    now = METRES.get(scene.unit, 1.0)
    nearest = min(METRES, key=lambda name: abs(np.log(METRES[name] / now / wanted)))
    if Path(scene.source).suffix.lower() in STATES_NOTHING:
        return f"if its numbers are no {scene.unit}s: --unit {nearest}"
    return f"the file says {scene.unit}; --unit {nearest} would fit, for a mesh file"


def _axis(scene: Scene) -> list[Implausible]:
    size = np.diff(scene.bounds(), axis=0)[0]
    doors = _door_sizes(scene)
    lying = len(doors) >= FEW and ((doors[:, 1] > doors[:, 2]) & (doors[:, 1] > doors[:, 0])).mean() > DOORS_SHARE
    if lying:
        return [Implausible("its doors are longest along y", "if y points up in the file: --up y")]
    states = Path(scene.source).suffix.lower() not in STATES_NOTHING
    if not states and not len(doors) and not scene.spaces and size[1] < LYING_SHARE * min(size[0], size[2]):
        return [Implausible("it is lowest along y", "if y points up in the file: --up y")]
    return []


def _rooms(scene: Scene) -> float | None:
    heights = [np.ptp(space.vertices[:, 2]) for space in scene.spaces]
    return float(np.median(heights)) if heights else None


def _door_sizes(scene: Scene) -> np.ndarray:
    """Extents of doors [m], shape (n, 3)."""
    rows = [i for i, placed in enumerate(scene.objects) if placed.kind.lower() in ("door", "ifcdoor")]
    boxes = scene.object_bounds()[rows]
    return (boxes[:, 1] - boxes[:, 0])[boxes[:, 1, 0] >= boxes[:, 0, 0]] * scene.grid_m


def _doors(scene: Scene) -> float | None:
    sizes = _door_sizes(scene)
    return float(np.median(sizes[:, 2])) if len(sizes) >= FEW else None


def _storeys(scene: Scene) -> float | None:
    """The largest height between levels that follow each other, if there are several."""
    triangles, _ = scene.triangles(*OPAQUE)
    if not len(triangles):
        return None
    level = triangles[np.ptp(triangles[:, :, 2], axis=1) == 0].astype(float)
    a, b = level[:, 1, :2] - level[:, 0, :2], level[:, 2, :2] - level[:, 0, :2]
    area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    heights, where = np.unique(level[:, 0, 2], return_inverse=True)
    plan = np.diff(scene.bounds(), axis=0)[0, :2].astype(float).prod()
    heights = heights[np.bincount(where, area, minlength=len(heights)) > LEVEL_SHARE * plan]
    return float(np.diff(heights).max() * scene.grid_m) if len(heights) >= FEW else None


def metres(length: float) -> str:
    """A length as people say it."""
    return f"{length:,.0f}" if length >= 10.0 else f"{length:.2g}"
