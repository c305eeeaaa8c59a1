import os
import shutil
from pathlib import Path

import pytest
from builders import four_rooms
from hypothesis import settings
from viewcell.workbench.cli import main

settings.register_profile("dev", max_examples=60, deadline=None)
settings.register_profile("ci", max_examples=60, derandomize=True, deadline=None)
settings.register_profile("nightly", max_examples=20_000, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE") or ("ci" if os.environ.get("CI") else "dev"))


@pytest.fixture(scope="module")
def graph(tmp_path_factory):
    return four_rooms.write_graph(tmp_path_factory.mktemp("graph") / "rooms")


@pytest.fixture(scope="module")
def baked(graph, tmp_path_factory):
    """A finished bake of the four rooms; tests copy it before they change it."""
    out = tmp_path_factory.mktemp("baked") / "rooms.bake"
    assert main(["bake", str(graph), "--out", str(out), "--no-progress"]) == 0
    return out


@pytest.fixture
def copy(baked, tmp_path):
    return Path(shutil.copytree(baked, tmp_path / "copy.bake"))
