"""A test of one's own baker, for its CI.

    pip install viewcell[test]
    pytest test_my_pvs.py --viewcell-model house.ifc

`viewcell_scene` and `assert_conservative` come with viewcell. The test fails where the sets hide what can be seen from
a view cell, with a sightline for each; that a set is larger than it need be is no fault, and is told with `-s`.
"""

import pyarrow as pa
import pyarrow.parquet as pq


def my_baker(scene, cells):
    """Put yours here: pairs (cell, object) that may be visible. This one keeps everything."""
    return [(cell, number) for cell in range(len(cells)) for number in range(len(scene.objects))]


def view_cells(scene):
    """Boxes at the height of eyes in rooms wider than a metre, in the model's own metres."""
    rooms = [scene.in_model(space.vertices) for space in scene.spaces]
    # A model that names no rooms is one.
    rooms = rooms or [scene.in_model(scene.bounds() * scene.grid_m)]
    ends = [(points.min(axis=0), points.max(axis=0)) for points in rooms]
    return [
        (low[0] + 0.5, low[1] + 0.5, low[2] + 1.2, high[0] - 0.5, high[1] - 0.5, low[2] + 1.8)
        for low, high in ends
        if min(high[:2] - low[:2]) > 1.0
    ]


def write_claims(scene, folder):
    """Files with view cells and sets, as `viewcell check` reads them."""
    cells = view_cells(scene)
    names = ["min_x", "min_y", "min_z", "max_x", "max_y", "max_z"]
    pq.write_table(pa.table(dict(zip(names, zip(*cells, strict=True), strict=True))), folder / "cells.parquet")
    pairs = dict(zip(["cell_id", "object_id"], zip(*my_baker(scene, cells), strict=True), strict=True))
    pq.write_table(pa.table({name: pa.array(ids, pa.int32()) for name, ids in pairs.items()}), folder / "pvs.parquet")
    return folder / "pvs.parquet", folder / "cells.parquet"


def test_nothing_visible_is_hidden(viewcell_scene, assert_conservative, tmp_path):
    """No sightline from a view cell shows what its set leaves out."""
    pvs, cells = write_claims(viewcell_scene, tmp_path)
    print(assert_conservative(pvs, viewcell_scene, cells=cells, rays=200_000).table())
