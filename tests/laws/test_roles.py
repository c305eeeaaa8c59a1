"""What stops sight and what does not: a screen before a target, by every role, in the eyes of all who judge."""

import numpy as np
import pyarrow as pa
import pytest
import trimesh
from builders import random_solids
from builders.small_house import sets_of
from viewcell.data.frame import in_frame
from viewcell.data.scene import Role
from viewcell.data.store.scene_folder import write_scene
from viewcell.solvers.visibility.aim import Sights
from viewcell.verify.proofs.line_tree import check_certificates
from viewcell.workbench import verify as workbench_verify
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.check.folder import replay, write_check
from viewcell.workbench.check.run import check
from viewcell.workbench.verify import seen_by_rays, verify_bake

OPAQUE = (Role.OCCLUDER, Role.DETAIL)
CELLS = {
    "min_x": [-1.0], "min_y": [0.0], "min_z": [0.0], "max_x": [0.0], "max_y": [1.0], "max_z": [1.0]
}  # fmt: skip
SCREEN, TARGET, FLOOR = range(3)


def scene(role, turned=False):
    """A screen of 20 m, a small target behind it, and a floor, which no sightline between them meets."""
    screen = random_solids.box([2, -10, -10], [2.2, 10, 10])
    if turned:
        screen.apply_transform(trimesh.transformations.rotation_matrix(0.3, [0, 0, 1], [2, 0, 0]))
    meshes = [screen, random_solids.box([5, 0.2, 0.2], [5.5, 0.8, 0.8]), random_solids.box([-3, -9, -9], [9, 9, -8])]
    return random_solids.scene_of_meshes(meshes, [role, Role.DETAIL, Role.OCCLUDER])


@pytest.fixture
def cells(tmp_path):
    path = tmp_path / "cells.csv"
    path.write_text("\n".join([",".join(CELLS), ",".join(str(column[0]) for column in CELLS.values())]) + "\n")
    return str(path)


@pytest.fixture(params=["looked at", "blind"])
def looked_at(request, monkeypatch):
    """With witnesses, which keep what is seen, and without any: then only proofs decide."""
    if request.param == "blind":
        monkeypatch.setattr(Sights, "aim", lambda *_: None)


@pytest.mark.usefixtures("looked_at")
@pytest.mark.parametrize(("turned", "yaw"), [(False, "auto"), (True, "0"), (True, "auto")])
@pytest.mark.parametrize("method", ["portals", "occluders", "both", pytest.param("vlod", marks=pytest.mark.slow)])
@pytest.mark.parametrize("role", Role)
def test_a_bake_hides_behind_what_is_opaque_only(role, method, turned, yaw, cells, tmp_path):
    """Portals alone do not know what is oblique; in its own frame only a screen that is a wall is not."""
    settings = Settings(method=method, cells=cells, resolution=64, yaw=yaw)
    made = bake(scene(role, turned), tmp_path / "b", settings=settings, threads=1)
    oblique = turned and (yaw == "0" or role is not Role.OCCLUDER)
    hides = role in OPAQUE and not (oblique and method == "portals")
    assert made.potential_objects[0].tolist() == [True, not hides, True]
    assert verify_bake(made, rays=4000).ok


@pytest.mark.usefixtures("looked_at")
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("role", Role)
def test_certificates_are_about_what_is_opaque_only(role, turned, cells, tmp_path):
    settings = Settings(method="occluders", cells=cells, certify=True)
    made = bake(scene(role, turned), tmp_path / "b", settings=settings, threads=1)
    assert made.potential_objects[0, TARGET] == (role not in OPAQUE)
    found = check_certificates(made)
    assert found.failed == 0 and found.covered == (role in OPAQUE)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("role", Role)
def test_what_has_become_glass_proves_nothing(role, turned, cells, tmp_path):
    settings = Settings(method="occluders", cells=cells, certify=True)
    made = bake(scene(Role.OCCLUDER, turned), tmp_path / "b", settings=settings, threads=1)
    made.__dict__["scene"] = in_frame(scene(role, turned), made.scene.yaw_deg)
    assert (check_certificates(made).failed > 0) == (role not in OPAQUE)


@pytest.mark.parametrize("role", Role)
def test_verify_accuses_only_where_nothing_opaque_is_in_the_way(role, cells, tmp_path, monkeypatch):
    made = bake(scene(role), tmp_path / "b", settings=Settings(method="occluders", cells=cells), threads=1)
    made.__dict__["object_sets"] = sets_of(np.array([[True, False, True]]))
    keep = np.array(made.cell_to_object["object_id"].to_numpy() != TARGET)
    made.__dict__["cell_to_object"] = made.cell_to_object.filter(pa.array(keep))
    result = verify_bake(made, rays=4000)
    assert result.wrong_hidden == (role not in OPAQUE)
    if not result.wrong_hidden:
        assert result.ok
    # The rays that are guided, alone.
    monkeypatch.setattr(workbench_verify, "_cast_all", lambda *_: 0.0)
    assert verify_bake(made, rays=4000).wrong_hidden == (role not in OPAQUE)
    monkeypatch.undo()
    assert seen_by_rays(made, 4000)[1][0].tolist() == [True, role not in OPAQUE, True]


@pytest.mark.parametrize("role", Role)
def test_check_accuses_only_where_nothing_opaque_is_in_the_way(role, tmp_path):
    claims = pa.table({"cell_id": [0, 0], "object_id": [SCREEN, FLOOR]})
    result = check(scene(role), claims, pa.table(CELLS), rays=20_000)
    assert [(wrong.cell, wrong.target) for wrong in result.wrong] == [(0, TARGET)] * (role not in OPAQUE)
    # What is claimed beyond need is only loose, and nobody saw it.
    everything = check(scene(role), np.ones((1, 3), bool), pa.table(CELLS), rays=20_000)
    assert everything.ok and everything.seen["object"][0].tolist() == [True, role not in OPAQUE, True]
    if result.wrong:
        assert result.wrong[0].margin > 0 and SCREEN not in [k for k, _ in result.wrong[0].nearest]


@pytest.mark.parametrize("role", OPAQUE)
def test_a_finding_is_judged_again_by_what_is_opaque(role, tmp_path):
    """Found without the screen, played back with it: no longer visible, whatever its role."""
    claims = pa.table({"cell_id": [0, 0], "object_id": [SCREEN, FLOOR]})
    for name, kind in (("glass", Role.TRANSPARENT), ("opaque", role)):
        write_scene(scene(kind), tmp_path / name)
    result = check(tmp_path / "glass", claims, pa.table(CELLS), rays=20_000)
    write_check(result, tmp_path / "found")
    assert replay(tmp_path / "found")[0] == 1
    assert replay(tmp_path / "found", tmp_path / "opaque")[0] == 0
