"""Pieces of shafts as certificates: against slow references, and every kind of tampering is refused."""

from fractions import Fraction
from itertools import pairwise, product

import numpy as np
import pyarrow.parquet as pq
import pytest
import trimesh
from builders import certified_bake
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.data.scene import GRID_M, Definition, Instance, Mesh, Role, Scene
from viewcell.verify.proofs.boxes import in_boxes
from viewcell.verify.proofs.line_tree import check_certificates
from viewcell.verify.proofs.shaft import Disc, Region, leaf_holds, tiled
from viewcell.verify.proofs.ways import End
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.baked import load

with_value, step = certified_bake.with_value, certified_bake.step


@pytest.fixture(scope="module")
def honest(tmp_path_factory):
    return certified_bake.make_honest(tmp_path_factory.mktemp("certified"))


@pytest.fixture
def tampered(honest, tmp_path):
    return lambda **changes: certified_bake.tamper(honest, tmp_path / "tampered.bake", **changes)


def as_ends(boxes):
    return [End(box) for box in np.array(boxes).reshape(-1, 2, 3).tolist()]


def slow_region(v, x, region):
    """Crossings of segments between all corners, in rationals: they bound those of all segments."""
    i, k = region.axis, region.plane
    pairs = list(product(product(*zip(*v, strict=True)), product(*zip(*x, strict=True))))
    if not (all(p[i] <= k < q[i] for p, q in pairs) or all(p[i] >= k > q[i] for p, q in pairs)):
        return False
    shares = [(p, q, Fraction(k - p[i], q[i] - p[i])) for p, q in pairs]
    crossings = [[p[j] + t * (q[j] - p[j]) for j in range(3) if j != i] for p, q, t in shares]
    middles = []
    for c, (low, high) in enumerate((min(column), max(column)) for column in zip(*crossings, strict=True)):
        inner = {side[c] for rectangle in region.rectangles for side in rectangle if low < side[c] < high}
        lines = sorted(inner | {low, high})
        middles.append([(a + b) * Fraction(1, 2) for a, b in pairwise(lines)] or lines)
    return all(
        any(u0 <= u <= u1 and v0 <= v <= v1 for (u0, v0), (u1, v1) in region.rectangles) for u, v in product(*middles)
    )


def slow_disc(v, x, disc):
    """Orientations of segments between all corners about all edges, and the heights of everything over the plane."""
    n = sum(np.cross(a, b) for a, b in edges_of(np.array(disc.outline, object) - disc.outline[0]))
    pairs = list(product(product(*zip(*v, strict=True)), product(*zip(*x, strict=True))))
    turns = set()
    for (p, q), (a, b) in product(pairs, edges_of(np.array(disc.outline, object))):
        turns.add(np.sign(np.dot(np.subtract(q, p), np.cross(np.subtract(a, p), np.subtract(b, p)))))
    heights = (np.array(disc.triangles, object) @ n).ravel()
    eye, far = ([int(np.dot(n, corner)) for corner in product(*zip(*box, strict=True))] for box in (v, x))
    ahead = max(eye) <= min(heights) and max(heights) < min(far)
    back = min(eye) >= max(heights) and min(heights) > max(far)
    return any(n) and all(a < b for a, b in zip(*v, strict=True)) and (ahead or back) and not {1, -1} <= turns


def edges_of(outline):
    return list(zip(np.roll(outline, 1, axis=0), outline, strict=True))


def test_every_leaf_of_a_bake_holds_by_the_slow_reference_too(honest):
    triangles, owners = load(honest).scene.triangles()
    rows = pq.read_table(honest / "leaves.parquet").to_pylist()
    discs = {}
    for row in pq.read_table(honest / "occluders.parquet").to_pylist():
        outline = np.round(np.array(row["corners"]) / GRID_M).astype(int).reshape(-1, 3).tolist()
        discs[row["occluder_id"]] = Disc(outline, triangles[owners == row["object_id"]][row["triangles"]].tolist())
    assert rows
    for row in rows:
        corners = np.round(np.array(list(row.values())[2:]) / GRID_M).astype(int).reshape(2, 2, 3).tolist()
        assert slow_disc(*corners, discs[row["occluder_id"]])


def test_a_missing_leaf(tampered):
    assert tampered(leaves=lambda rows: rows[1:]).failed_proofs == 1


def test_a_repeated_leaf(tampered):
    assert tampered(leaves=lambda rows: [*rows, rows[0]]).failed_proofs == 1


@pytest.mark.parametrize("side", [f"{box}_max_{axis}" for box in "vx" for axis in "xyz"])
def test_a_grown_leaf(side, tampered):
    assert tampered(leaves=with_value(0, **{side: step})).failed_proofs == 1


def test_a_grown_box(tampered, honest):
    proof = pq.read_table(honest / "leaves.parquet")["proof_id"][0].as_py()
    number = certified_bake.number_of(honest, "proofs", lambda row: row["proof_id"] == proof)
    assert tampered(proofs=with_value(number, max_z=step)).failed_proofs == 1


@pytest.mark.parametrize(
    "values",
    [
        {"corners": lambda corners: [corners[0] + 10 * GRID_M, *corners[1:]]},
        {"corners": lambda corners: corners[:9]},
        {"triangles": lambda places: places[1:]},
        {"triangles": lambda places: [*places, places[0]]},
        {"triangles": lambda places: [99, *places[1:]]},
        {"triangles": lambda places: [-1, *places[1:]]},
        {"object_id": lambda _: 2},
        {"object_id": lambda _: 99},
    ],
)
def test_a_false_disc(values, tampered):
    found = tampered(occluders=with_value(0, **values))
    assert found.failed_occluders == 1 and found.failed_proofs > 0 and found.uncovered > 0


def test_a_wall_made_transparent(tampered):
    found = tampered(objects=with_value(1, role=lambda _: "transparent"))
    assert found.failed_occluders > 0 and found.uncovered > 0


def region_instead(rows):
    """The patch replaced by a region that the model does not have, right behind the cells."""
    rows[0] |= {"kind": "region", "axis": 0, "coordinate": -1.5, "rectangles": [-90.0, -90.0, 90.0, 90.0]}
    return rows


def test_a_false_region(tampered):
    found = tampered(occluders=region_instead)
    assert found.failed_occluders == 1 and "not opaque throughout" in "".join(found.examples)


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ({"leaves": with_value(0, occluder_id=lambda _: 10**6)}, "occluder_id of a row"),
        ({"leaves": with_value(0, proof_id=lambda _: -1)}, "proof_id of a row"),
        ({"leaves": with_value(0, v_min_x=lambda x: x + 1e-6)}, "expected multiples"),
        ({"leaves": with_value(0, v_min_x=lambda _: 1e9)}, "within the grid"),
        ({"occluders": with_value(0, kind=lambda _: "wall")}, "kind region or patch"),
        ({"occluders": with_value(0, kind=lambda _: "region", axis=lambda _: 3)}, "axis from 0 to 2"),
        (
            {"occluders": lambda rows: [region_instead(rows)[0] | {"rectangles": [0.0]}]},
            "list of 4 numbers",
        ),
        ({"occluders": lambda rows: rows * 2}, "every occluder_id once"),
    ],
)
def test_broken_tables_are_bad_input(changes, wanted, tampered):
    with pytest.raises(InputError, match=wanted):
        tampered(**changes)


def test_honest_leaves_pass(honest):
    assert check_certificates(load(honest)).failed == 0


def shaft(draw, span, behind, *, flat):
    """V below height 0 or on it, X above `behind`, with or without sides of no length."""
    least = 0 if flat else 1
    v, x = (np.array([[draw(span), draw(span), 0], [0, 0, 0]]) for _ in range(2))
    for box in (v, x):
        box[1] = box[0] + [draw(st.integers(least, 5)) for _ in range(3)]
    v[:, 2] -= v[1, 2] + draw(st.integers(0, 4))
    x[:, 2] += behind + draw(st.integers(0, 5))
    return v, x


def turned_about(draw, *points):
    """The points with axes permuted and mirrored, small and far from the origin or large, and where axis 2 went."""
    order, signs = draw(st.permutations(range(3))), np.array([draw(st.sampled_from([-1, 1])) for _ in range(3)])
    scale, away = draw(st.sampled_from([(1, 0), (1, 2**24 - 128), (2**17 + 1, 0)]))
    return [np.asarray(p)[..., order] * signs * scale + away * signs for p in points], order.index(2)


def boxes_of(*groups):
    """Low and high corners again after mirroring."""
    return [np.array([group.min(axis=0), group.max(axis=0)]) for group in groups]


@given(st.data())
def test_regions_block_what_the_slow_reference_says(data):
    draw = data.draw
    flat = draw(st.booleans())
    v, x = shaft(draw, st.integers(-6, 6), 0, flat=flat)
    corners = st.tuples(*[st.integers(-12, 0)] * 2, *[st.integers(1, 24)] * 2)
    rectangles = np.array([[[u, w, 0], [u + a, w + b, 0]] for u, w, a, b in draw(st.lists(corners, max_size=5))])
    (v, x, *turned), axis = turned_about(draw, v, x, *rectangles)
    plane = int(turned[0][0, axis]) if turned else 0
    uv = [i for i in range(3) if i != axis]
    region = Region(axis, plane, [box[:, uv].tolist() for box in boxes_of(*turned)])
    v, x = boxes_of(v, x)
    assert leaf_holds(v.tolist(), x.tolist(), region) == slow_region(v.tolist(), x.tolist(), region)


@given(st.data())
def test_discs_block_what_the_slow_reference_says(data):
    draw = data.draw
    v, x = shaft(draw, st.integers(-6, 6), 4, flat=draw(st.integers(0, 9)) == 0)
    size = draw(st.sampled_from([12, 20, 40]))
    bend = st.integers(0, 3)
    ring = [[-size, -size, draw(bend)], [size, -size, draw(bend)], [size, size, draw(bend)], [-size, size, draw(bend)]]
    away = [draw(st.integers(-20, 20)), draw(st.integers(-20, 20)), 1]
    ring = np.array(ring) + np.array(away)
    (v, x, ring), _ = turned_about(draw, v, x, ring)
    # A step counts even where coordinates are large.
    ring[0] += draw(st.integers(-1, 1))
    disc = Disc(ring.tolist(), [ring[[0, 1, 2]].tolist(), ring[[0, 2, 3]].tolist()])
    v, x = boxes_of(v, x)
    assert leaf_holds(v.tolist(), x.tolist(), disc) == slow_disc(v.tolist(), x.tolist(), disc)


@pytest.mark.parametrize(("at", "holds"), [(-1, False), (0, True), (2, True), (4, True), (5, False)])
def test_flat_shafts_may_run_along_the_border_of_a_region(at, holds):
    region = Region(2, 0, [[[0, 0], [2, 4]], [[2, 0], [4, 4]]])
    v, x = [[at, 1, -3], [at, 2, -1]], [[at, 1, 2], [at, 3, 4]]
    assert leaf_holds(v, x, region) == leaf_holds(x, v, region) == holds


@pytest.mark.parametrize(
    ("eye", "far", "holds"),
    [((-2, 0), (1, 3), True), ((-2, 1), (2, 3), False), ((-2, 0), (0, 3), False), ((0, 0), (1, 3), False)],
)
def test_a_disc_may_touch_the_cell_but_not_the_box(eye, far, holds):
    a, b, c, d = [[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]
    disc = Disc([a, b, c, d], [[a, b, c], [a, c, d]])
    for way in (1, -1):
        v, x = (np.sort([[0, 0, way * a], [1, 1, way * b]], axis=0).tolist() for a, b in (eye, far))
        assert leaf_holds(v, x, disc) == slow_disc(v, x, disc) == holds


def cut_up(random, box, depth):
    """Parts of a box of six axes after random cuts across."""
    axis = random.integers(6)
    if depth == 0 or box[1, axis] - box[0, axis] < 2:
        return [box]
    at = random.integers(box[0, axis] + 1, box[1, axis])
    first, second = box.copy(), box.copy()
    first[1, axis] = second[0, axis] = at
    return cut_up(random, first, depth - random.integers(1, 3)) + cut_up(random, second, depth - 1)


def tiling(seed):
    """Low and high corner of a box of six axes and its parts, in random order; some sides are flat."""
    random = np.random.default_rng(seed)
    low = random.integers(-9, 9, 6)
    whole = np.stack([low, low + random.integers(0, 9, 6) * (random.random(6) < 0.8)])
    parts = [part.tolist() for part in cut_up(random, whole, 4)]
    return whole.tolist(), [parts[i] for i in random.permutation(len(parts))]


@given(st.integers(0, 2**32 - 1))
def test_cuts_tile(seed):
    whole, leaves = tiling(seed)
    assert tiled(*whole, leaves)


@given(st.integers(0, 2**32 - 1), st.integers(0, 1), st.integers(0, 5), st.sampled_from([-1, 1]), st.booleans())
def test_whatever_is_changed_in_a_tiling_is_noticed(seed, side, axis, change, drop):
    whole, leaves = tiling(seed)
    if drop:
        leaves = leaves[1:]
    else:
        leaves[0][side][axis] += change
    assert not tiled(*whole, leaves)


@given(st.integers(0, 2**32 - 1))
def test_triangles_in_a_union_of_boxes(seed):
    random = np.random.default_rng(seed)
    triangle = random.integers(0, 13, (1, 3, 3))
    if not np.cross(triangle[0, 1] - triangle[0, 0], triangle[0, 2] - triangle[0, 0]).any():
        return
    grid = np.array([[[a, b, c], [a + 4, b + 4, c + 4]] for a, b, c in product((0, 4, 8), repeat=3)])
    # Clipped to what each place holds, as pieces are, here by many points.
    weights = np.array([w for w in product(range(25), repeat=3) if sum(w) == 24])
    points = weights @ triangle[0]
    kept, cut = [], False
    for box in grid * 24:
        inside = points[((points >= box[0]) & (points <= box[1])).all(axis=1)]
        strictly = ((points > box[0]) & (points < box[1])).all(axis=1).any()
        if strictly and not cut and random.random() < 0.3:
            cut = True
        elif len(inside):
            kept.append(box // 24)
    assert in_boxes(triangle, as_ends(grid))
    if cut:
        assert not in_boxes(triangle, as_ends(kept))


def test_pieces_with_a_gap_of_a_step_do_not_hold_a_triangle():
    triangle = np.array([[[0, 0, 0], [10, 0, 0], [0, 10, 7]]])
    left, right = [[0, 0, 0], [5, 10, 7]], [[5, 0, 0], [10, 5, 4]]
    assert in_boxes(triangle, as_ends([left, right]))
    for side, axis, change in ((0, 0, 1), (1, 1, -1), (1, 2, -1)):
        changed = np.array([left, right])
        changed[1, side, axis] += change
        assert not in_boxes(triangle, as_ends(changed))


def test_patches_of_objects_with_small_triangles_are_found_again(tmp_path):
    """A screen whose mesh starts with scraps hides a box; the certificate names the large triangles among all."""
    screen = np.array([[0, -8, -8], [3, 8, -8], [3, 8, 8], [0, -8, 8]], float)
    scraps = np.array([[0, 0, 9], [0.1, 0, 9], [0, 0.1, 9.05]])
    corners = np.concatenate([scraps, screen[[0, 1, 2]], scraps + 1.0, screen[[0, 2, 3]]])
    corners = np.round(corners / GRID_M) * GRID_M
    mesh = Mesh(corners, np.arange(12, dtype=np.int32).reshape(-1, 3))
    crate = trimesh.creation.box([1.0, 1.0, 1.0])
    crate.apply_translation([6.0, 0.5, 0.5])
    shapes = [mesh, Mesh(np.array(crate.vertices), np.array(crate.faces, np.int32))]
    objects = [Instance(str(i), "", i, np.eye(4), Role.OCCLUDER) for i in range(2)]
    scene = Scene([Definition(str(i), (shape,)) for i, shape in enumerate(shapes)], objects)
    (tmp_path / "cells.csv").write_text("min_x,min_y,min_z,max_x,max_y,max_z\n-4,0,0,-3,1,1\n")
    settings = Settings(method="occluders", cells=str(tmp_path / "cells.csv"), certify=True)
    made = bake(scene, tmp_path / "out.bake", settings=settings)
    assert made.potential(0).tolist() == [0]
    found = check_certificates(made)
    assert found.failed == 0 and found.leaves > 0
