"""What type checkers and editors make of viewcell in a user's hands."""

import subprocess
import sys

import jedi
import pytest
from builders.places import ROOT

SCRIPT = ROOT / "tests/typing/user_script.py"
COMMANDS = {
    "mypy": ["mypy", "--strict", "--cache-dir", "cache"],
    # Pyright, with its rules, in a package that brings its own Node.
    "pyright": ["basedpyright", "--level", "error", "--pythonpath", sys.executable],
}


def checked(checker, folder, text):
    (folder / "pyrightconfig.json").write_text('{"typeCheckingMode": "standard"}')
    (folder / "script.py").write_text(text, encoding="utf-8")
    command = COMMANDS[checker]
    return subprocess.run(
        [sys.executable, "-m", *command, "script.py"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.parametrize("checker", COMMANDS)
def test_a_users_script_is_right_and_a_wrong_one_is_told(checker, tmp_path):
    text = SCRIPT.read_text(encoding="utf-8")
    found = checked(checker, tmp_path, text)
    assert found.returncode == 0, found.stdout
    # A setting that is none, an argument of another type, an answer taken for something else.
    for right, wrong in (
        ("certify=False", "certifies=False"),
        ("rays=100_000", "rays='many'"),
        ("cell: int", "cell: str"),
    ):
        assert right in text
        text = text.replace(right, wrong, 1)
    found = checked(checker, tmp_path, text)
    assert found.returncode == 1 and "3 errors" in found.stdout


def test_editors_complete():
    def names(text):
        lines = text.split("\n")
        return {found.name for found in jedi.Script(text, path=ROOT / "script.py").complete(len(lines), len(lines[-1]))}

    assert {"bake", "load", "read", "check", "Settings"} <= names("import viewcell\nviewcell.")
    wanted = {"cell_at", "potential", "seen", "unknown", "witness", "objects", "rooms", "verify", "report", "scene"}
    assert wanted <= names("import viewcell\nviewcell.load('house.bake').")


def test_the_script_stays_short():
    assert len(SCRIPT.read_text(encoding="utf-8").splitlines()) <= 65
