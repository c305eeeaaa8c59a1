"""Volumes leave no gap that rounding could fall into."""

import numpy as np
from viewcell.workbench.export.volumes import tiled


def test_on_both_sides_of_a_face_both_neighbours_show_theirs(house):
    parts = tiled(house)
    assert len(parts.volumes) == (house.graph.inhabitable[: house.graph.tile_count]).sum()
    volumes = np.concatenate([parts.volumes, parts.outside]).astype(float)
    for cell in parts.cells:
        box = house.graph.cells[cell].astype(float)
        for axis in range(3):
            for side, out in ((0, -1), (1, 1)):
                for step in (-0.5, 0.5):
                    point = box.mean(axis=0)
                    point[axis] = box[side, axis] + out * step
                    held = ((volumes[:, 0] <= point) & (point <= volumes[:, 1])).all(axis=1)
                    assert held.sum() >= 2 and held[: len(parts.cells)].any()
