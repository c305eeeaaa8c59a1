"""STL, binary and text."""

import struct

import pytest
from builders.model_files import HOUSE, stl
from viewcell.data.errors import InputError
from viewcell.data.readers import read


def refused(path) -> str:
    with pytest.raises(InputError) as error:
        read(path)
    assert "\n" not in str(error.value) and "expected" in str(error.value) and "found" in str(error.value)
    return str(error.value)


def with_count(count: int, content: bytes) -> bytes:
    return content[:80] + struct.pack("<I", count) + content[84:]


def test_solids_of_a_text_file_are_objects(tmp_path):
    (tmp_path / "a.stl").write_bytes(stl(binary=False).replace(b"\n", b"\r\n").replace(b"vertex", b"VERTEX"))
    assert [placed.name for placed in read(tmp_path / "a.stl").objects] == list(HOUSE)


@pytest.mark.parametrize("head", [b"made for a test", b"solid made by a CAD", b"solid facet endsolid", b"COLOR=\xff"])
def test_binary_files_whatever_their_header(tmp_path, head):
    (tmp_path / "a.stl").write_bytes(stl(head=head))
    scene = read(tmp_path / "a.stl")
    assert len(scene.triangles()[0]) == 144 and not scene.notes


@pytest.mark.parametrize("count", [0, 3, 2**32 - 1])
def test_counts_that_were_never_filled_in(tmp_path, count):
    (tmp_path / "a.stl").write_bytes(with_count(count, stl()))
    scene = read(tmp_path / "a.stl")
    assert len(scene.triangles()[0]) == 144 and len(scene.notes) == 1


def test_a_count_beyond_the_end_is_refused(tmp_path):
    (tmp_path / "a.stl").write_bytes(with_count(145, stl()))
    assert "expected 145 triangles, found the end of the file after 144" in refused(tmp_path / "a.stl")


@pytest.mark.parametrize("tail", [b"\n\n", b"\0" * 51, b"made by somebody"])
def test_what_follows_the_triangles_is_noted(tmp_path, tail):
    (tmp_path / "a.stl").write_bytes(stl() + tail)
    scene = read(tmp_path / "a.stl")
    assert len(scene.triangles()[0]) == 144
    assert scene.notes == [{"what": f"{len(tail)} bytes", "why": "after the last triangle: ignored"}]


LINE = b"    endloop\n"
BROKEN = {
    "cut": lambda text: text[:5000],
    "no end": lambda text: text[: text.rindex(b"endsolid")],
    "no loop": lambda text: text.replace(LINE, b"", 1),
    "facet without a loop": lambda text: text.replace(b"endsolid", b"facet normal 0 0 0\nendfacet\nendsolid", 1),
    "four corners": lambda text: text.replace(LINE, b"      vertex 0 0 0\n" + LINE, 1),
    "no number": lambda text: text.replace(b"vertex 0 0", b"vertex 0 x", 1),
    "solid in solid": lambda text: text.replace(b"endsolid floor\n", b"", 1),
    "empty": lambda text: b"solid a\nendsolid a\n",
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_text_is_one_line(tmp_path, case):
    (tmp_path / "a.stl").write_bytes(BROKEN[case](stl(binary=False)))
    refused(tmp_path / "a.stl")
