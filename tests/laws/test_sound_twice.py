"""Every awkward file, read twice: the same in another process, and a bake of it that stands its own check."""

import hashlib
import os
import subprocess
import sys

import pytest
from builders.awkward import IFC_CASES
from builders.places import ROOT
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.workbench.bake.run import bake
from viewcell.workbench.check.run import check

SUFFIXES = (".obj", ".gltf", ".glb", ".ply", ".stl", ".ifc")
REFUSED = {"cut", "noproject", "stray", "gltf_unknown_required", "gltf_draco", "gltf_draco_one", "gltf_meshopt"}
FILES = [
    path for folder in (IFC_CASES.parent, IFC_CASES) for path in sorted(folder.glob("*")) if path.suffix in SUFFIXES
]
pytestmark = [pytest.mark.slow, pytest.mark.skipif(not FILES, reason=f"{IFC_CASES.parent} is missing")]


def digest(path):
    """Hash of everything that a table of objects says, and of the triangles; or what the reader says instead."""
    try:
        scene = read(path)
    except InputError:
        return "refused"
    told = [(o.name, o.kind, o.role.value, o.guid, o.definition_id, o.transform.tolist()) for o in scene.objects]
    rooms = [(space.name, space.vertices.tolist()) for space in scene.spaces]
    said = repr((told, rooms, scene.sha256, scene.origin.tolist(), scene.skipped, scene.notes)).encode()
    return hashlib.sha256(said + scene.triangles()[0].tobytes()).hexdigest()


@pytest.fixture(scope="module")
def elsewhere():
    """Digests of all files in a process of another hash seed."""
    code = (
        "from laws.test_sound_twice import FILES, digest\nfor path in FILES: print('digest', path.name, digest(path))"
    )
    told = {"PYTHONHASHSEED": "7", "PYTHONPATH": str(ROOT / "tests")}
    made = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | told, capture_output=True, text=True, check=True
    )
    lines = [line.rsplit(" ", 1) for line in made.stdout.splitlines() if line.startswith("digest ")]
    return {name.removeprefix("digest "): found for name, found in lines}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_what_is_read_twice_is_the_same_and_sound(path, elsewhere, tmp_path):
    assert elsewhere[path.name] == digest(path)
    assert (elsewhere[path.name] == "refused") == (path.stem in REFUSED)
    if path.stem in REFUSED:
        return
    try:
        made = bake(path, tmp_path / "b", threads=1)
    except InputError as error:
        assert "inhabitable cell" in str(error)
        return
    assert check(path, made.folder, made.folder, rays=50_000).ok
    before = (made.folder / "manifest.json").stat().st_mtime_ns
    bake(path, tmp_path / "b", threads=1)
    assert (made.folder / "manifest.json").stat().st_mtime_ns == before
