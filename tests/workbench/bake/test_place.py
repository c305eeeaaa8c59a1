"""The place of a bake: nothing of others is lost there, what must fail fails at once, what is left over is told."""

import json
import os

import pytest
import viewcell
from builders.random_buildings import two_solids
from viewcell.data.errors import InputError
from viewcell.data.store.scene_folder import write_scene
from viewcell.workbench.bake import blocks, run
from viewcell.workbench.bake.place import alone, clean, leftovers
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.cli import main


@pytest.fixture
def made(tmp_path):
    return viewcell.bake(two_solids(), tmp_path / "a.bake", settings=Settings(certify=True), threads=1)


def again(made, **settings):
    return viewcell.bake(two_solids(), made.folder, settings=Settings(**settings), threads=1, overwrite=True)


def test_files_of_others_survive_and_tables_of_before_do_not(made):
    (made.folder / "notes.txt").write_text("mine")
    (made.folder / "mine.parquet").write_bytes(b"mine")
    (made.folder / "pictures").mkdir()
    (made.folder / "pictures" / "a.png").write_bytes(b"a")
    (made.folder / "link").symlink_to("notes.txt")
    assert (made.folder / "proofs.parquet").exists()
    again(made)
    assert (made.folder / "notes.txt").read_text() == "mine" and (made.folder / "link").is_symlink()
    assert (made.folder / "mine.parquet").read_bytes() == b"mine"
    assert (made.folder / "pictures" / "a.png").read_bytes() == b"a"
    assert not (made.folder / "proofs.parquet").exists()


def test_a_report_of_the_bake_before_is_set_aside(made):
    for seed in (1, 2):
        (made.folder / "report").mkdir()
        (made.folder / "report" / "curves.json").write_text(str(seed))
        again(made, seed=seed)
    assert not (made.folder / "report").exists()
    for name, seed in (("report.stale", 1), ("report.stale.2", 2)):
        assert (made.folder / name / "curves.json").read_text() == str(seed)


def test_a_scene_folder_keeps_what_is_not_its_own(tmp_path):
    write_scene(two_solids(), tmp_path / "a.scene")
    (tmp_path / "a.scene" / "notes.txt").write_text("mine")
    write_scene(two_solids(), tmp_path / "a.scene")
    assert (tmp_path / "a.scene" / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("what", ["cells", "settings", "place", "something else"])
def test_what_must_fail_fails_before_the_model_is_read(what, tmp_path, monkeypatch):
    out, settings = tmp_path / "a.bake", Settings()
    if what == "settings":
        viewcell.bake(two_solids(), out, settings=Settings(seed=3), threads=1)
    if what == "cells":
        settings = Settings(cells=str(tmp_path / "none.csv"))
    if what == "place":
        (tmp_path / "file").write_text("")
        out = tmp_path / "file" / "deep" / "a.bake"
    if what == "something else":
        out.mkdir()
        (out / "notes.txt").write_text("mine")
    before = sorted(tmp_path.rglob("*"))
    monkeypatch.setattr(run, "open_model", lambda *_: pytest.fail("the model was read"))
    with pytest.raises(InputError, match="expected"):
        viewcell.bake("model.ifc", out, settings=settings)
    assert sorted(tmp_path.rglob("*")) == before


def test_what_differs_is_named(made):
    for settings, found in (
        (Settings(seed=7, method="both"), "with method 'auto', certify True, seed 0"),
        (Settings(certify=True), "of another model, or of an earlier state of it"),
    ):
        scene = two_solids()
        scene.objects.reverse()
        with pytest.raises(InputError) as told:
            viewcell.bake(scene, made.folder, settings=settings, threads=1)
        assert found in str(told.value) and "--overwrite" in str(told.value)


def test_unfinished_work_is_named_and_cleaned(tmp_path, monkeypatch, capsys):
    write_scene(two_solids(), tmp_path / "a.scene")
    monkeypatch.chdir(tmp_path)
    assert main(["bake", "a.scene", "--budget", "1e-6", "--no-progress"]) == 0
    (left,) = leftovers(tmp_path)
    capsys.readouterr()
    # Of other settings: it is not lost either.
    assert main(["bake", "a.scene", "--seed", "4", "--overwrite", "--no-progress"]) == 0
    assert capsys.readouterr().out.startswith(f"unfinished: {left.name}; ") and left.is_dir()
    half = tmp_path / ".b.bake.writing.1234"
    half.mkdir()
    assert main(["clean"]) == 0
    assert {line.split()[-1] for line in capsys.readouterr().out.splitlines()} == {left.name, half.name}
    assert not left.exists() and not half.exists()
    assert main(["clean"]) == 0 and "nothing was left unfinished" in capsys.readouterr().out
    assert main(["clean", "nowhere"]) == 2


def test_a_folder_whose_place_was_left_empty_is_put_back(made, tmp_path):
    """Killed between the two renames."""
    old = tmp_path / ".a.bake.writing.1234.old"
    os.rename(made.folder, old)
    assert clean(tmp_path) == [("put back", tmp_path / "a.bake")]
    assert json.loads((tmp_path / "a.bake" / "manifest.json").read_text()) == made.manifest


@pytest.mark.parametrize("name", ["office.scene", "office.glb"])
def test_a_made_building_replaces_nothing_unasked(name, tmp_path, capsys):
    out = tmp_path / name
    out.write_text("mine")
    command = ["make", "office", "--floors", "1", "--rooms-per-side", "1", "--out", str(out)]
    assert main(command) == 2
    assert "--overwrite replaces it" in capsys.readouterr().err and out.read_text() == "mine"
    if name.endswith(".glb"):
        assert main([*command, "--overwrite"]) == 0 and out.read_bytes()[:4] == b"glTF"


def test_one_bake_at_a_time(tmp_path):
    out = tmp_path / "a.bake"
    with alone(out):
        with pytest.raises(InputError, match="expected no bake that is being written there"):
            viewcell.bake(two_solids(), out, threads=1)
        assert not out.exists()
    assert not list(tmp_path.iterdir())
    viewcell.bake(two_solids(), out, threads=1)
    assert list(tmp_path.iterdir()) == [out]


def test_leftovers_are_those_of_the_very_name(tmp_path):
    for name in (".a[1].bake.0123.partial", ".a1.bake.0123.partial"):
        (tmp_path / name).mkdir()
    assert [path.name for path in leftovers(tmp_path, "a[1].bake")] == [".a[1].bake.0123.partial"]
    assert len(leftovers(tmp_path)) == 2


@pytest.mark.parametrize("kept", [True, False])
def test_only_a_bake_that_resumes_says_so(kept, tmp_path, monkeypatch, capsys):
    """Blocks of another bake beside it do not count."""
    write_scene(two_solids(), tmp_path / "a.scene")
    monkeypatch.chdir(tmp_path)
    other = tmp_path / ".a.bake.0123456789abcdef.partial"
    other.mkdir()
    (other / "0.arrow").write_bytes(b"")
    whole = blocks.Work.finish_all

    def interrupt(self, cut):
        if kept:
            whole(self, cut)
        raise KeyboardInterrupt

    monkeypatch.setattr(blocks.Work, "finish_all", interrupt)
    assert main(["bake", "a.scene"]) == 130
    assert ("the same command goes on from there" in capsys.readouterr().err) == kept
