"""viewcell: from-region visibility for buildings, with a proof on both sides of every answer.

Names are imported on first use: Warp and JAX take seconds to import and `viewcell --help` must not.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from .data.version import __version__ as __version__

if TYPE_CHECKING:
    # What editors and type checkers see; a test holds it to _HOME.
    from .data.buildings.office import make_office
    from .data.errors import InputError
    from .data.readers import read
    from .data.scene import Scene
    from .data.verdict import Verdict
    from .workbench.bake.run import bake
    from .workbench.bake.settings import Settings
    from .workbench.baked import Bake, load
    from .workbench.check.run import assert_conservative, check
    from .workbench.inspect.run import inspect
    from .workbench.pack.run import pack
    from .workbench.report.run import report
    from .workbench.view.run import view
    from .workbench.walk.run import walk

_HOME = {
    "Bake": "viewcell.workbench.baked",
    "InputError": "viewcell.data.errors",
    "Scene": "viewcell.data.scene",
    "Settings": "viewcell.workbench.bake.settings",
    "Verdict": "viewcell.data.verdict",
    "assert_conservative": "viewcell.workbench.check.run",
    "bake": "viewcell.workbench.bake.run",
    "check": "viewcell.workbench.check.run",
    "inspect": "viewcell.workbench.inspect.run",
    "load": "viewcell.workbench.baked",
    "make_office": "viewcell.data.buildings.office",
    "pack": "viewcell.workbench.pack.run",
    "read": "viewcell.data.readers",
    "report": "viewcell.workbench.report.run",
    "view": "viewcell.workbench.view.run",
    "walk": "viewcell.workbench.walk.run",
}

__all__ = [
    "Bake",
    "InputError",
    "Scene",
    "Settings",
    "Verdict",
    "assert_conservative",
    "bake",
    "check",
    "inspect",
    "load",
    "make_office",
    "pack",
    "read",
    "report",
    "view",
    "walk",
]


def __getattr__(name: str) -> object:
    """Import a public name where it lives, the first time it is asked for (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module 'viewcell' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
