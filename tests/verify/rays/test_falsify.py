"""The falsifier finds what is planted by every strategy, proposes nothing false for long, and counts what it casts."""

import math
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from builders import random_solids, small_house
from viewcell.data.errors import InputError
from viewcell.data.scene import Role
from viewcell.verify.exact.sightline import Sightlines
from viewcell.verify.rays.adjudicate import Judgement, sightline_end
from viewcell.verify.rays.crossing import Crossings
from viewcell.verify.rays.falsify import ATTEMPTS, SHARES, Falsifier, scaled_shares
from viewcell.verify.rays.free_space import FREE, MIXED, SOLID, FreeSpace
from viewcell.verify.rays.guide import Hints, edge_table, pass_edges
from viewcell.verify.rays.near_misses import certificate_hints, patch_margin, region_margin
from viewcell.verify.rays.starts import cell_origins
from viewcell.verify.rays.targets import Targets, sharp_edges
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.baked import load
from viewcell.workbench.bench import falsify as bench
from viewcell.workbench.verify import make_judge

RAYS = 30_000
DESK, PANE = 17, 18
KINDS = ("cell", "object")
SHELVED, NARROW = [[0, 0, 5], [1000, 1000, 995]], [[-300, 500, 500], [-293, 507, 507]]


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    """The house with its judge, sources, and free points; tests copy its claims before they change them."""
    made = small_house.small_house(tmp_path_factory.mktemp("house"))
    judge, sources = make_judge(made), np.flatnonzero(made.graph.inhabitable)
    spots = cell_origins(made.graph, sources, 64, judge.lines, 0)
    objects, cells = made.potential_objects[sources].copy(), made.potential_cells[sources].copy()
    return SimpleNamespace(
        made=made, judge=judge, sources=sources, spots=spots, objects=objects, cells=cells, boxes=made.graph.cells
    )


def search(house, claimed=None, **options):
    judge = house.judge
    return Falsifier(
        boxes=house.boxes[house.sources],
        spots=house.spots,
        claimed=house.objects if claimed is None else claimed,
        opaque=(judge.lines.triangles, judge.lines.owners),
        glass=(judge.glass.triangles, judge.glass.owners),
        lines=judge.lines,
        **options,
    )


def confirmed(house, falsifier, rays=RAYS, stop=False):
    """Pairs (row, kind, target) that the exact judge confirms; only the first round's that has any if `stop`."""
    out = set()
    for found, _ in falsifier.batches(rays):
        if stop and out:
            break
        for number, (row, kind, target) in enumerate(zip(found.rows, found.kinds, found.targets, strict=True)):
            end = sightline_end(found, number, house.boxes)
            cell = int(house.sources[row])
            if house.judge.judge(KINDS[kind], cell, int(target), found.origins[number], end) is Judgement.VISIBLE:
                out.add((int(row), int(kind), int(target)))
    return out


def without(claimed, row, target):
    planted = claimed.copy()
    assert planted[row, target]
    planted[row, target] = False
    return planted


def test_every_planted_object_is_found_and_nothing_else(house):
    for row, target in np.argwhere(house.objects)[::2]:
        planted = without(house.objects, row, target)
        found = confirmed(house, search(house, planted), 10 * RAYS, stop=True)
        assert found == {(row, 1, target)}, (row, target)


def test_every_planted_cell_is_found_and_nothing_else(house):
    for row, target in np.argwhere(house.cells):
        if target != house.sources[row]:
            claim = {"cells": (house.boxes, without(house.cells, row, target))}
            found = confirmed(house, search(house, **claim), 10 * RAYS, stop=True)
            assert found == {(row, 0, target)}, (row, target)


def test_a_true_claim_stands(house):
    falsifier = search(house, cells=(house.boxes, house.cells))
    assert confirmed(house, falsifier, 4 * RAYS) == set()


@pytest.fixture
def taught(house):
    """A guide that has seen some rays, of a claim without the desk and without what the hall sees last."""
    planted = without(house.objects, list(house.sources).index(2), DESK)
    planted[0, np.flatnonzero(planted[0])[-1]] = False
    falsifier = search(house, planted)
    for _ in falsifier.batches(RAYS):
        pass
    return falsifier._guide


@pytest.mark.parametrize("strategy", ["aim", "near", "gap"])
def test_rays_to_hidden_targets_end_on_them(house, taught, strategy):
    """Those of gap that pass the edge from the origin excepted."""
    aimed = taught.rays(strategy, 2000, np.random.default_rng(0))
    assert taught.hidden[aimed.rows, aimed.targets].all()
    bounds = house.made.scene.object_bounds()[aimed.targets]
    ends = aimed.origins + aimed.along
    on = ((ends > bounds[:, 0] - 0.1) & (ends < bounds[:, 1] + 0.1)).all(axis=1)
    assert on.mean() > (0.2 if strategy == "gap" else 0.999)
    boxes = house.boxes[house.sources][aimed.rows]
    assert ((aimed.origins >= boxes[:, 0]) & (aimed.origins <= boxes[:, 1])).all()


def test_mutated_rays_stay_near_what_saw_something(house, taught):
    aimed = taught.rays("mutate", 2000, np.random.default_rng(0))
    moved = np.full(len(aimed.rows), np.inf)
    for row in range(len(house.sources)):
        known, own = np.flatnonzero((taught._seen_rows == row) & (taught._seen_counts > 0)), aimed.rows == row
        for ends, points in (
            (taught._seen_origins[known], aimed.origins[own]),
            (taught._seen_ends[known], (aimed.origins + aimed.along)[own]),
        ):
            nearest = np.linalg.norm(points[:, None] - ends, axis=2).min(axis=1)
            moved[own] = np.where(np.isinf(moved[own]), nearest, np.maximum(moved[own], nearest))
    # Of moves on all scales from 1e-4 to 1, a good part is below a hundredth of a room.
    assert (moved < 0.01 * 2560).mean() > 0.2 and (moved > 0.01 * 2560).mean() > 0.2


def test_rays_pass_outside_the_edges_of_a_blocker():
    """Past a box, as seen along the rays that it stops, by no more than the steps."""
    rng, count = np.random.default_rng(0), 500
    box = (np.array(list(product((0, 64), repeat=3)))[small_house.FACES], np.zeros(12, np.int32))
    across = rng.uniform(5, 59, (count, 2))
    origins, ends = (np.column_stack([np.full(count, x), across]).astype(np.float32) for x in (-100, 200))
    steps = rng.uniform(0.5, 50, count).astype(np.float32)
    out = np.zeros((count, 3), np.float32)
    points = [wp.array(column, dtype=wp.vec3, device="cpu", copy=False) for column in (origins, ends, out)]
    inputs = [edge_table(box, 1), *points[:2], wp.zeros(count, dtype=int, device="cpu")]
    inputs += [wp.array(steps, device="cpu"), 7]
    wp.launch(pass_edges, count, inputs=inputs, outputs=points[2:], device="cpu")
    away = np.maximum(np.maximum(-out[:, 1:], out[:, 1:] - 64), 0)
    distance = np.linalg.norm(away, axis=1)
    assert (distance > 0.5 * steps).all() and (distance < steps + 1e-2).all()


def test_gaps_are_found_sooner_than_by_chance(house):
    """A doorway that shows itself to few sightlines of the store: rays past the edges of what has stopped others."""
    row, target = list(house.sources).index(5), 1
    claim = {"cells": (house.boxes, without(house.cells, row, target))}
    proposed = {}
    for name, shares in (("aim", {"aim": 1.0}), ("gap", {"aim": 0.2, "gap": 0.8})):
        falsifier = search(house, shares=shares, seed=2, **claim)
        proposed[name] = sum((found.kinds == 0).sum() for found, _ in falsifier.batches(4 * RAYS))
    assert proposed["gap"] > 5 * proposed["aim"]


def test_hints_are_followed(house):
    """A sightline through the doorway to the desk's room, from a claim that hides all but the own cell."""
    row = list(house.sources).index(0)
    target = int(np.flatnonzero(house.objects[row])[-1])
    planted = without(house.objects, row, target)
    triangles = house.judge.lines.triangles[house.judge.lines.owners == target]
    if not len(triangles):
        triangles = house.judge.glass.triangles
    ends = triangles.mean(axis=1)
    hints = Hints(np.full(len(ends), row), np.repeat(house.spots[row][:1], len(ends), axis=0), ends)
    falsifier = search(house, planted, hints=hints, shares={"hint": 1.0})
    assert confirmed(house, falsifier) == {(row, 1, target)}


@pytest.mark.parametrize("other", [{"threads": 1}, {"threads": 3}])
def test_the_answer_depends_on_the_seed_alone(house, other):
    planted = house.objects.copy()
    planted[:, ::3] = False

    def run(**options):
        return [
            (*(column.tobytes() for column in vars(found).values()), progress.rays, progress.uniform_rays.tobytes())
            for found, progress in search(house, planted, **options).batches(RAYS)
        ]

    assert run(seed=5) == run(seed=5, **other) != run(seed=6)
    assert run(seed=5, shares={"uniform": 1.0}) != run(seed=6, shares={"uniform": 1.0})


def test_more_rays_begin_with_the_same(house):
    planted = without(house.objects, 0, 0)
    short, long = ([found.origins for found, _ in search(house, planted).batches(rays)] for rays in (RAYS, 2 * RAYS))
    whole = len(short) - 1
    assert whole >= 1 and all(np.array_equal(a, b) for a, b in zip(short[:whole], long, strict=False))


def test_a_refused_pair_is_proposed_a_few_times_only(house):
    planted = without(house.objects, 0, 0)
    proposed = sum(len(found.rows) for found, _ in search(house, planted).batches(4 * RAYS))
    assert proposed == ATTEMPTS


@pytest.mark.parametrize("strategy", ["uniform", "aim", "mutate"])
@pytest.mark.parametrize(("far", "box"), [(0, SHELVED), (2**24 - 1100, SHELVED), (2**24 - 1100, NARROW)])
def test_candidates_start_strictly_inside_their_cell_and_outside_solids(far, box, strategy):
    """In a view cell that is a quarter full of shelves, and in one of a few grid steps at the end of the grid."""
    unit = np.array(list(product((0, 1), repeat=3)))
    shelves = [unit * [1000, 1000, 10] + [0, 0, 40 * n] for n in range(25)]
    triangles = np.concatenate([shelf[small_house.FACES] for shelf in shelves]) + far
    opaque, none = (triangles, np.repeat(np.arange(25), 12)), (np.zeros((0, 3, 3), int), np.zeros(0, int))
    lines, total = Sightlines(*opaque), 0
    # What is claimed and seen is what rays are varied about.
    claimed = np.arange(25)[None] % 2 == 0
    search = Falsifier(
        boxes=np.array([box]) + far, spots=[np.zeros((0, 3), np.float32)], claimed=claimed, opaque=opaque,
        glass=none, lines=lines, shares={strategy: 1},
    )  # fmt: skip
    for found, _ in search.batches(RAYS):
        assert ((found.origins - far > box[0]) & (found.origins - far < box[1])).all()
        assert lines.outside_solids(found.origins).all()
        total += len(found.rows)
    assert total > 20


def test_uniform_rays_are_counted(house):
    """Every view cell gets as many, a quarter of all; those that start in the desk of room 2 do not count."""
    planted = without(house.objects, 0, 0)
    falsifier = search(house, planted)
    *_, (_, progress) = falsifier.batches(RAYS + 7)
    assert progress.rays == RAYS + 7 == sum(progress.by_strategy.values())
    cast, counted = progress.by_strategy["uniform"], progress.uniform_rays
    room = list(house.sources).index(2)
    assert cast == pytest.approx(RAYS / 4, abs=40)
    assert np.ptp(np.delete(counted, room)) <= 20 and (counted >= 0.24 * cast).all() and counted.sum() <= cast
    # 288 of 48,000 parts of the room are solid.
    assert cast - counted.sum() == pytest.approx(0.006 * counted[room], abs=15)


def test_uniform_rays_are_uniform_and_outside_solids(house):
    """Room 2 holds the desk: none of the origins lies in it, and the others fill the room evenly."""
    falsifier = search(house, without(house.objects, 0, 0))
    aimed = falsifier._guide.rays("uniform", 40_000, np.random.default_rng(1))
    own = (aimed.rows == list(house.sources).index(2)) & aimed.fresh
    points = aimed.origins[own].astype(np.float64)
    assert house.judge.lines.outside_solids(points).all()
    low, high = house.boxes[2]
    place = (points - low) / (high - low)
    # The desk takes 6 x 6 x 8 of 40 x 40 x 30.
    cell, counts = np.unique((place * 2).astype(int) @ [4, 2, 1], return_counts=True)
    assert len(cell) == 8
    desk = (np.array([60, 32, 0]), np.array([66, 38, 8]))
    corner, step = np.array([44, 0, 0]), np.array([20, 20, 15])
    for octant, count in zip(cell, counts, strict=True):
        start = corner + step * [octant >> 2 & 1, octant >> 1 & 1, octant & 1]
        solid = np.maximum(np.minimum(desk[1], start + step) - np.maximum(desk[0], start), 0).prod()
        expected = len(points) * (step.prod() - solid) / (48000 - 288)
        assert abs(count - expected) < 5 * math.sqrt(expected)
    directions = aimed.along / np.linalg.norm(aimed.along, axis=1)[:, None]
    octants, counts = np.unique((directions > 0) @ [4, 2, 1], return_counts=True)
    assert len(octants) == 8 and (np.abs(counts - 5000) < 5 * math.sqrt(5000)).all()
    assert np.abs(np.abs(directions).mean(axis=0) - 0.5).max() < 0.01


def test_uniform_rays_see_hidden_cells_too(house):
    """Without any ray aimed at it, a hidden room is found by the uniform rays that pass through it."""
    claim = without(house.cells, list(house.sources).index(0), 2)
    falsifier = search(house, cells=(house.boxes, claim), shares={"uniform": 1.0})
    assert confirmed(house, falsifier) == {(list(house.sources).index(0), 0, 2)}


def test_crossed_cells_are_those_before_the_hit():
    boxes = [
        [[0, 0, 0], [10, 10, 10]],
        [[20, 0, 0], [25, 10, 10]],
        [[30, 0, 0], [60, 10, 10]],
        [[0, 0, 20], [9, 9, 30]],
    ]
    origins = np.tile(np.float32([5, 5, 5]), (6, 1))
    directions = np.float32([[1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, 0, -1]])
    reach = np.float32([24, 14, np.inf, np.inf, np.inf, np.inf])
    wanted = np.array([[False, True, True, True]])
    crossings, rows = Crossings(np.array(boxes, np.float32)), np.zeros(6, int)
    found = crossings.crossed(origins, directions, reach, rows, wanted)
    # Room 2 is crossed for longest; room 1 alone where the ray ends before it; a ray beside, and one away, cross none.
    assert found.tolist() == [1, -1, 2, -1, -1, -1]
    assert (crossings.crossed(origins, directions, reach, rows, wanted & False) == -1).all()


def test_shares_are_scaled():
    assert sum(scaled_shares(SHARES, True).values()) == pytest.approx(1)
    assert scaled_shares(SHARES, True)["uniform"] == pytest.approx(SHARES["uniform"])
    assert scaled_shares({"aim": 3, "gap": 1, "hint": 9}, False) == {"aim": 3 / 13 / (4 / 13), "gap": 0.25}


def test_nothing_hidden_nothing_cast(house):
    assert list(search(house, np.ones_like(house.objects)).batches(RAYS)) == []


def test_no_triangles(house):
    """Objects without triangles are no targets; hidden cells are all in sight."""
    none = np.zeros((0, 3, 3), np.int32), np.zeros(0, np.int32)
    claimed = np.zeros((len(house.sources), 3), bool)
    shared = {"boxes": house.boxes[house.sources], "spots": house.spots, "claimed": claimed}
    assert list(Falsifier(**shared, opaque=none, glass=none).batches(RAYS)) == []
    cells = np.ones_like(house.cells)
    cells[0, 5] = False
    falsifier = Falsifier(**shared, opaque=none, glass=none, cells=(house.boxes, cells))
    found, _ = next(falsifier.batches(RAYS))
    assert set(found.targets) == {5} and set(found.kinds) == {0} and np.isinf(found.reach).all()


def test_no_view_cells(house):
    none = np.zeros((0, 2, 3), np.int32)
    lines = house.judge.lines
    opaque = lines.triangles, lines.owners
    glass = house.judge.glass.triangles, house.judge.glass.owners
    falsifier = Falsifier(boxes=none, spots=[], claimed=np.zeros((0, 19), bool), opaque=opaque, glass=glass)
    assert list(falsifier.batches(RAYS)) == []


def test_a_cell_inside_a_solid_casts_nothing(house):
    boxes = np.array([[[0, 0, -200], [64, 64, -100]]], np.int32)
    lines = house.judge.lines
    opaque = lines.triangles, lines.owners
    glass = house.judge.glass.triangles, house.judge.glass.owners
    nothing = [np.zeros((0, 3), np.float32)]
    falsifier = Falsifier(boxes=boxes, spots=nothing, claimed=np.zeros((1, 19), bool), opaque=opaque, glass=glass)
    assert not falsifier.lit.any() and list(falsifier.batches(RAYS)) == []


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"claimed": np.zeros((2, 19), bool)}, "claimed: expected shape"),
        ({"cells": (np.zeros((2, 2, 3), np.int32), np.zeros((4, 3), bool))}, "claimed_cells: expected"),
        ({"shares": {"guess": 1.0}}, "found 'guess'"),
        ({"shares": {"aim": 0.0}}, "not all 0"),
        ({"shares": {"aim": 1.0, "gap": -0.5}}, "0 or more"),
    ],
)
def test_bad_input(house, options, said):
    with pytest.raises(InputError, match=said):
        search(house, **options)


def test_negative_rays(house):
    with pytest.raises(InputError, match="found -1"):
        next(search(house).batches(-1))


@pytest.mark.parametrize("seed", range(3))
def test_voxels_tell_free_from_solid(seed):
    """Against the exact test, for boxes and spheres in and across the walls of a view cell."""
    rng = np.random.default_rng(seed)
    corners, owners = [], []
    for owner in range(6):
        middle, size = rng.integers(-200, 1200, 3), rng.integers(40, 700, 3)
        points = np.array([middle + size * corner for corner in product((0, 1), repeat=3)])
        corners.append(points[small_house.FACES])
        owners += [owner] * 12
    lines = Sightlines(np.concatenate(corners), np.array(owners))
    boxes = np.array([[[0, 0, 0], [1000, 900, 800]], [[500, 0, 0], [510, 1000, 3]]])
    space = FreeSpace(boxes, [np.zeros((0, 3), np.float32)] * 2, lines)
    assert {FREE, SOLID, MIXED} == set(np.unique(space.state))
    rows = np.repeat([0, 1], 20_000)
    points, fresh, mixed = space.draw(rows, np.random.default_rng(seed))
    exact = lines.outside_solids(points.astype(np.float64))
    assert exact[fresh & ~mixed].all() and fresh.mean() > 0.9
    assert ((points > boxes[rows, 0]) & (points < boxes[rows, 1])).all()
    everywhere = boxes[0, 0] + rng.random((20_000, 3)) * (boxes[0, 1] - boxes[0, 0])
    outside = lines.outside_solids(everywhere)
    x, y, z = ((everywhere - boxes[0, 0]) / (boxes[0, 1] - boxes[0, 0]) * space.state.shape[1]).astype(int).T
    state = space.state[0, x, y, z]
    assert outside[state == FREE].all() and not outside[state == SOLID].any()


def test_where_chance_finds_nothing_the_given_points_are_used():
    """A slit between two solids, thinner than any voxel."""
    points = np.array(list(product((0, 1), repeat=3)))
    scale, low = np.array([1000, 1000, 4999]), np.array([0, 0, 5001])
    corners = np.concatenate([(points * scale)[small_house.FACES], (low + points * scale)[small_house.FACES]])
    lines = Sightlines(corners, np.repeat([0, 1], 12))
    given_point = np.array([[400, 500, 5000]], np.float32)
    space = FreeSpace(np.array([[[0, 0, 10], [1000, 1000, 9990]]]), [given_point], lines)
    points, fresh, mixed = space.draw(np.zeros(2000, int), np.random.default_rng(0))
    assert mixed[fresh].all()
    assert (points[~fresh] == given_point).all() and (~fresh).any()


def test_points_and_neighbours():
    """Three boxes in a row and a cell about the last."""
    unit = np.array(list(product((0, 64), repeat=3)))
    triangles = np.concatenate([(unit + np.array([at, 0, 0]))[small_house.FACES] for at in (0, 200, 500)])
    owners = np.repeat([0, 2, 3], 12)
    targets = Targets(triangles, owners, 4, np.array([[[490, 0, 0], [600, 64, 64]]]))
    assert targets.present.tolist() == [True, False, True, True, True]
    ids = np.repeat([0, 2, 3, 4], 500)
    points = targets.points(ids, np.random.default_rng(0))
    for target, low, high in ((0, 0, 64), (2, 200, 264), (3, 500, 564)):
        own = points[ids == target]
        assert (own >= np.array([low, 0, 0]) - 1e-3).all() and (own <= np.array([high, 64, 64]) + 1e-3).all()
        at_face = np.isclose(own, [low, 0, 0], atol=1e-3) | np.isclose(own, [high, 64, 64], atol=1e-3)
        assert at_face.any(axis=1).all() and (at_face.sum(axis=0) > 100).all()
    assert ((points[ids == 4] > [490, 0, 0]) & (points[ids == 4] < [600, 64, 64])).all()
    nearest = targets.neighbours(np.random.default_rng(0))
    assert nearest[[0, 2, 3, 4], 0].tolist() == [2, 0, 4, 3]
    assert nearest[3, 1] == 2 and (nearest[1] == -1).all() and (nearest[:, 3:] == -1).all()


def test_sharp_edges_of_boxes_and_sheets():
    unit = np.array(list(product((0, 64), repeat=3)))
    sheet = np.array([[[0, 0, 9], [8, 0, 9], [8, 8, 9]], [[0, 0, 9], [8, 8, 9], [0, 8, 9]]])
    triangles = np.concatenate([unit[small_house.FACES], sheet, (unit + np.array([64, 0, 0]))[small_house.FACES]])
    owners, starts, ends = sharp_edges(triangles, np.repeat([0, 1, 2], [12, 2, 12]))
    assert np.bincount(owners).tolist() == [12, 4, 12] and (np.diff(owners) >= 0).all()
    lengths = np.abs(ends - starts)
    assert (np.count_nonzero(lengths, axis=1) == 1).all()
    assert len(np.unique(np.sort(np.stack([starts, ends], 1), axis=1)[owners == 0], axis=0)) == 12


def test_margins_of_certificates():
    """Sightlines at a known distance from the border of a wall with a doorway, and from the edge of a disc."""
    grid_m = 2.0**-10
    wall = np.array([[0, 0, 100, 300], [200, 0, 400, 300], [100, 200, 200, 300]]) * grid_m
    region = {"axis": 0, "coordinate": 50 * grid_m, "rectangles": wall.ravel().tolist()}
    # Crossings at (y, z) = (90, 150), 10 from the doorway, and (300, 150), 100 from it and from the outline.
    p = np.array([[[0, 90, 150]], [[0, 300, 150]]], float)
    across = np.array([100, 0, 0])
    margin, pair = region_margin(p, p + across, region, grid_m)
    assert margin.tolist() == [16, 128] and pair.tolist() == [0, 0]
    p = np.array([[[0, 90, 150], [0, 50, 150]]], float)
    disc = {"corners": (np.array([[50, 0, 0], [50, 100, 0], [50, 100, 300], [50, 0, 300]]) * grid_m).ravel().tolist()}
    margin, pair = patch_margin(p, p + across, disc, grid_m)
    assert margin[0] == pytest.approx(10) and pair.tolist() == [0]


def test_hints_of_a_certified_bake(tmp_path):
    """A wall hides a chair from two view cells: its hints run between them, those nearest to its edge first."""
    meshes = [random_solids.box([2, -1, 0], [2.2, 5, 4]), random_solids.box([3, 1.5, 0], [3.5, 2, 0.5])]
    scene = random_solids.scene_of_meshes(meshes, [Role.OCCLUDER, Role.DETAIL])
    table = tmp_path / "cells.csv"
    table.write_text("min_x,min_y,min_z,max_x,max_y,max_z\n0.5,1,1,1.5,2,2\n-1,1.5,1.5,-0.5,2,2\n")
    settings = Settings(method="occluders", cells=str(table), certify=True)
    made = load(bake(scene, tmp_path / "made.bake", settings=settings, threads=1).folder)
    hints = certificate_hints(made, np.array([1, 0]))
    assert set(hints.rows) == {0, 1}
    boxes = made.graph.cells[[1, 0]][hints.rows]
    assert ((hints.origins >= boxes[:, 0]) & (hints.origins <= boxes[:, 1])).all()
    assert (hints.ends[:, 0] >= 2.2 * 1024).all()
    few = certificate_hints(made, np.array([1, 0]), 1)
    assert len(few.rows) == 1 and (few.ends[0] == hints.ends[0]).all()
    assert set(certificate_hints(made, np.array([0])).rows) == {0}


def test_expected_uniform_rays():
    """One hole of 1e-3 sr in one of 7 view cells: a share is found as the geometric law says."""
    planted = bench.Omissions(np.array([0]), np.array([0]), np.array([1e-3]))
    expected = 7 * math.log(0.1) / math.log1p(-1e-3 / (4 * math.pi))
    assert bench.expected_rays(planted, 7, 0.9) == pytest.approx(expected, rel=0.01)
    assert bench.rays_for(np.array([5.0, 1.0, math.inf, 2.0]), 0.5) == 2.0
    assert bench.rays_for(np.array([5.0, math.inf]), 0.9) == math.inf
    assert bench.decade(np.array([1e-9, 2e-8, 0.5e-2, 1.0])).tolist() == [-1, 0, 5, 6]


def test_planted_together_or_alone(house):
    """The bench confirms what it plants, at a number of rays."""
    setting = bench.Setting(house.made, house.judge, house.sources, house.spots)
    rows, targets = np.nonzero(house.objects[:, :PANE])
    planted = bench.Omissions(rows[::9], targets[::9], np.ones(len(rows[::9])))
    for way in ("uniform", "falsifier"):
        outcome = bench.look(setting, planted, bench.searches(setting, 0)[way], 200_000, 60)
        assert np.isfinite(outcome.first).all() and outcome.others == 0 and outcome.first.max() <= outcome.rays
