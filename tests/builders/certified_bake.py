"""A certified bake of a few solids, and ways to tamper with its tables."""

import shutil

import pyarrow as pa
import pyarrow.parquet as pq
import trimesh
from viewcell.data.scene import GRID_M, Role
from viewcell.verify.proofs.line_tree import check_certificates
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.baked import load

from builders import random_solids


def make_honest(folder):
    """A bake in which a wall along an axis and a turned one hide a chair, a post of many pieces, and a pane."""
    turned = trimesh.creation.box([0.2, 5, 4])
    # It leans, too: no upright rectangle lies in it, and what it hides is proved by shafts.
    turned.apply_transform(trimesh.transformations.rotation_matrix(0.2, [0, 1, 0]))
    turned.apply_transform(trimesh.transformations.rotation_matrix(0.6, [0, 0, 1]))
    turned.apply_translation([-3, 2, 2])
    meshes = [
        random_solids.box([2, -1, 0], [2.2, 5, 4]),
        turned,
        random_solids.box([3, 1.5, 0], [3.5, 2, 0.5]),
        random_solids.box([-5.5, 1.5, 0.5], [-5, 2, 1.5]),
        trimesh.creation.cylinder(0.1, segment=[[3, 0, 1], [5, 4, 2.5]], sections=5),
        random_solids.box([1, 3.5, 0], [1.1, 4.5, 1]),
        # Two half walls hide this one together.
        random_solids.box([0.45, -4, 0], [2.5, -3.9, 4]),
        random_solids.box([-2, -4.5, 0], [0.55, -4.4, 4]),
        random_solids.box([0, -6, 1], [0.6, -5.8, 1.2]),
    ]
    roles = [Role.OCCLUDER, Role.OCCLUDER, Role.DETAIL, Role.DETAIL, Role.DETAIL, Role.TRANSPARENT]
    roles += [Role.OCCLUDER, Role.OCCLUDER, Role.DETAIL]
    cells = folder / "cells.csv"
    cells.write_text("min_x,min_y,min_z,max_x,max_y,max_z\n0.5,1,1,1.5,2,2\n-1,1.5,1.5,-0.5,2,2\n")
    settings = Settings(method="occluders", cells=str(cells), certify=True)
    scene = random_solids.scene_of_meshes(meshes, roles)
    return bake(scene, folder / "honest.bake", settings=settings, threads=1).folder


def tamper(honest, folder, **changes):
    """What a check finds after a change of the rows of some tables."""
    shutil.copytree(honest, folder)
    for name, change in changes.items():
        table = pq.read_table(folder / f"{name}.parquet")
        rows = change(table.to_pylist())
        pq.write_table(pa.Table.from_pylist(rows, schema=table.schema), folder / f"{name}.parquet")
    return check_certificates(load(folder))


def with_value(row, **values):
    """A change of one row of a table."""

    def change(rows):
        rows[row] |= {name: value(rows[row][name]) for name, value in values.items()}
        return rows

    return change


def number_of(honest, name, wanted):
    """The first row of a table that is as wanted."""
    rows = pq.read_table(honest / f"{name}.parquet").to_pylist()
    return next(number for number, row in enumerate(rows) if wanted(row))


def step(value):
    """A coordinate moved by a grid step."""
    return value + GRID_M
