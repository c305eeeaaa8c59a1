import pytest
from builders.exported_house import exported_scene
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings


@pytest.fixture(scope="session", params=["auto", "0"], ids=["turned back", "prisms"])
def house(request, tmp_path_factory):
    """A house at an angle, baked turned back, and as it stands: then its view cells are prisms."""
    out = tmp_path_factory.mktemp("exported") / "house.bake"
    return bake(exported_scene(), out, settings=Settings(yaw=request.param), threads=1)
