"""Curtains of a model: each is opaque by the checker that shares nothing with what found it."""

import numpy as np
import pytest
import trimesh
from builders import random_solids
from shapely.geometry import Polygon
from viewcell.data import curtains
from viewcell.data.curtains import FALLING, clearly_missed, crossed, find_curtains, meeting
from viewcell.data.prepared import PreparedModel
from viewcell.data.scene import GRID_M
from viewcell.data.solids import rays_wind, winding_numbers
from viewcell.verify.proofs.curtain import is_opaque
from viewcell.verify.proofs.opaque import OpaqueSurfaces


def upright(mesh, yaw_deg, place=(0.0, 0.0, 0.0)):
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(yaw_deg), [0, 0, 1]))
    mesh.apply_translation(place)
    return mesh


def frame(low, high, hole_low, hole_high, yaw_deg):
    """A wall of thickness y with a window, as one closed element."""
    xs, zs = [low[0], hole_low[0], hole_high[0], high[0]], [low[2], hole_low[1], hole_high[1], high[2]]
    cells = [(i, k) for i in range(3) for k in range(3) if (i, k) != (1, 1)]
    triangles = []
    for i, k in cells:
        box = random_solids.box([xs[i], low[1], zs[k]], [xs[i + 1], high[1], zs[k + 1]])
        triangles.append(box.triangles)
    soup = np.concatenate(triangles)
    # Faces that two cells share are inside the wall: they stand there twice.
    keys = [tuple(np.round(t.mean(axis=0), 6)) for t in soup]
    middles = {}
    for n, t in enumerate(soup):
        corners = np.round(t, 6)
        axis = int((np.ptp(corners, axis=0) == 0).argmax())
        middles.setdefault((axis, corners[0, axis], *np.sort(corners, axis=0).ravel()), []).append(n)
    assert keys
    kept = [n for group in middles.values() if len(group) == 1 for n in group]
    mesh = trimesh.Trimesh(soup[kept].reshape(-1, 3), np.arange(3 * len(kept)).reshape(-1, 3))
    mesh.merge_vertices()
    return upright(mesh, yaw_deg)


def scenes():
    for yaw in (1, 17, 30, 45, 61.3, 89):
        yield (
            f"walls at {yaw}",
            [
                upright(random_solids.box([0, 0, 0], [5, 0.2, 3]), yaw),
                upright(random_solids.box([4.8, 0.2, 0], [5, 4, 3]), yaw),
                upright(random_solids.box([1, 2, 0], [2, 4, 1]), yaw + 10),
            ],
        )
    yield "a wall with a window", [frame([0, 0, 0], [6, 0.3, 3], [2, 1], [3.5, 2.2], 23.0)]
    yield "a round column", [trimesh.creation.cylinder(0.5, 3.0, sections=16)]
    yield (
        "a mitred wall",
        [
            trimesh.creation.extrude_polygon(_polygon([[0, 0], [4, 3], [3.6, 3.2], [0.1, 0.5]]), 2.5),
        ],
    )
    yield "leaning", [upright(random_solids.box([0, 0, 0], [3, 0.3, 3]), 20).apply_transform(
        trimesh.transformations.rotation_matrix(0.3, [1, 0, 0]))]  # fmt: skip


def _polygon(points):
    from shapely import Polygon

    return Polygon(points)


def opaque(curtains, surfaces):
    """Which curtains are opaque by the checker."""
    found = []
    for (low, high), axis in zip(curtains.boxes.tolist(), curtains.axis.tolist(), strict=True):
        a, b = [low[0], low[1]], [high[0], high[1]]
        if axis == FALLING:
            a, b = [low[0], high[1]], [high[0], low[1]]
        found.append(is_opaque(surfaces, [a, b], low[2], high[2]))
    return found


@pytest.mark.parametrize(("name", "meshes"), list(scenes()), ids=[name for name, _ in scenes()])
def test_every_curtain_is_opaque(name, meshes):
    scene = random_solids.scene_of_meshes(meshes)
    curtains = PreparedModel(scene).curtains
    assert name == "leaning" or len(curtains.axis) > 3
    assert all(opaque(curtains, OpaqueSurfaces(*scene.triangles())))


def test_a_wall_with_a_window_has_no_curtain_over_it_and_some_beside():
    scene = random_solids.scene_of_meshes([frame([0, 0, 0], [6, 0.3, 3], [2, 1], [3.5, 2.2], 23.0)])
    boxes = PreparedModel(scene).curtains.boxes * GRID_M
    tall = boxes[(boxes[:, 1, 2] - boxes[:, 0, 2]) > 2.5]
    length = np.hypot(*(tall[:, 1] - tall[:, 0])[:, :2].T)
    assert len(tall) and length.max() < 2.6 and length.max() > 1.5


def test_open_elements_have_curtains_on_their_faces_only():
    mesh = upright(random_solids.box([0, 0, 0], [5, 0.5, 3]), 17)
    top = np.flatnonzero(mesh.face_normals[:, 2] > 0.5)
    mesh.update_faces(np.arange(len(mesh.faces)) != top[0])
    scene = random_solids.scene_of_meshes([mesh])
    curtains = PreparedModel(scene).curtains
    assert len(curtains.axis) == 4 and all(opaque(curtains, OpaqueSurfaces(*scene.triangles())))


def test_curtains_reach_nearly_from_end_to_end():
    scene = random_solids.scene_of_meshes([upright(random_solids.box([0, 0, 0], [5, 0.2, 3]), 17)])
    boxes = PreparedModel(scene).curtains.boxes * GRID_M
    assert np.hypot(*(boxes[:, 1] - boxes[:, 0])[:, :2].T).max() > 4.95
    assert (boxes[:, 1, 2] - boxes[:, 0, 2]).max() == 3.0


def test_walls_that_are_alike_have_the_same_curtains_each_where_it_stands(monkeypatch):
    places = [(0, 0, 0), (7, 0, 0), (-3, 11, 2.5)]
    walls = [upright(random_solids.box([0, 0, 0], [5, 0.2, 3]), 17, place) for place in places]
    cut = []
    sections = curtains._sections
    monkeypatch.setattr(curtains, "_sections", lambda *given: cut.append(1) or sections(*given))
    scene = random_solids.scene_of_meshes(walls)
    found = PreparedModel(scene).curtains
    assert len(cut) == 1
    assert all(opaque(found, OpaqueSurfaces(*scene.triangles())))
    # Faces come after what is inside of all.
    inside = len(found.axis) - 4 * len(places)
    # Of every curtain the copies come one after the other.
    each = found.boxes[:inside].reshape(-1, 3, 2, 3).transpose(1, 0, 2, 3)
    for mine, place in zip(each, places, strict=True):
        assert (mine - each[0] == np.round(np.array(place) / GRID_M)).all()


def test_models_along_the_axes_and_small_ones_have_none():
    for meshes in (
        [random_solids.box([0, 0, 0], [5, 0.2, 3])],
        [upright(random_solids.box([0, 0, 0], [0.3, 0.2, 0.3]), 9)],
    ):
        assert len(PreparedModel(random_solids.scene_of_meshes(meshes)).curtains.axis) == 0
    assert len(find_curtains([], np.zeros((0, 3, 3), np.int32), GRID_M).axis) == 0


def test_what_may_meet_a_rectangle_holds_what_meets_it():
    """Triangles near upright rectangles: whatever crosses one exactly is found in floating point."""
    random, met = np.random.default_rng(0), 0
    for _ in range(400):
        quad = np.array([[0, 0, 0], [*random.integers(20, 60, 2), 40]])
        quad[0, :2] = random.integers(-9, 9, 2)
        triangles = random.integers(-30, 60, (20, 3, 3))
        rows = set(meeting(quad[None], np.zeros(20, int), triangles, 1.0).tolist())
        for n, triangle in enumerate(triangles):
            if crossed(quad, triangle):
                met += 1
                assert n in rows
    assert met > 300


@pytest.mark.parametrize(
    ("triangle", "expected"),
    [
        ([[20, -10, 20], [20, 50, 20], [20, 20, 60]], True),
        ([[20, -10, 40], [20, 50, 40], [20, 20, 60]], False),
        ([[20, -10, 39], [20, 50, 39], [20, 20, 60]], True),
        ([[0, 0, 0], [40, 30, 0], [40, 30, 40]], True),
        ([[0, 0, 0], [0, 0, 40], [-20, 30, 20]], False),
        ([[40, 30, 0], [40, 30, 40], [60, 50, 20]], False),
        ([[0, 1, 0], [40, 31, 0], [40, 31, 40]], False),
    ],
)
def test_touching_the_border_is_not_crossing(triangle, expected):
    quad, triangle = np.array([[0, 0, 0], [40, 30, 40]]), np.array(triangle)
    assert crossed(quad, triangle) == expected
    assert clearly_missed(quad[None], triangle[None]).tolist() == [not expected]


def test_what_is_clearly_missed_is_not_crossed():
    """Small numbers, so that corners often lie in the plane or on the border; most that is missed is so clearly."""
    random, missed, clear = np.random.default_rng(1), 0, 0
    for _ in range(300):
        quad = np.array([[0, 0, 0], [*random.integers(1, 5, 2), random.integers(1, 5)]])
        triangles = random.integers(-3, 6, (20, 3, 3))
        found = clearly_missed(np.broadcast_to(quad, (20, 2, 3)), triangles)
        for said, triangle in zip(found.tolist(), triangles, strict=True):
            met = crossed(quad, triangle)
            assert not (said and met)
            missed, clear = missed + (not met), clear + said
    assert clear > 0.6 * missed > 2000


@pytest.mark.parametrize("seed", range(6))
def test_what_is_above_a_point_tells_whether_it_is_inside(seed):
    """Against solid angles, on a coarse grid: many points lie in line with corners, and some on surfaces."""
    random = np.random.default_rng(seed)
    mesh = [trimesh.creation.box((6, 5, 7)), trimesh.creation.icosphere(1, 5), trimesh.creation.cylinder(4, 8, 6)][
        seed % 3
    ]
    mesh.apply_transform(trimesh.transformations.random_rotation_matrix(random.random(3)) if seed > 2 else np.eye(4))
    triangles = np.round(mesh.triangles).astype(np.int32)
    doubled = random.integers(-14, 15, (400, 3))
    row = np.repeat(np.arange(400), len(triangles))
    told = rays_wind(doubled, row, np.tile(triangles, (400, 1, 1)))
    number = winding_numbers(doubled / 2, triangles)
    clear = np.abs(number - np.round(number)) < 1e-6
    on = np.zeros(400, bool)
    for step in np.vstack([np.eye(3), -np.eye(3)]) * 1e-4:
        on |= np.abs(winding_numbers(doubled / 2 + step, triangles) - number) > 1e-3
    assert (
        (told == (np.abs(number) > 0.5))[clear & ~on].all()
        and (clear & ~on & told).sum() > 10
        and (clear & ~on & ~told).sum() > 10
    )
    # An inside that is turned out is one as well.
    assert (rays_wind(doubled, row, np.tile(triangles[:, ::-1], (400, 1, 1))) == told)[clear & ~on].all()


@pytest.mark.parametrize("yaw", [-25, 25])
def test_what_reaches_over_gaps_is_not_opaque_though_its_middle_is_inside(yaw):
    """A comb of three teeth: from tooth to tooth, and within one, rising and falling."""
    teeth = [(0, 0), (5, 0), (5, 2), (4, 2), (4, 1), (3, 1), (3, 2), (2, 2), (2, 1), (1, 1), (1, 2), (0, 2)]
    comb = trimesh.creation.extrude_polygon(Polygon(teeth), 2.0)
    turn = trimesh.transformations.rotation_matrix(np.radians(yaw), [0, 0, 1])
    triangles = np.round(comb.apply_transform(turn).triangles * 1000).astype(np.int32)
    ends = np.array([[(0.2, 1.5), (4.8, 1.5)], [(2.1, 1.5), (2.9, 1.5)]])
    ends = np.concatenate([ends, np.full((2, 2, 1), 1.0)], axis=2).reshape(-1, 3)
    plan = np.round(trimesh.transform_points(ends, turn)[:, :2] * 1000).reshape(2, 2, 2)
    quads = np.concatenate([plan, np.full((2, 2, 1), [[500], [1500]])], axis=2).astype(np.int64)
    assert (np.diff(quads[:, :, 1], axis=1) > 0).all() == (yaw > 0)
    owner, left = curtains._opaque(quads, np.zeros(2, np.int64), [triangles])
    assert owner.tolist() == [0] and left.tolist() == quads[1:].tolist()
