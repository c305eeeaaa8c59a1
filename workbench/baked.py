"""A finished bake in the hands of a user: what it holds (data/store/bake_folder.py), and what can be done with it."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..data.store.bake_folder import BakeFolder, read_bake

if TYPE_CHECKING:
    from ..verify.findings import VerifyResult


class Bake(BakeFolder):
    """A finished bake: the model, its cells and portals, and what is visible from where."""

    def verify(self, *, rays: int = 1_000_000, seed: int = 0, progress: bool = False) -> "VerifyResult":
        """Try to refute it with rays, and check every witness exactly; as `workbench.verify.verify_bake`."""
        from .verify import verify_bake

        return verify_bake(self, rays=rays, seed=seed, progress=progress)

    def report(
        self,
        *,
        cells: Sequence[int] | None = None,
        out: str | Path | None = None,
        curves: str | Path | None = None,
    ) -> Path:
        """Write report.md with pictures, and report.html; as `viewcell.report`."""
        from .report.run import report

        return report(self, cells=cells, out=out, curves=curves)


def load(folder: str | Path) -> Bake:
    """Open a bake folder.

    Raises:
        InputError: it is no bake folder, of another format version, incomplete, or its tables contradict each other.
    """
    found = read_bake(folder)
    return Bake(found.folder, found.manifest)
