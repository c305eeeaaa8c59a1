"""Where exports go: nothing is replaced unasked, nothing is left half done."""

import pytest
from builders.four_rooms import hashes
from viewcell import InputError
from viewcell.workbench.bake.place import leftovers
from viewcell.workbench.baked import load
from viewcell.workbench.cli import main
from viewcell.workbench.export.run import FILES, FOLDERS, KINDS, export


def refused(capsys, *arguments):
    """The one line with which the command exits 2."""
    assert main(["export", *map(str, arguments)]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith("viewcell: ")
    return err


@pytest.mark.parametrize("kind", FILES)
def test_nothing_is_replaced_unasked(house, kind, tmp_path, capsys):
    out = tmp_path / f"house.{kind}"
    out.write_bytes(b"mine")
    assert "--overwrite" in refused(capsys, house.folder, f"--{kind}", out)
    assert out.read_bytes() == b"mine" and len(list(tmp_path.iterdir())) == 1
    bake = load(house.folder)
    with pytest.raises(InputError, match="overwrite=True"):
        bake.export(kind, out)
    assert bake.export(kind, out, overwrite=True) == out
    first = out.read_bytes()
    assert first != b"mine" and not list(tmp_path.glob(".*"))
    assert main(["export", str(house.folder), f"--{kind}", str(out), "--overwrite"]) == 0
    assert f"written to {out}, {len(first):,} bytes" in capsys.readouterr().out and out.read_bytes() == first


def test_the_header_is_no_clash_unless_it_is_another(house, tmp_path):
    bake, header = load(house.folder), tmp_path / "viewcell_bits.h"
    bake.export("bits", tmp_path / "one.bits")
    before = header.read_bytes()
    bake.export("bits", tmp_path / "two.bits")
    header.write_bytes(b"mine")
    with pytest.raises(InputError, match=r"viewcell_bits\.h.*--overwrite"):
        bake.export("bits", tmp_path / "three.bits")
    assert header.read_bytes() == b"mine" and not (tmp_path / "three.bits").exists()
    bake.export("bits", tmp_path / "three.bits", overwrite=True)
    assert header.read_bytes() == before


def test_several_are_written_at_once_or_none(house, tmp_path, capsys):
    outs = {kind: tmp_path / f"house.{kind}" for kind in FILES}
    asked = [word for kind, out in outs.items() for word in (f"--{kind}", out)]
    outs["glb"].write_bytes(b"mine")
    refused(capsys, house.folder, *asked)
    assert [path.name for path in tmp_path.iterdir()] == ["house.glb"]
    outs["glb"].unlink()
    assert main(["export", str(house.folder), *map(str, asked)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {*(out.name for out in outs.values()), "viewcell_bits.h"}


def test_what_cannot_be_exported_is_told_in_one_line(house, baked, tmp_path, capsys):
    assert "at least one of --prt, --json" in refused(capsys, house.folder)
    assert "no-such-bake" in refused(capsys, "no-such-bake", "--glb", tmp_path / "a.glb")
    assert "found none" in refused(capsys, house.folder, "--json", tmp_path / "no" / "a.json")
    assert "found a folder" in refused(capsys, house.folder, "--json", tmp_path)
    assert "found it twice" in refused(capsys, house.folder, "--json", tmp_path / "a", "--bits", tmp_path / "a")
    for kind in FILES:
        if kind != "prt":
            assert "without objects" in refused(capsys, baked, f"--{kind}", tmp_path / "a")
    # Its own files are no place for an export, whatever may be replaced.
    before = hashes(house.folder)
    for name in ("manifest.json", "objects.parquet"):
        assert "found a part of it" in refused(capsys, house.folder, "--json", house.folder / name, "--overwrite")
    assert hashes(house.folder) == before and not list(tmp_path.iterdir())
    with pytest.raises(InputError, match=r"expected prt, json, .*, found 'fbx'"):
        export(house, {"fbx": tmp_path / "a.fbx"})


def test_a_full_disk_leaves_what_was_there(house, tmp_path, monkeypatch):
    out, left = tmp_path / "house.json", []
    out.write_bytes(b"mine")

    def full(*_):
        # Had it been killed here, `viewcell clean` would know what is left.
        left.extend(leftovers(tmp_path))
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("viewcell.workbench.export.place.os.replace", full)
    with pytest.raises(InputError, match="No space left"):
        load(house.folder).export("json", out, overwrite=True)
    assert (
        len(left) == 1 and out.read_bytes() == b"mine" and [path.name for path in tmp_path.iterdir()] == ["house.json"]
    )


def test_editors_complete_what_can_be_exported():
    assert KINDS == (*FILES, *FOLDERS)
