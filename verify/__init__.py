"""Truth: exact twins, Embree sampling, certificates, and the check of a bake: `viewcell.verify(bake)`."""

import sys
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..data.store.database import Bake
    from .findings import VerifyResult


class _CallableModule(ModuleType):
    """Python binds a subpackage to its parent's name as soon as it is imported, hiding the function of that name."""

    def __call__(self, bake: "Bake", **options: object) -> "VerifyResult":
        """Try to refute a bake: `workbench.verify.verify`, which takes the same options."""
        from ..workbench.verify import verify

        return verify(bake, **options)


sys.modules[__name__].__class__ = _CallableModule
