"""A bake of balls around two view cells, from which everything may be seen."""

import numpy as np
import viewcell
from viewcell.data.store.view_cells import write_view_cells
from viewcell.data.store.walk_folder import WalkFolder
from viewcell.workbench.pack.depth import ALL, DepthSettings
from viewcell.workbench.pack.run import pack

from builders.depth_scenes import CELL, balls_scene

# Of 40 balls of 1,280 triangles each: so many that some must be coarse, and some stand on meshes.
TRIANGLES = 1_200
ASIDE = np.array([1024, 0, 0])
CELLS = np.stack([CELL - ASIDE, CELL + ASIDE])


def far_bake(folder, seed=0):
    """Written to a folder."""
    scene = balls_scene(np.random.default_rng(seed))
    write_view_cells(CELLS, scene, folder / "cells.csv")
    return viewcell.bake(scene, folder / "balls.bake", method="occluders", cells=str(folder / "cells.csv"), threads=1)


def far_walk(folder, bake, name="balls.walk", **changes) -> WalkFolder:
    """Packed with depth meshes."""
    return pack(bake, folder / name, depth=DepthSettings(**({"cells": ALL, "triangles": TRIANGLES} | changes)))
