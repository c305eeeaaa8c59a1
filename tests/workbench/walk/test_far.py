"""Depth meshes on a walk: in place of what stands on them, in view where they may show something, true, and counted."""

from dataclasses import replace

import numpy as np
import pytest
from builders.far_bake import CELLS, far_bake, far_walk
from viewcell.data.camera import CameraPath, Screen
from viewcell.data.depth_meshes import FACES
from viewcell.data.errors import InputError
from viewcell.kernels.raster import Images
from viewcell.solvers.walk.policies import NEAR_SHARE
from viewcell.workbench.cli import main
from viewcell.workbench.walk.display import Display
from viewcell.workbench.walk.far import NONE, FarFaces
from viewcell.workbench.walk.level_choice import LevelChoice
from viewcell.workbench.walk.opened import opened
from viewcell.workbench.walk.pages import walk_json
from viewcell.workbench.walk.run import walk
from viewcell.workbench.walk.settings import WalkSettings
from viewcell.workbench.walk.tables import walk_text
from viewcell.workbench.walk.truth import Judge

SCREEN = Screen(96, 72)
SETTINGS = WalkSettings(cache_bytes=2_000_000, screen=SCREEN, target_ms=1000.0)


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    folder = tmp_path_factory.mktemp("far")
    return far_walk(folder, far_bake(folder))


def path_of(count=24, seed=0):
    """Eyes that go from one view cell to the other, and look around."""
    rng, share = np.random.default_rng(seed), np.linspace(0, 1, count)[:, None]
    eyes = np.array([[-1.9, -0.9, -0.9]]) + share * np.array([[3.8, 1.8, 1.8]])
    return CameraPath(eyes, rng.uniform(-180, 180, count), rng.uniform(-60, 60, count), np.arange(count) / 10)


@pytest.fixture(scope="module")
def walked(balls):
    return walk(balls, path_of(), settings=replace(SETTINGS, policy="all"), check=6)


def test_the_nearest_view_cell_s_are_drawn(balls):
    far = FarFaces(balls, True)
    both = np.array([0, 1])
    assert far.row(np.array([-1.0, 0, 0]), both) == 0 and far.row(np.array([0.4, 0, 0]), both) == 1
    assert far.row(np.array([0.4, 0, 0]), both[:1]) == 0 and far.row(np.zeros(3), both[:0]) == NONE
    assert FarFaces(balls, False).row(np.zeros(3), both) == NONE


def test_what_stands_on_them_is_left_out(balls):
    far, index = FarFaces(balls, True), balls.depth_meshes
    for row in range(2):
        objects, levels = far.near(row, np.arange(40))
        near, own = index.near_levels(row)
        assert np.array_equal(objects, near) and np.array_equal(levels, own)
        assert len(far.near(row, index.far.of(row))[0]) == 0
    objects, levels = far.near(NONE, np.arange(40))
    assert len(objects) == 40 and not levels.any()


def test_a_face_is_in_view_wherever_a_texel_of_it_is(balls):
    """Points of all texels, at any depth from the cull box on, from eyes anywhere in the cell."""
    far, index, rng = FarFaces(balls, True), balls.depth_meshes, np.random.default_rng(0)
    left_out = 0
    for _ in range(200):
        row = int(rng.integers(2))
        eye = rng.uniform(*(CELLS[row] / 1024))
        axes = CameraPath(eye[None], rng.uniform(-180, 180, 1), rng.uniform(-89, 89, 1), np.zeros(1)).axes()[0]
        found = far.in_view(row, eye, axes, SCREEN) - far.first - 6 * row
        assert ((found >= 0) & (found < 6)).all()
        for face in np.setdiff1d(np.arange(6), found):
            left_out += 1
            aside = np.column_stack([rng.uniform(-1, 1, (500, 2)), np.ones(500)]) @ FACES[face]
            depth = index.cull_boxes[row] / 2 * rng.exponential(4, 500).clip(1)
            right, up, ahead = ((aside * depth[:, None] + index.middles[row] - eye) @ axes.T).T
            shown = (np.abs(right) <= ahead * SCREEN.width / 2 / SCREEN.focal) & (
                np.abs(up) <= ahead * SCREEN.height / 2 / SCREEN.focal
            )
            assert not shown.any()
    assert left_out > 300


def test_sets_have_faces_in_their_place(balls):
    far, index = FarFaces(balls, True), balls.depth_meshes
    starts, members = balls.potential.ids()
    starts, members, limits = far.sets(np.array([0, 1]), starts, members, balls.limits.astype(np.int64))
    for row in range(2):
        own = slice(starts[row], starts[row + 1])
        near, levels = index.near_levels(row)
        assert members[own].tolist() == [*near.tolist(), *(far.first + 6 * row + np.arange(6)).tolist()]
        assert limits[own].tolist() == [*levels.tolist(), *([0] * 6)]
    plain = balls.potential.ids()
    same = FarFaces(balls, False).sets(np.array([0, 1]), *plain, balls.limits.astype(np.int64))
    assert all(np.array_equal(a, b) for a, b in zip(same, (*plain, balls.limits), strict=True))


def test_a_walk_is_true_and_says_what_they_took(walked, balls):
    assert walked.ok and len(walked.truths) == 4
    for truth in walked.truths:
        assert len(truth.frames) >= 4
        # Balls are simplified, and texels are larger than pixels; what is drawn is the picture all the same.
        assert np.mean([one.other / one.pixels for one in truth.frames if not one.missing]) < 0.05
    text = walk_text(walked)
    assert "Aliaga et al. 1999, Table 1: reduction of polygons" in text and "depth meshes' own" in text
    shown, index = walked.shown, balls.depth_meshes
    assert (shown["near_polygons"] < shown["set_polygons"]).all() and (shown["mesh_polygons"] > 0).all()
    assert shown["mesh_polygons"].max() <= index.faces.sum(axis=1).max()
    assert walked.model.polygons == 40 * 1280 and walked.model.depth_bytes == index.sizes.sum()
    assert any("Aliaga" in one["title"] for one in walk_json(walked)["tables"])
    assert f"depth meshes of {index.sizes.sum():,} bytes" in text
    for one in walked.arrivals:
        assert (one.asked >= one.oracle).all()


def test_no_level_is_finer_than_the_view_cell_s(balls):
    far, path, coarser = FarFaces(balls, True), path_of(60), 0
    display = Display(balls, SCREEN, LevelChoice(), 1000.0, far)
    for frame in range(60):
        shown = display.frame(path, frame, np.array([0]))
        own = shown.objects < far.first
        levels = far.near(0, shown.objects[own])[1]
        assert (shown.lods[own] >= levels).all() and (shown.limits[own] >= levels).all()
        coarser += int((display.limits(path.eyes[frame], shown.objects[own]) < levels).sum())
    assert coarser


def test_without_them_all_is_geometry(balls):
    plain = walk(balls, path_of(), settings=replace(SETTINGS, depth_meshes=False), check=3)
    assert plain.ok and not plain.shown["mesh_polygons"].any()
    assert np.array_equal(plain.shown["near_polygons"], plain.shown["set_polygons"])
    assert "Aliaga" not in walk_text(plain)


def test_a_picture_shows_what_texels_show(balls):
    """From the middle of a cell, towards what is near, as the whole model does but for a texel's worth at edges."""
    middle, (near, _) = balls.depth_meshes.middles[0], balls.depth_meshes.near_levels(0)
    right, up = np.eye(3)[0], np.eye(3)[2]
    ways = balls.boxes[near].mean(axis=1) * balls.grid_m - middle
    to = ways[np.linalg.norm(ways, axis=1).argmin()]
    yaw = np.degrees(np.arctan2(to[1], to @ right))
    pitch = np.degrees(np.arcsin(to @ up / np.linalg.norm(to)))
    still = CameraPath(np.repeat(middle[None], 4, axis=0), np.full(4, yaw), np.full(4, pitch), np.arange(4) / 10)
    found = walk(balls, still, settings=replace(SETTINGS, cache_bytes=9_000_000, read_bytes=9_000_000), check=4)
    first = found.truths[0].frames[0]
    assert first.missing == first.seen > 3, "nothing has arrived in the first frame"
    last = found.truths[0].frames[-1]
    assert last.missing == 0 and 0 < last.other < 0.03 * last.pixels


def test_mmr_s_second_cache_is_for_them(balls):
    tour_settings = replace(SETTINGS, policy="mmr")
    found = walk(balls, path_of(), settings=tour_settings)
    assert found.policies[0].columns["claimed"].max() <= SETTINGS.cache_bytes
    size = balls.depth_meshes.sizes[0].sum()
    with pytest.raises(InputError, match="cache: expected at least") as error:
        walk(balls, path_of(), settings=replace(tour_settings, cache_bytes=int(size // 4)))
    least = int(str(error.value).split("at least ")[1].split(" bytes")[0].replace(",", ""))
    assert least <= np.ceil(balls.depth_meshes.sizes.sum(axis=1).max() / (1 - NEAR_SHARE))


def test_real_time_draws_them(balls, tmp_path):
    told = ["--frames", "3", "--image", "64x48", "--real-time", "-o", str(tmp_path / "a"), "--json"]
    assert main(["walk", str(balls.folder), *told]) == 0
    assert "Aliaga" in (tmp_path / "a" / "walk.json").read_text()


def test_an_object_that_is_lost_is_found_out(balls, monkeypatch):
    """One that stands on no mesh, and is in no picture."""
    near = FarFaces.near

    def lossy(self, row, objects):
        kept, levels = near(self, row, objects)
        return kept[1:], levels[1:]

    monkeypatch.setattr(FarFaces, "near", lossy)
    assert not walk(balls, path_of(60), settings=SETTINGS, check=30).ok


def test_geometry_before_meshes_hides_them(balls):
    """A wall before half of a picture, nearer than the cull box, and one behind all."""
    far, path = FarFaces(balls, True), CameraPath(balls.depth_meshes.middles[:1], *np.zeros((3, 1)))
    faces, shape = far.first + np.arange(6), (1, SCREEN.height, SCREEN.width)
    with opened(balls, 10.0) as found:
        judge = Judge(found, path, Display(balls, SCREEN, LevelChoice(), 1000.0, far))
        inverse = np.full(shape, 1e-9)
        open_picture = judge._with_meshes(0, Images(np.full(shape, 77), np.zeros(1), inverse), faces, 0)
        inverse[..., : SCREEN.width // 2] = 1.0 / 1024
        half = judge._with_meshes(0, Images(np.full(shape, 77), np.zeros(1), inverse), faces, 0)
    shown = open_picture != 77
    assert shown[:, : SCREEN.width // 2].any() and np.isin(open_picture[shown], balls.depth_meshes.far.of(0)).all()
    assert (half[:, : SCREEN.width // 2] == 77).all()
    assert np.array_equal(half[:, SCREEN.width // 2 :], open_picture[:, SCREEN.width // 2 :])
