"""Settings beside the ones a bake would be made with, one knob turned at a time."""

from collections.abc import Collection
from dataclasses import replace

from ...data.errors import InputError
from ..bake.cells import Sources
from ..bake.settings import Settings

# What a user types for a setting.
OPTIONS = {
    "method": "--method",
    "cells": "--cells",
    "threshold_m2": "--threshold",
    "refine_kept": "--refine-kept",
    "largest_cell": "--largest-cell",
    "cell_size_m": "--cell-size",
    "depth": "--depth",
}
# Values of the knobs of portal cells; sides of an octree's cells are taken so many times.
THRESHOLDS_M2, REFINE_KEPT, LARGEST_M = (1.0, 4.0), 1.5, 4.0
SIZES = (0.5, 2.0)


def neighbours(base: Settings, asked: Collection[str], sources: Sources) -> list[dict[str, object]]:
    """Changes of the settings that are worth a try, each a few settings by name.

    Args:
        base: the settings that they are beside.
        asked: names of settings that the user has chosen: these are not changed.
        sources: the cells that `base` came to.
    """
    methods = [{"method": name} for name in ("auto", "portals", "both")]
    if sources.octree:
        tried = [{"method": "both", "cells": "octree"}]
        tried += [{"cell_size_m": base.cell_size_m * size} for size in SIZES]
        tried += [{"depth": base.depth + more} for more in (-1, 1)]
    elif sources.view_cells:
        tried = methods[1:]
    else:
        tried = methods + [{"threshold_m2": area} for area in THRESHOLDS_M2]
        tried += [{"refine_kept": REFINE_KEPT}, {"largest_cell": LARGEST_M}]
        tried += [{"method": "occluders", "cells": "octree"}]
    return [changes for changes in tried if not set(changes) & set(asked) and _differs(base, changes)]


def words(changes: dict[str, object]) -> str:
    """Changes as a user types them."""
    return " ".join(f"{OPTIONS[name]} {value:g}" if isinstance(value, float) else f"{OPTIONS[name]} {value}"
                    for name, value in changes.items())  # fmt: skip


def _differs(base: Settings, changes: dict[str, object]) -> bool:
    """Whether settings with these changes are other ones, and allowed."""
    changed = replace(base, **changes)
    try:
        changed.check()
    except InputError:
        return False
    return changed != base
