"""Cell graphs whose truth is known without a search, and large ones that a search has to work on."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from viewcell.data.buildings.office import make_office
from viewcell.data.graph import CellGraph
from viewcell.data.prepared import PreparedModel
from viewcell.data.scene import GRID_M
from viewcell.data.store.bake_folder import cells_table, portals_table
from viewcell.workbench.bake.cells import model_sources
from viewcell.workbench.bake.manifest import Clock
from viewcell.workbench.bake.settings import Settings

from builders.places import SHARED


def corridor(count: int, step: int = 64) -> CellGraph:
    """A straight open corridor cut into cells along x: all of them see each other."""
    x = step * np.arange(count + 1) - step * (count // 2)
    cells = np.zeros((count, 2, 3), np.int32)
    cells[:, 0, 0], cells[:, 1, 0], cells[:, 1, 1:] = x[:-1], x[1:], 128
    portals = np.zeros((count - 1, 2, 3), np.int32)
    portals[:, :, 0], portals[:, 1, 1:] = x[1:-1, None], 128
    pairs = np.stack([np.arange(count - 1), np.arange(1, count)], axis=1).astype(np.int32)
    names = np.full(count, "", object)
    return CellGraph(cells, np.ones(count, bool), names, pairs, np.zeros(count - 1, np.int8), portals)


def office_graph(floors: int = 1, rooms_per_side: int = 3, **options: object) -> CellGraph:
    """Cells of a made office, which tile space."""
    scene = make_office(floors=floors, rooms_per_side=rooms_per_side, **options)
    return model_sources(PreparedModel(scene), Settings(), Clock()).graph.tiles


def write_graph(graph: CellGraph, folder: Path) -> Path:
    """A folder with cells.parquet and portals.parquet."""
    folder.mkdir(parents=True)
    pq.write_table(cells_table(graph, GRID_M), folder / "cells.parquet")
    pq.write_table(portals_table(graph, GRID_M), folder / "portals.parquet")
    return folder


def graph_folder(name: str, folder: Path) -> Path:
    """A folder with the graph "office", made there, or with one of the shared graphs, which may not be at hand."""
    if name == "office":
        return write_graph(office_graph(furnished=False), folder / "graph of an office")
    shared = SHARED / "graphs" / name
    if not shared.is_dir():
        pytest.skip(f"needs {name} of the shared graphs folder")
    return shared
