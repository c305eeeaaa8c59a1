import shutil

import pytest
import viewcell
from viewcell.workbench.pack.run import pack


@pytest.fixture(scope="session")
def office(tmp_path_factory):
    """A small office, flattened: its items are large enough for a cache to be too small."""
    folder = tmp_path_factory.mktemp("walked")
    scene = viewcell.make_office(floors=1, rooms_per_side=2)
    return pack(viewcell.bake(scene, folder / "office.bake", lods=True), flatten=True)


@pytest.fixture
def copy(office, tmp_path):
    """The database beside its bake, to spoil."""
    for name in ("office.walk", "office.bake"):
        shutil.copytree(office.folder.with_name(name), tmp_path / name)
    return tmp_path / "office.walk"
