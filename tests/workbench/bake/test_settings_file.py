"""Settings files: what whoever bakes with one is told of it."""

import json

import pytest
from viewcell.data.errors import InputError
from viewcell.workbench.bake.settings_file import read_settings
from viewcell.workbench.cli import main


def written(tmp_path, content):
    path = tmp_path / "s.json"
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize("content", [{"method": "vlod"}, {"tuned": "lod", "settings": {"method": "vlod"}, "lod": {}}])
def test_a_file_that_changes_the_method_says_so(tmp_path, content):
    assert read_settings(written(tmp_path, content)).line == "Changes the method from auto, the default, to vlod."


@pytest.mark.parametrize("content", [{}, {"seed": 7}, {"method": "auto"}, {"tuned": "lod", "settings": {"seed": 7}}])
def test_another_file_says_nothing(tmp_path, content):
    assert read_settings(written(tmp_path, content)).line == ""


def test_what_a_tune_file_says_is_told_in_one_line(tmp_path):
    content = {"says": "Sets\n--threshold 4.", "tuned": "bake", "settings": {"method": "both"}, "default": {"later": 1}}
    assert read_settings(written(tmp_path, content)).line == "Sets --threshold 4."
    with pytest.raises(InputError, match="expected text as says, found int"):
        read_settings(written(tmp_path, content | {"says": 3}))


def test_a_bake_says_first_what_its_settings_file_does(graph, tmp_path, capsys):
    path = written(tmp_path, {"says": "Changes the method.", "tuned": "bake", "settings": {"method": "portals"}})
    out = tmp_path / "g.bake"
    assert main(["bake", str(graph), "-o", str(out), "--settings", str(path), "--no-progress"]) == 0
    assert capsys.readouterr().out.startswith(f"{path}: Changes the method.\n")
