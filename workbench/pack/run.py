"""Pack: a bake in, the display database that a walkthrough reads out."""

import os
from collections.abc import Sequence
from contextlib import closing, suppress
from itertools import chain
from pathlib import Path

import numpy as np

from ...data.errors import InputError
from ...data.progress import phase, shown
from ...data.ragged import owners_of
from ...data.scene import Scene
from ...data.store.bake_folder import BakeFolder, cells_table, portals_table, read_bake
from ...data.store.scene_folder import held_manifest, refuse_others
from ...data.store.walk_folder import KIND, WalkFolder, bake_digest, read_walk, write_walk
from ...data.store.walk_tables import (
    DisplaySets,
    cell_items_table,
    display_sets,
    gather_items,
    geometry,
    items_table,
    objects_table,
    sets_table,
)
from ...data.version import __version__
from ...kernels.launch import Device
from ...solvers.tour import count_runs, tour_order
from ..bake.place import alone
from ..export.sets import model_of
from .depth import DepthItems, DepthSettings, make_depth_meshes

# Of the order that runs are compared with.
RANDOM_SEED = 0


def default_out(bake: BakeFolder) -> Path:
    """Where a pack goes that was not told where: named after the bake, beside it."""
    folder = Path(bake.folder).resolve()
    return folder.with_name(f"{folder.stem}.walk")


def pack(
    bake: BakeFolder | str | Path,
    out: str | Path | None = None,
    *,
    flatten: bool = False,
    depth: DepthSettings | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> WalkFolder:
    """Write the display database that a walkthrough reads: sets as runs, objects in an order in which these are few.

    Args:
        bake: the bake of a model, or its folder.
        out: folder to write; by default the bake's name with .walk, beside it.
        flatten: give every object a copy of its shape, in the scene's frame; else objects share their definitions'.
        depth: which view cells get textured depth meshes of what is far; None for none.
        overwrite: replace a display database of another bake, too. One of this bake is taken as it is if it is up to
            date, and else replaced.
        progress: show how far it is on stderr.

    Returns:
        The display database.

    Raises:
        InputError: the bake is unreadable or has no objects, or the place cannot be written or holds something else;
            nothing is written or lost.

    Source: Funkhouser et al. 1996, section 2.2; Chhugani et al. 2005, section 6.
    """
    made = bake if isinstance(bake, BakeFolder) else read_bake(bake)
    scene = model_of(made)
    out = Path(out) if out is not None else default_out(made)
    refuse_others(out, KIND)
    with shown(progress), alone(out, "display database"):
        facts = _facts(made, out, flatten) | {"depth_meshes": None if depth is None else depth.facts}
        held = held_manifest(out, KIND)
        if held is not None and not overwrite:
            if all(held.get(name) == value for name, value in facts.items()):
                # What is damaged is packed anew.
                with suppress(InputError):
                    return read_walk(out)
            if held.get("bake", {}).get("path") != facts["bake"]["path"]:
                raise InputError(
                    f"{out}: expected a display database of this bake, found one of {held['bake']['path']}; "
                    "--overwrite (overwrite=True) replaces it, another --out keeps both"
                )
        return _write(made, scene, out, facts, depth)


def _facts(bake: BakeFolder, out: Path, flatten: bool) -> dict:
    """What the manifest says of where it all comes from, and what tells an up-to-date pack."""
    folder = Path(bake.folder).absolute()
    return {
        "viewcell": __version__,
        "bake": {
            "path": Path(os.path.relpath(folder, out.absolute().parent)).as_posix(),
            "sha256": bake_digest(folder),
        },
        "grid_m": bake.grid_m,
        "origin": bake.origin.tolist(),
        "yaw_deg": bake.yaw_deg,
        "flattened": flatten,
    }


def _write(bake: BakeFolder, scene: Scene, out: Path, facts: dict, depth: DepthSettings | None) -> WalkFolder:
    """Find the orders, make the tables, write them."""
    graph, device = bake.graph, Device.wanted("cpu")
    with phase("pack", 3, "step") as bar:
        cells, made = np.flatnonzero(graph.inhabitable), np.arange(len(scene.objects))
        sets = display_sets(bake, cells, made)
        order = tour_order(sets.starts, sets.members, _middles(scene.object_bounds()), device)
        bar.update()
        cell_sets, cell_order = _cells_in_order(bake, cells, device)
        bar.update()
        runs = _runs_told(sets, order)
        sets, items = display_sets(bake, cells, order), gather_items(scene, order, facts["flattened"])
        bar.update()
    with closing(DepthItems(int(items.offsets[-1]))) as far:
        if depth is not None:
            make_depth_meshes(far, bake, scene, sets, order, depth)
        tables = {
            "objects": objects_table(scene, order, items, facts["flattened"]),
            "items": items_table(items),
            "sets": sets_table(sets, items, order, cell_sets),
            "cell_items": cell_items_table(sets),
            "cells": cells_table(graph, bake.grid_m).take(cell_order),
            "portals": portals_table(graph, bake.grid_m),
            "depth_meshes": far.table,
        }
        counts = {
            "objects": len(scene.objects),
            "definitions": len(scene.definitions),
            "items": len(items.meshes),
            "cells": graph.cell_count,
            "view_cells": len(cells),
            "portals": graph.portal_count,
            "potential": len(sets.members),
            "unknown": int(sets.unknown.sum()),
            "depth_meshes": tables["depth_meshes"].num_rows,
        }
        facts = facts | {"counts": counts, "order": runs}
        written = write_walk(out, facts, tables, chain(geometry(items), far.geometry()))
    return WalkFolder(out, written)


def _middles(boxes: np.ndarray) -> np.ndarray:
    return boxes.sum(axis=1) / 2


def _cells_in_order(bake: BakeFolder, cells: np.ndarray, device: Device) -> tuple[tuple | None, np.ndarray]:
    """Sets of cells in an order in which they are few runs, or None where nothing is claimed; and that order."""
    graph = bake.graph
    if not bake.claims_cells:
        return None, np.arange(graph.cell_count)
    starts, members = bake.cell_sets.lists(cells)
    order = tour_order(starts, members, _middles(graph.cells.astype(np.int64)), device)
    placed = np.empty(len(order), np.int64)
    placed[order] = np.arange(len(order))
    members = placed[members]
    return (starts, members[np.lexsort((members, owners_of(starts)))]), order


def _runs_told(sets: DisplaySets, order: np.ndarray) -> dict:
    """Runs of the sets in the order, as made and at random; `sets` has objects as made."""
    count = len(order)
    orders: dict[str, Sequence] = {
        "runs": order,
        "runs_as_made": np.arange(count),
        "runs_at_random": np.random.default_rng(RANDOM_SEED).permutation(count),
    }
    found = {name: count_runs(sets.starts, sets.members, np.asarray(one)) for name, one in orders.items()}
    return {"method": "tour of Hamming distances, 2-opt and Or-opt", **found}
