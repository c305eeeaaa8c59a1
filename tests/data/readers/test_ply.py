"""PLY: byte orders, polygons, strips, colours, and lengths that lie."""

import struct

import numpy as np
import pytest
from builders.model_files import box_corners, ply
from viewcell.data.errors import InputError
from viewcell.data.readers import read

POINTS = box_corners((0, 0, 0), (4, 1, 3))
MIXED = [[0, 1, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7], [1, 7, 3]]


def refused(path) -> str:
    with pytest.raises(InputError) as error:
        read(path)
    assert "\n" not in str(error.value) and "expected" in str(error.value) and "found" in str(error.value)
    return str(error.value)


@pytest.mark.parametrize("order", ["ascii", "<", ">"])
def test_triangles_and_quads_in_every_order(tmp_path, order):
    (tmp_path / "a.ply").write_bytes(ply(order, POINTS, MIXED))
    scene = read(tmp_path / "a.ply")
    assert [placed.name for placed in scene.objects] == ["a.ply"] and len(scene.triangles()[0]) == 12
    np.testing.assert_array_equal(np.ptp(scene.bounds(), axis=0) * scene.grid_m, [4, 1, 3])


@pytest.mark.parametrize("order", ["ascii", "<"])
def test_colours_of_vertices_are_averaged(tmp_path, order):
    colours = [[30 * k, 255, 0] for k in range(8)]
    (tmp_path / "a.ply").write_bytes(ply(order, POINTS, [[0, 1, 2], [5, 6, 7]], colours))
    assert read(tmp_path / "a.ply").definitions[0].lods[0].colours.tolist() == [[30, 255, 0, 255], [180, 255, 0, 255]]


HEAD = "ply\nformat {} 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
ROWS = "".join("{:g} {:g} {:g}\n".format(*point) for point in POINTS)


def test_other_elements_and_properties_are_passed_over(tmp_path):
    head = HEAD.format("ascii").replace(
        "element vertex", "element camera 1\nproperty list uchar float view\nelement vertex"
    )
    head += "property float quality\nelement face 1\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    head += "property list uchar uint vertex_index\nproperty list uchar float texcoord\nend_header\n"
    rows = "".join("{:g} {:g} {:g} 0.5\n".format(*point) for point in POINTS)
    (tmp_path / "a.ply").write_text(f"{head}3 1 2 3\n{rows}9 8 7 4 0 1 3 2 2 0.5 0.5\n")
    scene = read(tmp_path / "a.ply")
    assert scene.definitions[0].lods[0].colours.tolist() == [[9, 8, 7, 255]] * 2
    assert [note["what"] for note in scene.notes] == ["1 of element 'camera'"]


def test_strips_in_binary(tmp_path):
    head = HEAD.format("binary_big_endian") + "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    strip = [0, 1, 2, 3, 6, 7, -1, 4, 5, -1]
    body = POINTS.astype(">f4").tobytes() + struct.pack(">11i", len(strip), *strip)
    (tmp_path / "a.ply").write_bytes(head.encode() + body)
    scene = read(tmp_path / "a.ply")
    corners = scene.triangles()[0] * 2.0**-10
    assert len(corners) == 4
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert normals[:2].tolist() == [[-3, 0, 0]] * 2 and (normals[2:, 1] == normals[2, 1]).all()
    assert scene.skipped == [{"what": "1 strips", "why": "fewer than 3 corners"}]


LIES = {
    "more vertices": ("ascii", HEAD.replace("vertex 8", "vertex 80"), "3 0 1 2\n"),
    "vertices without end": ("ascii", HEAD.replace("vertex 8", "vertex 4000000000"), "3 0 1 2\n"),
    "faces without end": ("ascii", HEAD, "3 0 1 2\n", "element face 4000000000"),
    "a vertex that is not there": ("ascii", HEAD, "3 0 1 8\n"),
    "a negative vertex": ("ascii", HEAD, "3 0 1 -1\n"),
    "a corner between two": ("ascii", HEAD, "3 0 1 2.5\n"),
    "more corners than words": ("ascii", HEAD, "9 0 1 2\n"),
    "a negative count": ("ascii", HEAD, "-3 0 1 2\n"),
    "a word": ("ascii", HEAD, "3 0 1 two\n"),
    "no z": ("ascii", HEAD.replace("float z", "float w"), "3 0 1 2\n"),
    "an unknown type": ("ascii", HEAD.replace("float z", "half z"), "3 0 1 2\n"),
    "an unknown format": ("middle_endian", HEAD, "3 0 1 2\n"),
    "no faces": ("ascii", HEAD, "", "element face 0"),
}


@pytest.mark.parametrize("case", LIES)
def test_lies_are_one_line(tmp_path, case):
    form, head, faces, *element = LIES[case]
    element = (*element, "element face 1")[0]
    text = f"{head.format(form)}{element}\nproperty list uchar int vertex_indices\nend_header\n{ROWS}{faces}"
    (tmp_path / "a.ply").write_text(text)
    said = refused(tmp_path / "a.ply")
    assert "readable" not in said
    assert ("that fit the file" in said) is ("without end" in case)


def test_a_negative_length_in_binary_is_one_line(tmp_path):
    head = HEAD.format("binary_little_endian") + "element face 1\nproperty list int int vertex_indices\nend_header\n"
    (tmp_path / "a.ply").write_bytes(head.encode() + POINTS.astype("<f4").tobytes() + struct.pack("<4i", -3, 0, 1, 2))
    assert "expected 1 rows of element 'face'" in refused(tmp_path / "a.ply")


@pytest.mark.parametrize("order", ["ascii", "<", ">"])
def test_files_that_end_early_and_late(tmp_path, order):
    whole = ply(order, POINTS, MIXED)
    for cut in (40, 120, 250, len(whole) - 3):
        (tmp_path / "a.ply").write_bytes(whole[:cut])
        refused(tmp_path / "a.ply")
    (tmp_path / "a.ply").write_bytes(whole + b" 7")
    assert len(read(tmp_path / "a.ply").notes) == 1


def test_faces_of_two_corners_are_skipped(tmp_path):
    (tmp_path / "a.ply").write_bytes(ply("<", POINTS, [[0, 1], [0, 1, 2]]))
    assert read(tmp_path / "a.ply").skipped == [{"what": "1 faces", "why": "fewer than 3 corners"}]
