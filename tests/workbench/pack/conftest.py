import shutil

import pytest
from builders.packed_house import packed_scene
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.pack.run import pack


@pytest.fixture(scope="session", params=["auto", "0"], ids=["turned back", "prisms"])
def made(request, tmp_path_factory):
    """A bake with mirrors, shears and colours, turned back and as it stands: then its view cells are prisms."""
    out = tmp_path_factory.mktemp("packed") / "house.bake"
    return bake(packed_scene(), out, settings=Settings(yaw=request.param, lods=True), threads=1)


@pytest.fixture(scope="session")
def packed(made):
    return pack(made)


@pytest.fixture
def copy(packed, made, tmp_path):
    """The pack beside its bake, to spoil."""
    shutil.copytree(packed.folder, tmp_path / "house.walk")
    shutil.copytree(made.folder, tmp_path / "house.bake")
    return tmp_path / "house.walk"
