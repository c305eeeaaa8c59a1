"""The awkward model files beside the repository, and what every one of them should be: a house of twelve boxes."""

import numpy as np
import pytest
from viewcell.data.scene import Scene

from .model_files import HOUSE
from .places import SHARED

IFC_CASES = SHARED / "cases" / "readers" / "ifc"
IFC_MODELS = SHARED / "scenes" / "ifc"
GBXML_MODELS = SHARED / "scenes" / "gbxml"


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
