"""Depth meshes in a view: a script for each view cell, decoded in the page as here, drawn in place of what is far."""

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest
from builders.far_bake import far_bake, far_walk
from viewcell.data.depth_meshes import FarSide
from viewcell.data.store.depth_items import encode_face
from viewcell.solvers.depth_meshes.mesh import depth_mesh
from viewcell.verify.rays.far_side import placed_triangles
from viewcell.workbench.view import run
from viewcell.workbench.view.contents import contents, geometry_bytes
from viewcell.workbench.view.run import view

VECTOR = Path(__file__).parent / "page" / "depth_face.json"
REACH = 2.5


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    folder = tmp_path_factory.mktemp("far")
    return far_walk(folder, far_bake(folder))


def vector():
    """A face of two layers, a slope before a wall, and where its vertices lie on each face of a cull box."""
    y, x = np.mgrid[:16, :16]
    near = (x > 4) & (x < 11) & (y > 3) & (y < 12)
    parallax, layers = np.where(near, 4.0 + 0.1 * x + 0.03 * y * y, 1.0), np.where(near, 0, 1).astype(np.uint8)
    meshes = tuple(depth_mesh(parallax, layers == k, 0.05) for k in range(2))
    ids, none = np.where(near, 5, 9).astype(np.int32)[None], np.zeros(0, np.int64)
    side = FarSide(
        none, none, np.array([5, 9]), np.zeros(3), REACH, ids, parallax[None], layers[None], (meshes,), 1.0, 1.0
    )
    placed = []
    for face in range(6):
        corners = np.zeros((len(meshes[0].pixels), 3))
        corners[meshes[0].triangles] = placed_triangles(meshes[0], face, 16, REACH)
        placed.append(corners.ravel().round(6).tolist())
    return {
        "texels": 16,
        "reach": REACH,
        "face": base64.b64encode(encode_face(side, 0)).decode(),
        "meshes": [
            {
                "places": (mesh.pixels[:, 1].astype(int) * 16 + mesh.pixels[:, 0]).tolist(),
                "parallax": mesh.parallax.astype(float).tolist(),
                "triangles": mesh.triangles.ravel().tolist(),
            }
            for mesh in meshes
        ],
        "placed": placed,
    }


def test_what_the_page_s_tests_read_is_what_is_encoded():
    found, wanted = json.loads(VECTOR.read_text()), vector()
    # Libraries may compress otherwise.
    assert {**found, "face": ""} == {**wanted, "face": ""}


def test_every_view_cell_has_a_script(balls, tmp_path, monkeypatch):
    for name in ("viewer.js", "viewer.js.LEGAL.txt"):
        (tmp_path / name).write_text("in place of what npm brings")
    monkeypatch.setattr(run, "BUILT", tmp_path)
    page = view(balls, tmp_path / "balls.view").page
    with (balls.folder / "geometry.bin").open("rb") as file:
        whole = file.read()
    for row in range(2):
        text = (page.parent / f"depth-{row}.js").read_text()
        found = re.fullmatch(rf"viewcellDepth\.set\({row},(.*)\);\n", text)
        faces = [base64.b64decode(one) for one in json.loads(found[1])]
        index = balls.depth_meshes
        for face, data in enumerate(faces):
            begin = index.offsets[row, face]
            assert data == whole[begin : begin + index.sizes[row, face]]
    assert not (page.parent / "depth-2.js").exists()
    (page.parent / "depth-2.js").write_text("of another view")
    view(balls, page.parent, overwrite=True)
    assert not (page.parent / "depth-2.js").exists()


def test_they_are_no_geometry(balls):
    head = json.loads(contents(balls).partition("=")[2].rstrip(";\n"))
    assert head["arrays"]["geometry"][2] == geometry_bytes(balls) < (balls.folder / "geometry.bin").stat().st_size
    assert head["arrays"]["depthCells"][2] == 2
