"""What the viewer is given is what the display database says, read here by other code."""

import base64
import gzip
import re

import numpy as np
import pytest
from builders.view_scripts import read_script
from viewcell.data.scene import Role
from viewcell.workbench.view.contents import chunk_starts, chunks, contents


@pytest.fixture(scope="module")
def given(walk):
    return read_script(contents(walk))


def test_objects_and_cells_are_in_their_order(given, walk, office):
    head, arrays = given
    ids = walk.objects["object_id"].to_numpy()
    assert head["names"] == [office.scene.objects[number].name for number in ids]
    kinds = [head["kinds"][kind] for kind in arrays["kinds"]]
    assert kinds == [office.scene.objects[number].kind for number in ids]
    clear = [office.scene.objects[number].role is Role.TRANSPARENT for number in ids]
    assert arrays["clear"].astype(bool).tolist() == clear and any(clear)
    stood_on = dict(zip(kinds, arrays["ground"].tolist(), strict=True))
    assert stood_on["IfcSlab"] == stood_on["IfcWall"] == 1 and stood_on["IfcFurniture"] == stood_on["IfcLamp"] == 0
    boxes = office.scene.object_bounds() * office.grid_m
    bounds = [*boxes[:, 0].min(axis=0), *boxes[:, 1].max(axis=0)]
    assert np.allclose(head["bounds"], bounds, atol=2 * office.grid_m)
    graph = office.graph
    cells = arrays["cellIds"]
    assert np.allclose(arrays["cellBoxes"].reshape(-1, 2, 3), graph.cells[cells] * office.grid_m, atol=1e-5)
    assert arrays["inhabitable"].astype(bool).tolist() == graph.inhabitable[cells].tolist()
    assert head["cellNames"] == [str(name) for name in graph.cell_names[cells]] and head["claimsCells"]


def test_portals_join_rows_of_cells(given, office):
    _, arrays = given
    sides = arrays["cellIds"][arrays["portalCells"].reshape(-1, 2)]
    assert np.array_equal(np.sort(sides, axis=1), np.sort(office.graph.portal_cells, axis=1))
    assert arrays["portalAxes"].tolist() == office.graph.portal_axis.tolist()
    low = office.graph.portals[:, 0] * office.grid_m
    along = low[np.arange(len(low)), office.graph.portal_axis]
    assert np.allclose(arrays["portalCoordinates"], along, atol=1e-5)


def test_triangles_are_the_models(given, office, walk):
    _, arrays = given
    ids = walk.objects["object_id"].to_numpy()
    triangles, owners = office.scene.triangles()
    same = 0
    for place in range(0, len(ids), 7):
        item = arrays["items"][arrays["itemStarts"][place]]
        begin, count, faces = (int(arrays[name][item]) for name in ("itemOffsets", "itemVertices", "itemFaces"))
        data = arrays["geometry"].tobytes()
        corners = np.frombuffer(data, "<f4", 3 * count, begin).reshape(-1, 3)
        corner_ids = np.frombuffer(data, "<u2", 3 * faces, begin + 12 * count)
        matrix = arrays["transforms"].reshape(-1, 3, 4)[place]
        placed = (corners @ matrix[:, :3].T + matrix[:, 3])[corner_ids].reshape(-1, 3, 3)
        own = triangles[owners == ids[place]] * office.grid_m
        # Triangles without an area on the grid are none there.
        assert len(own) <= len(placed) <= len(own) + 4
        if len(placed) == len(own):
            assert np.abs(placed - own).max() <= office.grid_m
            same += 1
    assert same > 20


def test_the_same_database_gives_the_same_text(walk):
    assert contents(walk) == contents(walk)


def test_colours_are_the_models(tmp_path):
    """An object's own, else that of most of its faces, else none."""
    from viewcell.data.scene import Definition, Instance, Mesh, Scene
    from viewcell.workbench.bake.run import bake
    from viewcell.workbench.pack.run import pack

    box = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7]], np.int32)
    red, blue = (255, 0, 0, 255), (0, 0, 255, 255)
    painted = Mesh(box, faces, 0.0, np.array([red, blue, blue], np.uint8))
    definitions = [Definition("painted", (painted,)), Definition("plain", (Mesh(box, faces),))]
    objects = [
        Instance("blue", "", 0, np.eye(4), Role.DETAIL),
        Instance("none", "", 1, np.eye(4), Role.DETAIL),
        Instance("own", "", 1, np.eye(4), Role.DETAIL, colour=(1, 2, 3, 255)),
    ]
    cells = tmp_path / "cells.csv"
    cells.write_text("min_x,min_y,min_z,max_x,max_y,max_z\n2,2,2,3,3,3\n")
    made = bake(Scene(definitions, objects, source="boxes"), tmp_path / "a.bake", method="occluders", cells=str(cells))
    head, arrays = read_script(contents(pack(made)))
    found = dict(zip(head["names"], arrays["colours"].tolist(), strict=True))
    assert found == {"blue": 0x0000FFFF, "none": 0, "own": 0x010203FF}
    # View cells that stand anywhere claim nothing of cells.
    assert not head["claimsCells"] and not len(arrays["reached"])


def test_chunks_are_the_geometry(walk):
    """In order, cut between items; a view that streams has all else of one that does not."""
    head, arrays = read_script(contents(walk, streams=True))
    whole_head, whole = read_script(contents(walk))
    assert head == whole_head | {"streams": True} and set(whole) - set(arrays) == {"geometry"}
    file = (walk.folder / "geometry.bin").read_bytes()
    starts, ends = arrays["chunkStarts"], arrays["chunkEnds"]
    assert starts[0] == 0 and starts[-1] == walk.items.num_rows and (np.diff(starts) > 0).all()
    for chunk, text in enumerate(chunks(walk)):
        name, packed = re.fullmatch(r'viewcellChunks\.set\((\d+),"([^"]+)"\);\n', text).groups()
        begin = arrays["itemOffsets"][starts[chunk]]
        assert int(name) == chunk and gzip.decompress(base64.b64decode(packed)) == file[begin : ends[chunk]]
    assert chunk == len(starts) - 2 > 3
    limits = np.split(arrays["limits"], arrays["memberStarts"][1:-1])
    assert [len(one) for one in limits] == [len(walk.potential.of(row)) for row in range(walk.sets.num_rows)]


def test_chunks_are_neither_small_nor_large():
    ends = np.arange(1, 100_001) * 1000
    starts = chunk_starts(ends - 1000, ends)
    sizes = np.diff(np.append(starts[:-1], 100_000)) * 1000
    assert sizes.max() < 262_144 + 1000 and len(starts) > 256
    assert chunk_starts(ends[:10] - 1000, ends[:10]).tolist() == [0, 5, 9, 10]
    assert chunk_starts(np.zeros(0, np.int64), np.zeros(0, np.int64)).tolist() == [0]


def test_boxes_of_objects(given, walk):
    head, arrays = given
    assert head["grid"] == walk.grid_m
    low, extent = arrays["objectSteps"].reshape(2, 3, -1)
    assert np.array_equal(np.stack([low.T, (low + extent).T], axis=1), walk.boxes)
