"""pytest plugin, active wherever viewcell is installed: a `scene` to test against, and `assert_conservative`.

    def test_my_pvs(scene, assert_conservative):
        assert_conservative("pvs.parquet", scene, cells="cells.csv")

`--viewcell-model FILE`, or `viewcell_model` in pytest's configuration, names the model; without it the scene is a
small office. Heavy modules are imported when a test asks for them.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from ..data.scene import Scene

OFFICE = {"floors": 1, "rooms_per_side": 2}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that names a model."""
    text = "model that the fixture `scene` reads; a small office by default"
    parser.getgroup("viewcell").addoption("--viewcell-model", metavar="FILE", help=text)
    parser.addini("viewcell_model", text)


@pytest.fixture(scope="session")
def scene(request: pytest.FixtureRequest) -> "Scene":
    """The model that `--viewcell-model` or `viewcell_model` names, relative to pytest's root; else a small office."""
    option, ini = request.config.getoption("--viewcell-model"), request.config.getini("viewcell_model")
    if not (option or ini):
        from ..data.buildings.office import make_office

        return make_office(**OFFICE)
    from ..data.readers import read

    return read(option or request.config.rootpath / ini)


@pytest.fixture(scope="session")
def assert_conservative() -> Callable[..., object]:
    """`viewcell.assert_conservative`: fails where potentially visible sets hide what is visible."""
    from .check.run import assert_conservative

    return assert_conservative
