"""What users install holds everything that runs here, and nothing else."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import viewcell
from builders.places import ROOT

HOUSE = ("data", "kernels", "solvers", "verify", "workbench")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Names of the files in a wheel that is built from a copy, with the setuptools that is installed."""
    tmp = tmp_path_factory.mktemp("wheel")
    clutter = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name in HOUSE:
        shutil.copytree(ROOT / name, tmp / "source" / name, ignore=clutter)
    for file in (*ROOT.glob("*.py"), *(ROOT / name for name in ("py.typed", "pyproject.toml", "README.md", "LICENSE"))):
        shutil.copy(file, tmp / "source")
    build = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index", "-q"]
    subprocess.run([*build, "-w", tmp, tmp / "source"], check=True, capture_output=True, cwd=tmp)
    (built,) = tmp.glob("viewcell-*.whl")
    return {Path(name) for name in zipfile.ZipFile(built).namelist()}


def test_every_file_of_the_house_is_in_the_wheel(wheel):
    files = [*ROOT.glob("*.py"), ROOT / "py.typed"]
    files += [file for name in HOUSE for file in (ROOT / name).rglob("*") if file.is_file()]
    house = {"viewcell" / file.relative_to(ROOT) for file in files if "__pycache__" not in file.parts}
    assert sorted(map(str, house - wheel)) == []


def test_nothing_else_is(wheel):
    assert {file.parts[0] for file in wheel} == {"viewcell", f"viewcell-{viewcell.__version__}.dist-info"}
    assert not [file for file in wheel if "tests" in file.parts]
