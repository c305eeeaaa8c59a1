"""The awkward model files beside the repository, and what every one of them should be: a house of twelve boxes."""

import numpy as np
import pytest
from viewcell.data.scene import Scene

from .places import SHARED

IFC_CASES = SHARED / "cases" / "readers" / "ifc"
IFC_MODELS = SHARED / "scenes" / "ifc"
GBXML_MODELS = SHARED / "scenes" / "gbxml"
HOUSE = {
    "floor": ((0, 0, -0.25), (8, 4, 0)),
    "roof": ((0, 0, 3), (8, 4, 3.25)),
    "wall south": ((0, -0.25, -0.25), (8, 0, 3.25)),
    "wall north": ((0, 4, -0.25), (8, 4.25, 3.25)),
    "wall west": ((-0.25, -0.25, -0.25), (0, 4.25, 3.25)),
    "wall east": ((8, -0.25, -0.25), (8.25, 4.25, 3.25)),
    "mid low": ((3.75, 0, 0), (4, 0.5, 3)),
    "mid high": ((3.75, 1.5, 0), (4, 4, 3)),
    "mid lintel": ((3.75, 0.5, 2), (4, 1.5, 3)),
    "box a": ((0.5, 3, 0), (1, 3.5, 1)),
    "box b": ((4.5, 3, 0), (5, 3.5, 1)),
    "box c": ((7, 0.5, 0), (7.5, 1, 1)),
}


def ifc_case(name: str):
    """Path of a case; the test is skipped where the folder is missing."""
    if not IFC_CASES.exists():
        pytest.skip(f"{IFC_CASES} is missing")
    return IFC_CASES / f"{name}.ifc"


def boxes(scene: Scene) -> dict[str, np.ndarray]:
    """Box of each object by its name [m], in the file's own frame."""
    bounds = scene.object_bounds() * scene.grid_m + scene.origin
    return {placed.name: box for placed, box in zip(scene.objects, bounds, strict=True)}


def assert_house(scene: Scene, but: tuple[str, ...] = (), shift: tuple = (0, 0, 0)) -> None:
    """The scene has the boxes of the house, but for some."""
    found = boxes(scene)
    wanted = {name: box for name, box in HOUSE.items() if name not in but}
    assert wanted.keys() <= found.keys()
    for name, box in wanted.items():
        np.testing.assert_allclose(found[name], np.array(box) + shift, atol=2 * scene.grid_m, err_msg=name)
