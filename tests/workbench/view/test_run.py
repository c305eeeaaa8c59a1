"""A view is a folder that holds everything it needs, and replaces nothing unasked."""

import json
import shutil
from pathlib import Path

import pytest
import viewcell
from viewcell.data.errors import InputError
from viewcell.workbench.cli import main
from viewcell.workbench.view import run

FILES = ["data.js", "index.html", "viewer.js", "viewer.js.LEGAL.txt", "why.js"]


@pytest.fixture(autouse=True)
def scripts(tmp_path_factory, monkeypatch):
    """Stand-ins for what npm brings."""
    built = tmp_path_factory.mktemp("build")
    for name in FILES[2:4]:
        (built / name).write_text(f"{name} with three.js")
    monkeypatch.setattr(run, "BUILT", built)


def test_a_bake_and_its_pack_give_the_same_view(office, walk, tmp_path):
    first, second = viewcell.view(office, tmp_path / "a"), viewcell.view(walk.folder, tmp_path / "b")
    assert sorted(file.name for file in (tmp_path / "a").iterdir()) == FILES
    for name in (*FILES[:1], *FILES[2:]):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    text = first.page.read_text()
    # Nothing is fetched from anywhere.
    assert "http" not in text and 'src="data.js"' in text and "office" in text
    assert second.page == tmp_path / "b" / "index.html"
    assert "three" in (tmp_path / "a" / FILES[3]).read_text().lower()


def test_a_view_in_a_notebook_is_a_frame(office, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert office.view(tmp_path / 'a "b"')._repr_html_().startswith('<iframe src="a &#34;b&#34;/index.html"')


def test_command(walk, tmp_path, capsys, monkeypatch):
    out = tmp_path / "v"
    assert main(["view", str(walk.folder), "-o", str(out), "--no-open"]) == 0
    assert capsys.readouterr().out == f"{out / 'index.html'}\n"
    opened = []
    monkeypatch.setattr(run.webbrowser, "open", opened.append)
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    assert main(["view", str(walk.folder), "-o", str(tmp_path / "w")]) == 0
    assert opened == [(tmp_path / "w" / "index.html").as_uri()]


def test_nothing_is_replaced_unasked(walk, tmp_path, capsys):
    out = tmp_path / "v"
    run.view(walk.folder, out)
    (out / "notes.txt").write_text("mine")
    before = (out / "data.js").stat().st_mtime_ns
    assert main(["view", str(walk.folder), "-o", str(out)]) == 2
    assert capsys.readouterr().err.count("\n") == 1 and (out / "data.js").stat().st_mtime_ns == before
    run.view(walk.folder, out, overwrite=True)
    assert (out / "notes.txt").read_text() == "mine" and (out / "data.js").stat().st_mtime_ns != before
    other = tmp_path / "other"
    other.mkdir()
    (other / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="expected a new name or a view, found something else"):
        run.view(walk.folder, other, overwrite=True)
    assert [file.name for file in other.iterdir()] == ["thesis.txt"]
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("what", ["nothing", "scene", "cut", "out", "large", "script"])
def test_what_cannot_be_shown_is_one_line(what, walk, tmp_path, capsys, monkeypatch):
    source, out = tmp_path / "a.walk", tmp_path / "v"
    if what != "nothing":
        shutil.copytree(walk.folder, source)
    if what == "scene":
        manifest = json.loads((source / "manifest.json").read_text())
        (source / "manifest.json").write_text(json.dumps(manifest | {"kind": "scene"}))
    if what == "cut":
        (source / "geometry.bin").write_bytes((source / "geometry.bin").read_bytes()[:-16])
    if what == "out":
        out = tmp_path / "file" / "v"
        (tmp_path / "file").write_text("")
    if what == "large":
        monkeypatch.setattr(run, "LARGEST", 1000)
    if what == "script":
        monkeypatch.setattr(run, "SCRIPT", "none.js")
    assert main(["view", str(source), "-o", str(out), "--no-open"]) == 2
    found = capsys.readouterr().err
    assert found.startswith("viewcell: ") and found.count("\n") == 1 and "expected" in found, found
    assert not out.exists() and not list(tmp_path.glob(".*"))


def test_a_failure_leaves_the_view_that_was_there(walk, tmp_path, monkeypatch):
    out = tmp_path / "v"
    run.view(walk.folder, out)
    before = {file.name: file.read_bytes() for file in out.iterdir()}

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match="No space left"):
        run.view(walk.folder, out, overwrite=True)
    assert {file.name: file.read_bytes() for file in out.iterdir()} == before
    assert not list(tmp_path.glob(".*"))


def test_a_large_model_lies_in_chunks(walk, tmp_path, monkeypatch):
    """Chunks of a view that was there before do not stay."""
    monkeypatch.setattr(run, "STREAMED", 10_000)
    out = tmp_path / "v"
    run.view(walk.folder, out)
    names = {file.name for file in out.iterdir()} - set(FILES)
    assert len(names) > 3 and names == {f"geometry-{k}.js" for k in range(len(names))}
    (out / "geometry-999.js").write_text("of another one")
    monkeypatch.setattr(run, "STREAMED", 10_000_000)
    run.view(walk.folder, out, overwrite=True)
    assert sorted(file.name for file in out.iterdir()) == FILES
