"""pytest plugin, active wherever viewcell is installed: a `viewcell_scene` to test against, and `assert_conservative`.

    def test_my_pvs(viewcell_scene, assert_conservative):
        assert_conservative("pvs.parquet", viewcell_scene, cells="cells.csv")

`--viewcell-model FILE`, or `viewcell_model` in pytest's configuration, names the model; without it the scene is a
small office. With `viewcell_names = short` there the fixture is called `scene`, too. Heavy modules are imported when a
test asks for them.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ..data.errors import InputError

if TYPE_CHECKING:
    from ..data.scene import Scene

OFFICE = {"floors": 1, "rooms_per_side": 2}
NAMES = ("long", "short")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that names a model."""
    text = "model that the fixture `viewcell_scene` reads; a small office by default"
    parser.getgroup("viewcell").addoption("--viewcell-model", metavar="FILE", help=text)
    parser.addini("viewcell_model", text)
    parser.addini("viewcell_names", "short: `scene` is a fixture, too; long, the default: it is not", default="long")


def pytest_configure(config: pytest.Config) -> None:
    """Add the short name, if it is asked for."""
    names = config.getini("viewcell_names")
    if names not in NAMES:
        raise pytest.UsageError(f"viewcell_names: expected {' or '.join(NAMES)}, found {names!r}")
    if names == "short":
        config.pluginmanager.register(ShortNames())


@pytest.fixture(scope="session")
def viewcell_scene(request: pytest.FixtureRequest) -> "Scene":
    """The model that `--viewcell-model` or `viewcell_model` names, relative to pytest's root; else a small office."""
    option, ini = request.config.getoption("--viewcell-model"), request.config.getini("viewcell_model")
    if not (option or ini):
        from ..data.buildings.office import make_office

        return make_office(**OFFICE)
    from ..data.readers import read

    try:
        return read(option or request.config.rootpath / ini)
    except InputError as error:
        fault = str(error)
    # Outside the handler, or pytest says it twice, the second time as what happened during the first.
    pytest.fail(fault, pytrace=False)


class ShortNames:
    """Fixtures by names that a project may well use for something else."""

    @pytest.fixture(scope="session")
    def scene(self, viewcell_scene: "Scene") -> "Scene":
        """As `viewcell_scene`."""
        return viewcell_scene


@pytest.fixture(scope="session")
def assert_conservative() -> Callable[..., object]:
    """`viewcell.assert_conservative`: fails where potentially visible sets hide what is visible."""
    from .check.run import assert_conservative

    return assert_conservative
