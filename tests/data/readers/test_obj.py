"""OBJ and its material libraries."""

import numpy as np
import pytest
from builders.model_files import obj
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.scene import Role

ONE = {"wall": ((0, 0, 0), (4, 1, 3))}
SQUARE = "v 0 0 0\nv 4 0 0\nv 4 0 3\nv 0 0 3\n"


def role(tmp_path, library: str, head: str = "mtllib m.mtl", name: str = "m.mtl") -> Role:
    """Role of a part in the material "stuff" beside a solid one."""
    (tmp_path / name).write_text(library)
    text = f"{head}\n{SQUARE}o solid\nf 1 2 3\no part\nusemtl stuff\nf 1 2 3 4\n"
    (tmp_path / "a.obj").write_text(text)
    return read(tmp_path / "a.obj").objects[1].role


PASSING = {
    "filter alone": "Tf 0.9 0.9 0.9",
    "filter of glass": "Tf 1 1 1\nillum 7",
    "one number": "Tf 0.5",
    "map_d": "map_d a.png",
    "map with options": "d 1\nmap_d -mm 0 1 a.png",
    "capitals": "D 0.5",
    "Tr": "Tr 0.5",
    "d before Tr alike": "d 0.2\nTr 0.2",
    "Tr before d alike": "Tr 0.2\nd 0.2",
    "halo": "d -halo 0.5",
}
OPAQUE = {
    "filter of one, as exporters write with all": "Tf 1 1 1\nillum 2\nd 1",
    "as Maya writes": "illum 4\nKd 0.5 0.5 0.5\nTf 1.00 1.00 1.00\nNi 1.00",
    "filter of none": "Tf 0 0 0\nillum 6",
    "d and Tr alike": "d 1.0\nTr 1.0",
    "Tr and d alike": "Tr 1.0\nd 1.0",
    "nonsense": "d\nTr x\nTf\nillum y",
}


@pytest.mark.parametrize("case", [*PASSING, *OPAQUE])
def test_libraries_say_what_is_glass(tmp_path, case):
    found = role(tmp_path, f"newmtl stuff\n{(PASSING | OPAQUE)[case]}\n")
    assert found is (Role.TRANSPARENT if case in PASSING else Role.OCCLUDER)


WAYS = {
    "plain": ("m.mtl", "m.mtl"),
    "quoted, with a blank": ('"my stuff.mtl"', "my stuff.mtl"),
    "with a blank": ("my stuff.mtl", "my stuff.mtl"),
    "several": ("none.mtl my stuff.mtl", "my stuff.mtl"),
    "backslash": (".\\m.mtl", "m.mtl"),
    "folder in other case": ("LIB\\m.MTL", "lib/M.mtl"),
}


@pytest.mark.parametrize("way", WAYS)
def test_libraries_are_found(tmp_path, way):
    said, name = WAYS[way]
    (tmp_path / "lib").mkdir()
    assert role(tmp_path, "NEWMTL stuff\nd 0.5\n", f"mtllib {said}", name) is Role.TRANSPARENT
    missing = ["none.mtl"] if way == "several" else []
    assert [one["what"] for one in read(tmp_path / "a.obj").skipped] == missing


def test_missing_libraries_and_materials_are_listed(tmp_path):
    (tmp_path / "a.obj").write_bytes(obj(ONE, head="mtllib gone.mtl other.mtl", material="stuff"))
    assert [one["what"] for one in read(tmp_path / "a.obj").skipped] == ["gone.mtl", "other.mtl"]
    (tmp_path / "other.mtl").write_text("newmtl paint\n")
    assert [one["what"] for one in read(tmp_path / "a.obj").notes] == ["stuff"]


def test_materials_differ_in_case_and_quotes(tmp_path):
    (tmp_path / "m.mtl").write_text('newmtl "Clear Stuff"\nd 0.2\n')
    (tmp_path / "a.obj").write_text(f"mtllib m.mtl\n{SQUARE}o solid\nf 1 2 3\no part\nusemtl clear stuff\nf 1 2 4\n")
    assert read(tmp_path / "a.obj").objects[1].role is Role.TRANSPARENT


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1", "utf-8"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_ends_of_lines(tmp_path, encoding, end):
    text = f"{SQUARE}o Wand\nf 1 2 3\no Tür\nf 1 2 3\n"
    (tmp_path / "a.obj").write_bytes(text.replace("\n", end).encode(encoding))
    scene = read(tmp_path / "a.obj")
    assert [placed.name for placed in scene.objects] == ["Wand", "Tür"]
    assert scene.objects[1].role is Role.TRANSPARENT
    np.testing.assert_allclose(np.ptp(scene.bounds(), axis=0) * scene.grid_m, [4, 0, 3])


def test_colours_of_materials_and_of_vertices(tmp_path):
    (tmp_path / "m.mtl").write_text("newmtl stuff\nKd 1 0.5 0\nd 0.5\n")
    (tmp_path / "a.obj").write_text(f"mtllib m.mtl\n{SQUARE}o solid\nf 1 2 3\no part\nusemtl stuff\nf 1 2 3 4\n")
    solid, part = read(tmp_path / "a.obj").definitions
    assert solid.lods[0].colours is None
    assert part.lods[0].colours.tolist() == [[255, 128, 0, 128]] * 2
    (tmp_path / "b.obj").write_text("v 0 0 0 1 0 0\nv 4 0 0 0 1 0\nv 0 4 0 0 0 1\nf 1 2 3\n")
    assert read(tmp_path / "b.obj").definitions[0].lods[0].colours.tolist() == [[85, 85, 85, 255]]


def test_groups_that_are_opened_again_are_noted(tmp_path):
    (tmp_path / "a.obj").write_text(f"{SQUARE}g a\nf 1 2 3\ng b\nf 1 2 4\ng a\nf 1 3 4\nusemtl x\nusemtl y\nf 1 2 3\n")
    scene = read(tmp_path / "a.obj")
    assert [placed.name for placed in scene.objects] == ["a", "b", "a #2"]
    assert [note["what"] for note in scene.notes] == ["1 groups", "a"]


def test_bent_polygons_lines_and_curves_are_listed(tmp_path):
    (tmp_path / "a.obj").write_text(
        "v 0 0 0\nv 4 0 0\nv 4 4 1\nv 0 4 0\nf 1 2 3 4\nf 1 2 3\nl 1 2\np 3\nsurf 0 1 0 1 1\n"
    )
    scene = read(tmp_path / "a.obj")
    assert [note["what"] for note in scene.notes] == ["1 of 2 polygons"]
    assert [one["what"] for one in scene.skipped] == ["2 lines and points", "1 curves and surfaces"]


def test_comments_behind_faces_and_continued_lines(tmp_path):
    (tmp_path / "a.obj").write_text(f"{SQUARE}f 1 2 3 # not 9\nf 1 \\\r\n 3 \\\n 4")
    assert len(read(tmp_path / "a.obj").triangles()[0]) == 2
    (tmp_path / "a.obj").write_text(f"{SQUARE}f 1 2 x\n")
    with pytest.raises(InputError, match=r"line 5: expected an OBJ 'f' line, found"):
        read(tmp_path / "a.obj")
