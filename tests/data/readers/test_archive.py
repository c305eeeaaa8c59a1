from zipfile import ZIP_DEFLATED, ZipFile

import pytest
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.readers.archive import only_file


def archive(path, **files: bytes):
    with ZipFile(path, "w", ZIP_DEFLATED) as made:
        for name, content in files.items():
            made.writestr(name.replace("_", "."), content)
    return path


def refused(path) -> str:
    with pytest.raises(InputError) as error:
        read(path)
    assert "\n" not in str(error.value) and str(path) in str(error.value)
    return str(error.value)


def test_the_one_file_is_found_among_others(tmp_path):
    path = archive(tmp_path / "a.ifczip", b_IFC=b"model", readme_txt=b"no model")
    assert only_file(path, (".ifc",)) == b"model"


def test_none_or_several_are_refused(tmp_path):
    assert "found 2" in refused(archive(tmp_path / "two.ifczip", a_ifc=b"1", b_ifc=b"2"))
    assert "found 0" in refused(archive(tmp_path / "none.ifczip", a_txt=b"1"))


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path):
    assert "shrank" in refused(archive(tmp_path / "a.ifczip", a_ifc=bytes(50_000_000)))


def test_what_is_no_archive_or_damaged_is_refused(tmp_path):
    path = tmp_path / "a.ifczip"
    path.write_bytes(b"ISO-10303-21;")
    assert "zip archive" in refused(path)
    sound = archive(tmp_path / "b.ifczip", a_ifc=bytes(range(256)) * 9).read_bytes()
    (tmp_path / "c.ifczip").write_bytes(sound[:60] + b"?" * 20 + sound[80:])
    assert "zip archive" in refused(tmp_path / "c.ifczip")
