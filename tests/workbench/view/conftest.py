import pytest
from builders.places import ROOT
from viewcell.data.buildings.office import make_office
from viewcell.workbench.bake.run import bake
from viewcell.workbench.pack.run import pack

SCRIPT = ROOT / "workbench" / "view" / "page" / "build" / "viewer.js"


@pytest.fixture(scope="session")
def office(tmp_path_factory):
    """A storey of an office, baked."""
    out = tmp_path_factory.mktemp("office") / "office.bake"
    return bake(make_office(floors=1, rooms_per_side=3), out, threads=1)


@pytest.fixture(scope="session")
def walk(office):
    return pack(office)


@pytest.fixture(scope="session")
def built():
    """The viewer's script is there."""
    if not SCRIPT.is_file():
        pytest.skip("the viewer's script is not built: make install does it, with npm")
