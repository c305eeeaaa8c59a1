"""Bakes by occluders: what they hide is hidden, and both methods together are the tightest."""

import numpy as np
import pytest
from builders import random_solids
from viewcell.data.buildings.office import make_office
from viewcell.data.errors import InputError
from viewcell.data.prepared import PreparedModel
from viewcell.kernels.launch import CPU
from viewcell.solvers.visibility.aim import Sights
from viewcell.solvers.visibility.occluders import OccluderModel, seen_objects
from viewcell.verify.rays.witness import visible_rows
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.baked import load
from viewcell.workbench.cli import main
from viewcell.workbench.report.run import report

BOXES = [[1, 1, 0.3, 2, 2, 1.3], [3, 2.5, 0.4, 4.5, 3.5, 1.6], [6, 6.5, 0.5, 8, 7.5, 1.5], [2, 6, 0.2, 3, 7, 2.2]]


def write_cells(path, boxes=BOXES):
    rows = "\n".join(",".join(map(str, box)) for box in boxes)
    path.write_text(f"min_x,min_y,min_z,max_x,max_y,max_z\n{rows}\n")
    return str(path)


@pytest.fixture(scope="module")
def office():
    return make_office(floors=1, rooms_per_side=3)


@pytest.fixture(scope="module")
def shell():
    """The office without furniture."""
    return make_office(floors=1, rooms_per_side=3, furnished=False)


@pytest.fixture(scope="module")
def small_shell():
    return make_office(floors=1, rooms_per_side=1, furnished=False)


@pytest.fixture(scope="module")
def cells(tmp_path_factory):
    return write_cells(tmp_path_factory.mktemp("cells") / "cells.csv")


@pytest.fixture(scope="module")
def by_occluders(office, cells, tmp_path_factory):
    out = tmp_path_factory.mktemp("bakes") / "occluders.bake"
    return bake(office, out, settings=Settings(method="occluders", cells=cells), threads=1)


def test_no_ray_finds_what_occluders_hide(by_occluders):
    assert 0 < by_occluders.potential_objects.sum() < 0.8 * by_occluders.potential_objects.size
    assert by_occluders.verify(rays=400_000).ok


@pytest.mark.parametrize("seed", range(3))
def test_random_solids_hide_only_what_is_hidden(seed, tmp_path):
    scene = random_solids.random_solids(seed, axial=8, turned=12)
    random = np.random.default_rng(seed)
    low = random.uniform(-1, 5, (12, 3))
    boxes = np.concatenate([low, low + random.uniform(0.1, 1.5, (12, 3))], axis=1)
    settings = Settings(method="occluders", cells=write_cells(tmp_path / "cells.csv", boxes))
    made = bake(scene, tmp_path / "solids.bake", settings=settings)
    result = made.verify(rays=300_000)
    assert result.ok and made.potential_objects.sum() < made.potential_objects.size
    assert result.object_witnesses.confirmed == made.manifest["counts"]["object_pairs_seen"]


def test_no_claim_about_cells(by_occluders):
    assert not (by_occluders.folder / "cell_to_cell.parquet").exists()
    reopened = load(by_occluders.folder)
    assert not reopened.claims_cells and reopened.potential_cells.all() and reopened.cell_to_cell.num_rows == 0
    assert reopened.manifest["claims"] == ["cell_to_object"]


def test_both_is_at_least_as_tight_as_either(office, cells, by_occluders, tmp_path):
    portals, both = (
        bake(office, tmp_path / f"{method}.bake", settings=Settings(method=method, cells=cells))
        for method in ("portals", "both")
    )
    assert not (both.potential_objects & ~portals.potential_objects).any()
    assert not (both.potential_objects & ~by_occluders.potential_objects).any()
    assert both.verify(rays=100_000).ok and portals.verify(rays=100_000).ok


def test_projection_points_hide_nothing_seen_and_less_than_occluders(office, cells, by_occluders, tmp_path):
    made = bake(office, tmp_path / "v.bake", settings=Settings(method="vlod", cells=cells, clusters=6), threads=1)
    tables = by_occluders.cell_to_object, made.cell_to_object
    for rows in (visible_rows(table) for table in tables):
        assert made.potential_objects[rows["cell_id"].to_numpy(), rows["object_id"].to_numpy()].all()
    counts = made.potential_objects.sum(), by_occluders.potential_objects.sum()
    assert counts[1] < counts[0] < 0.8 * made.potential_objects.size
    assert made.verify(rays=100_000).ok


def test_both_on_portal_cells_hides_no_less_and_sees_as_much(tmp_path):
    scene = make_office(floors=1, rooms_per_side=2, furnished=False)
    portals, both = (
        bake(scene, tmp_path / f"{method}.bake", settings=Settings(method=method)) for method in ("portals", "both")
    )
    assert not (both.potential_objects & ~portals.potential_objects).any()
    assert not (both.potential_cells & ~portals.potential_cells).any()
    # Each aims at its own parts of what it could not hide, at random: a pair may be found by one only.
    seen = [bake.manifest["counts"]["object_pairs_seen"] for bake in (both, portals)]
    assert abs(seen[0] - seen[1]) < 0.005 * seen[1]
    assert both.verify(rays=100_000).ok


def test_certified_bakes_hide_no_more(office, cells, by_occluders, tmp_path):
    made = bake(office, tmp_path / "c.bake", settings=Settings(method="occluders", cells=cells, certify=True))
    assert not (by_occluders.potential_objects & ~made.potential_objects).any()
    assert {p.name for p in made.folder.glob("*.parquet")} >= {"proofs.parquet", "leaves.parquet", "occluders.parquet"}
    assert made.verify(rays=50_000).ok


def test_answers_do_not_depend_on_threads(office, cells, by_occluders, tmp_path):
    two = bake(office, tmp_path / "two.bake", settings=Settings(method="occluders", cells=cells), threads=2)
    assert two.cell_to_object.equals(by_occluders.cell_to_object)


def test_octree_refines_where_much_is_unknown_or_seen(small_shell, tmp_path):
    def made(**settings):
        settings = Settings(method="occluders", cell_size_m=6.0, **settings)
        return bake(small_shell, tmp_path / "tree.bake", settings=settings, overwrite=True)

    coarse = made(depth=0)
    triangles = small_shell.triangle_counts
    load_of = coarse.potential_objects @ triangles
    some = made(depth=1, refine_triangles=int(np.median(load_of)), refine_gap=1.0)
    assert coarse.graph.cell_count < some.graph.cell_count
    assert some.verify(rays=100_000).ok
    sizes = np.unique(np.ptp(some.graph.cells, axis=1))
    assert sizes.tolist() == [3072, 6144]
    # What was coarse enough is as it was.
    kept = [row for row, cell in enumerate(coarse.graph.cells) if (some.graph.cells == cell).all(axis=(1, 2)).any()]
    assert (load_of[kept] <= np.median(load_of)).all()


def test_an_octree_under_a_budget_keeps_what_it_did_not_reach(small_shell, tmp_path):
    settings = Settings(method="occluders", cell_size_m=8.0, depth=1, refine_triangles=1)
    made = bake(small_shell, tmp_path / "tree.bake", settings=settings, budget_s=1e-6)
    assert made.manifest["budget_spent"] and made.potential_objects.all()
    bake(small_shell, tmp_path / "tree.bake", settings=settings, budget_s=0.4)
    again = bake(small_shell, tmp_path / "tree.bake", settings=settings)
    assert not again.manifest["budget_spent"] and not again.potential_objects.all()
    whole = bake(small_shell, tmp_path / "whole.bake", settings=settings)
    assert again.cell_to_object.equals(whole.cell_to_object)


def test_a_spent_budget_is_told_without_refinement(shell, tmp_path):
    settings = Settings(method="occluders", cell_size_m=8.0, depth=0)
    assert bake(shell, tmp_path / "tree.bake", settings=settings, budget_s=1e-6).manifest["budget_spent"]


def test_a_scene_without_solids_is_baked_with_a_warning(tmp_path, capsys):
    mesh = random_solids.box([0, 0, 0], [4, 4, 3])
    mesh.update_faces(np.arange(len(mesh.faces)) > 1)
    chair = random_solids.box([6, 1, 0], [7, 2, 1])
    chair.update_faces(np.arange(len(chair.faces)) > 1)
    cells = write_cells(tmp_path / "cells.csv", [[1, 1, 1, 2, 2, 2]])
    scene = random_solids.scene_of_meshes([mesh, chair])
    made = bake(scene, tmp_path / "open.bake", settings=Settings(method="occluders", cells=cells))
    assert "no closed opaque solid" in made.manifest["warnings"][0]
    assert made.verify(rays=100_000).ok


@pytest.mark.parametrize("damage", ["inverted", "doubled", "crossing", "torn"])
def test_damaged_meshes_lose_occlusion_never_safety(damage, tmp_path):
    wall, chair = random_solids.box([0, 0, 0], [0.2, 4, 3]), random_solids.box([2, 1.5, 0], [2.5, 2, 0.5])
    if damage == "inverted":
        wall.invert()
    elif damage == "doubled":
        wall = wall + wall
    elif damage == "crossing":
        wall = wall + random_solids.box([-0.1, 1, 1], [0.1, 3, 2])
    else:
        wall.update_faces(np.arange(len(wall.faces)) % 5 > 0)
    cells = write_cells(tmp_path / "cells.csv", [[-2, 1, 0.5, -1, 2, 1.5], [-1.5, 1, 0.2, 1.5, 3, 2]])
    scene = random_solids.scene_of_meshes([wall, chair])
    made = bake(scene, tmp_path / "damaged.bake", settings=Settings(method="occluders", cells=cells))
    assert made.verify(rays=100_000).ok
    assert made.potential_objects[0, 1] == (damage == "torn")


@pytest.mark.parametrize(
    ("settings", "wanted"),
    [
        ({"method": "shadows"}, "method: expected auto"),
        ({"method": "occluders", "cell_size_m": 0.0}, "cell size"),
        ({"method": "occluders", "cell_size_m": 1e-3}, "cell size"),
        ({"depth": 40}, "depth"),
        ({"refine_gap": -1.0}, "refine-gap"),
        ({"refine_triangles": 0}, "refine-triangles"),
        ({"method": "occluders", "cells": "nowhere.parquet"}, "nowhere.parquet"),
        ({"method": "vlod", "clusters": 5}, "clusters"),
        ({"method": "vlod", "resolution": 100}, "resolution: expected a power of two"),
    ],
)
def test_unusable_settings_are_refused(office, settings, wanted, tmp_path):
    with pytest.raises(InputError, match=wanted):
        bake(office, tmp_path / "no.bake", settings=Settings(**settings))
    assert not list(tmp_path.iterdir())


def test_the_method_of_projection_points_wants_view_cells(office, tmp_path):
    with pytest.raises(InputError, match="cells: expected octree, walkways or a table"):
        bake(office, tmp_path / "no.bake", settings=Settings(method="vlod", cells="portals"))


def test_bare_graphs_have_no_occluders(graph, tmp_path, capsys):
    assert main(["bake", str(graph), "--method", "occluders", "--out", str(tmp_path / "no.bake")]) == 2
    assert "expected a model for occluders" in capsys.readouterr().err


def test_an_eye_beside_a_wall_sees_along_it():
    """A view cell that touches the wall's face: the wall hides what is behind it, and not what stands before it."""
    wall, behind, before = (
        random_solids.box(*b) for b in (([0, 0, 0], [0.2, 9, 9]), ([2, 4, 4], [3, 5, 5]), ([-3, 4, 4], [-2.5, 5, 5]))
    )
    scene = random_solids.scene_of_meshes([wall, behind, before])
    cells = np.array([[[-1024, 4096, 4096], [0, 5120, 5120]]], np.int32)
    model = OccluderModel.of(Sights.of(PreparedModel(scene), cells, 0, CPU))
    rows, _ = seen_objects(model, np.array([0]))
    assert rows.target.tolist() == [0, 2] and rows.seen.all()


def test_report_shows_shrunk_occluders(by_occluders, tmp_path):
    text = report(by_occluders, cells=[0], out=tmp_path / "report").read_text()
    assert (tmp_path / "report" / "cell-0.png").stat().st_size > 20_000
    assert "shrinks them for projection points" in text and "Storeys" not in text


def test_auto_takes_an_octree_for_very_large_models(tmp_path, monkeypatch):
    monkeypatch.setattr("viewcell.workbench.bake.cells.PORTAL_TRIANGLES", 10)
    floor, crate = random_solids.box([0, 0, -0.2], [9, 9, 0]), random_solids.box([4, 4, 0], [5, 5, 2.5])
    made = bake(random_solids.scene_of_meshes([floor, crate]), tmp_path / "open.bake", settings=Settings(depth=0))
    assert made.manifest["inhabitable_because"] == "octree" and not made.claims_cells
    assert made.verify(rays=50_000).ok


def test_back_faces_are_counted_apart(by_occluders):
    counts = by_occluders.manifest["counts"]
    sizes = by_occluders.scene.triangle_counts
    assert counts["potential_triangles"] == (by_occluders.potential_objects @ sizes).sum()
    assert 0.05 < counts["back_facing_triangles"] / counts["potential_triangles"] < 0.6


@pytest.mark.parametrize("method", ["portals", "both"])
def test_view_cells_beyond_the_portal_graph_are_refused(shell, method, tmp_path):
    cells = write_cells(tmp_path / "cells.csv", [BOXES[0], [-6, 2, 1, -5, 3, 2]])
    with pytest.raises(InputError, match=r"within 2 m of the model, found cell 1 beyond"):
        bake(shell, tmp_path / "no.bake", settings=Settings(method=method, cells=cells))
    made = bake(shell, tmp_path / "yes.bake", settings=Settings(method="occluders", cells=cells))
    assert made.verify(rays=100_000).ok and made.potential_objects[1].any()
