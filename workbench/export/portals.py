"""Cells and portals as a portal file, for a Quake-family vis."""

import tempfile
from pathlib import Path

from ...data.errors import InputError
from ...data.store.bake_folder import BakeFolder
from ...data.store.quake import write_prt


def portals_as_prt(bake: BakeFolder) -> bytes:
    """A portal file PRT1: the cells that tile space as leaves, in order, and the portals between them.

    View cells that stand at an angle come after them in a bake, have no portals, and are no leaves.

    Raises:
        InputError: it has no portals, or more, or further away, than the format holds.
    """
    if not bake.graph.portal_count:
        raise InputError(f"{bake.folder}: expected a bake with portals, found none between its cells")
    with tempfile.TemporaryDirectory() as scratch:
        write_prt(bake.graph.tiles, Path(scratch) / "map.prt")
        return (Path(scratch) / "map.prt").read_bytes()
