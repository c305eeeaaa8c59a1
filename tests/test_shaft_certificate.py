"""Certificates of a bake: true ones pass, and every kind of tampering is refused."""

import json
import runpy
import shutil
from itertools import product
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.database import load
from viewcell.data.errors import InputError
from viewcell.data.scene import GRID_M, Role
from viewcell.verify.shaft_certificate import (
    Disc,
    Region,
    check_certificates,
    has_certificates,
    in_boxes,
    leaf_holds,
    leaves_hold,
    tiled,
)
from viewcell.workbench.bake import Settings, bake
from viewcell.workbench.cli import main
from viewcell.workbench.verify import verify

SOLIDS = runpy.run_path(str(Path(__file__).with_name("random_solids.py")))


@pytest.fixture(scope="module")
def honest(tmp_path_factory):
    """A bake in which a wall along an axis and a turned one hide a chair, a post of many pieces, and a pane."""
    folder = tmp_path_factory.mktemp("certified")
    turned = trimesh.creation.box([0.2, 5, 4])
    turned.apply_transform(trimesh.transformations.rotation_matrix(0.6, [0, 0, 1]))
    turned.apply_translation([-3, 2, 2])
    meshes = [
        SOLIDS["box"]([2, -1, 0], [2.2, 5, 4]),
        turned,
        SOLIDS["box"]([3, 1.5, 0], [3.5, 2, 0.5]),
        SOLIDS["box"]([-5.5, 1.5, 0.5], [-5, 2, 1.5]),
        trimesh.creation.cylinder(0.1, segment=[[3, 0, 1], [5, 4, 2.5]], sections=5),
        SOLIDS["box"]([1, 3.5, 0], [1.1, 4.5, 1]),
    ]
    roles = [Role.OCCLUDER, Role.OCCLUDER, Role.DETAIL, Role.DETAIL, Role.DETAIL, Role.TRANSPARENT]
    cells = folder / "cells.csv"
    cells.write_text("min_x,min_y,min_z,max_x,max_y,max_z\n0.5,1,1,1.5,2,2\n-1,1.5,1.5,-0.5,2,2\n")
    settings = Settings(method="occluders", cells=str(cells), certify=True)
    scene = SOLIDS["scene_of_meshes"](meshes, roles)
    return bake(scene, folder / "honest.bake", settings=settings, threads=1).folder


@pytest.fixture
def tampered(honest, tmp_path):
    """A function: what a check finds after a change of the rows of some tables."""

    def check(**changes):
        folder = Path(shutil.copytree(honest, tmp_path / "tampered.bake"))
        for name, change in changes.items():
            table = pq.read_table(folder / f"{name}.parquet")
            rows = change(table.to_pylist())
            pq.write_table(pa.Table.from_pylist(rows, schema=table.schema), folder / f"{name}.parquet")
        found = check_certificates(load(folder))
        assert found.failed and not verify(load(folder), rays=0).ok
        return found

    return check


def with_value(row, **values):
    """A change of one row of a table."""

    def change(rows):
        rows[row] |= {name: value(rows[row][name]) for name, value in values.items()}
        return rows

    return change


def number_of(honest, name, wanted):
    return next(
        row for row, values in enumerate(pq.read_table(honest / f"{name}.parquet").to_pylist()) if wanted(values)
    )


def occluder_number(honest, kind):
    return number_of(honest, "occluders", lambda row: row["kind"] == kind)


def step(value):
    return value + GRID_M


def test_an_honest_bake_passes(honest):
    made = load(honest)
    found = check_certificates(made)
    assert found.failed == 0 and found.examples == []
    assert found.covered == (~made.potential_objects).sum() > 4
    kinds = set(pq.read_table(honest / "occluders.parquet")["kind"].to_pylist())
    assert kinds == {"region", "patch"}
    result = verify(made, rays=20_000)
    assert result.ok and f"| certificates | {found.line()} |" in result.table()


def test_a_bake_without_certificates_is_not_asked_for_them(honest, tmp_path):
    folder = Path(shutil.copytree(honest, tmp_path / "plain.bake"))
    for name in ("proofs", "leaves", "occluders"):
        (folder / f"{name}.parquet").unlink()
    # It promised them.
    with pytest.raises(InputError, match="found nothing there"):
        verify(load(folder), rays=0)
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["settings"]["certify"] = False
    (folder / "manifest.json").write_text(json.dumps(manifest))
    made = load(folder)
    assert not has_certificates(made)
    assert verify(made, rays=0).certificates is None


def test_every_leaf_holds_by_the_slow_reference_too(honest):
    rows = pq.read_table(honest / "leaves.parquet").to_pylist()
    scene = load(honest).scene
    triangles, owners = scene.triangles()
    occluders = {}
    for row in pq.read_table(honest / "occluders.parquet").to_pylist():
        if row["kind"] == "region":
            rectangles = np.round(np.array(row["rectangles"]) / GRID_M).astype(np.int64).reshape(-1, 2, 2)
            occluders[row["occluder_id"]] = Region(row["axis"], round(row["coordinate"] / GRID_M), rectangles)
        else:
            outline = np.round(np.array(row["corners"]) / GRID_M).astype(np.int64).reshape(-1, 3).tolist()
            mesh = triangles[owners == row["object_id"]].astype(np.int64)
            occluders[row["occluder_id"]] = Disc(outline, mesh[row["triangles"]])
    for row in rows[:: max(1, len(rows) // 200)]:
        corners = np.round(np.array(list(row.values())[2:]) / GRID_M).astype(np.int64).reshape(2, 2, 3)
        assert leaf_holds(*corners, occluders[row["occluder_id"]])


def test_a_missing_leaf(tampered):
    found = tampered(leaves=lambda rows: rows[1:])
    assert (found.failed_leaves, found.failed_proofs) == (0, 1) and "do not tile" in found.examples[0]


def test_a_repeated_leaf(tampered):
    assert tampered(leaves=lambda rows: [*rows, rows[0]]).failed_proofs == 1


@pytest.mark.parametrize("side", [f"{box}_max_{axis}" for box in "vx" for axis in "xyz"])
def test_a_grown_leaf(side, tampered):
    assert tampered(leaves=with_value(0, **{side: step})).failed_proofs == 1


@pytest.mark.parametrize("axis", "xyz")
def test_a_grown_proof(axis, tampered):
    assert tampered(proofs=with_value(0, **{f"max_{axis}": step})).failed_proofs == 1


def test_a_proof_for_another_cell(tampered):
    found = tampered(proofs=with_value(0, cell_id=lambda cell: 1 - cell))
    assert found.failed_proofs >= 1 and found.failed_leaves == 0


def test_missing_proofs(tampered, honest):
    rows = pq.read_table(honest / "proofs.parquet").to_pylist()
    gone = {row["proof_id"] for row in rows if row["cell_id"] == 0}
    found = tampered(
        proofs=lambda rows: [row for row in rows if row["proof_id"] not in gone],
        leaves=lambda rows: [row for row in rows if row["proof_id"] not in gone],
    )
    assert found.failed == found.uncovered > 1
    assert found.examples[0].startswith("cell 0, object ")


def test_an_object_that_is_hidden_without_proof(tampered):
    found = tampered(cell_to_object=lambda rows: rows[1:])
    assert (found.failed, found.uncovered) == (1, 1)


@pytest.mark.parametrize("kind", ["region", "patch"])
def test_a_swapped_occluder(kind, tampered, honest):
    number = occluder_number(honest, kind)
    table = pq.read_table(honest / "occluders.parquet")
    ids, kinds = table["occluder_id"].to_pylist(), table["kind"].to_pylist()
    other = next(i for i, k in zip(ids, kinds, strict=True) if k != kind)
    leaf = number_of(honest, "leaves", lambda row: row["occluder_id"] == ids[number])
    found = tampered(leaves=with_value(leaf, occluder_id=lambda _: other))
    assert found.failed_leaves == 1 and found.failed_occluders == 0


@pytest.mark.parametrize("side", range(4))
def test_a_larger_rectangle(side, tampered, honest):
    number = occluder_number(honest, "region")

    def grow(values):
        values[side] += GRID_M if side > 1 else -GRID_M
        return values

    assert tampered(occluders=with_value(number, rectangles=grow)).failed_occluders == 1


@pytest.mark.parametrize("values", [{"coordinate": lambda k: k + 0.5}, {"axis": lambda axis: (axis + 1) % 3}])
def test_a_wrong_plane(values, tampered, honest):
    found = tampered(occluders=with_value(occluder_number(honest, "region"), **values))
    assert found.failed_occluders == 1 and found.failed_leaves > 0 and "not opaque" in found.line() + found.examples[0]


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
def test_a_false_disc(values, tampered, honest):
    found = tampered(occluders=with_value(occluder_number(honest, "patch"), **values))
    assert found.failed_occluders == 1 and found.failed_leaves > 0


@pytest.mark.parametrize("wall", [0, 1])
def test_a_wall_made_transparent(wall, tampered):
    found = tampered(objects=with_value(wall, role=lambda _: "transparent"))
    assert found.failed_occluders > 0 and found.uncovered > 0


def test_refuted_certificates_fail_the_command(honest, tmp_path, capsys):
    folder = Path(shutil.copytree(honest, tmp_path / "tampered.bake"))
    assert main(["verify", str(folder), "--rays", "0"]) == 0
    table = pq.read_table(folder / "leaves.parquet")
    pq.write_table(table.slice(1), folder / "leaves.parquet")
    assert main(["verify", str(folder), "--rays", "0"]) == 1
    assert "refuted: proof " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ({"leaves": with_value(0, occluder_id=lambda _: 10**6)}, "occluder_id of a row"),
        ({"leaves": with_value(0, proof_id=lambda _: -1)}, "proof_id of a row"),
        ({"leaves": with_value(0, v_min_x=lambda x: x + 1e-6)}, "expected multiples"),
        ({"leaves": with_value(0, v_min_x=lambda _: 1e9)}, "within the grid"),
        ({"proofs": with_value(0, cell_id=lambda _: 2)}, "cell_id from 0 to 1"),
        ({"proofs": lambda rows: [*rows, rows[0]]}, "every id once"),
        ({"occluders": with_value(0, kind=lambda _: "wall")}, "kind region or patch"),
        ({"occluders": with_value(0, kind=lambda _: "region", axis=lambda _: 3)}, "axis from 0 to 2"),
        ({"occluders": with_value(0, kind=lambda _: "region", rectangles=lambda _: [0.0])}, "list of 4 numbers"),
    ],
)
def test_broken_tables_are_bad_input(changes, wanted, tampered):
    with pytest.raises(InputError, match=wanted):
        tampered(**changes)


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
    region = Region(axis, plane, np.array([box[:, uv] for box in boxes_of(*turned)], np.int64).reshape(-1, 2, 2))
    v, x = boxes_of(v, x)
    slow = leaf_holds(v, x, region)
    fast = bool(leaves_hold(np.concatenate([v, x])[None].astype(np.int32), np.zeros(1, int), [region])[0])
    # Where all segments cross on one line, it must lie along raster cells of one side of it.
    assert fast == slow or (flat and slow)


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
    disc = Disc(ring.tolist(), np.array([ring[[0, 1, 2]], ring[[0, 2, 3]]], np.int64))
    v, x = boxes_of(v, x)
    fast = leaves_hold(np.concatenate([v, x])[None].astype(np.int32), np.zeros(1, int), [disc])[0]
    assert fast == leaf_holds(v, x, disc)


def both_ways(v, x, occluder):
    """What the fast check says of a leaf, and the slow one."""
    boxes = np.array([[*v, *x]], np.int32)
    return bool(leaves_hold(boxes, np.zeros(1, int), [occluder])[0]), leaf_holds(np.array(v), np.array(x), occluder)


@pytest.mark.parametrize(("at", "holds"), [(-1, False), (0, True), (2, True), (4, True), (5, False)])
def test_flat_shafts_may_run_along_the_border_of_a_region(at, holds):
    region = Region(2, 0, np.array([[[0, 0], [2, 4]], [[2, 0], [4, 4]]]))
    for v, x in product([[[at, 1, -3], [at, 2, -1]]], [[[at, 1, 2], [at, 3, 4]]]):
        assert both_ways(v, x, region) == both_ways(x, v, region) == (holds, holds)


@pytest.mark.parametrize(
    ("eye", "far", "holds"),
    [((-2, 0), (1, 3), True), ((-2, 1), (2, 3), False), ((-2, 0), (0, 3), False), ((0, 0), (1, 3), False)],
)
def test_a_disc_may_touch_the_cell_but_not_the_box(eye, far, holds):
    ring = np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]])
    disc = Disc(ring.tolist(), np.array([ring[[0, 1, 2]], ring[[0, 2, 3]]], np.int64))
    for way in (1, -1):
        v, x = (np.sort([[0, 0, way * a], [1, 1, way * b]], axis=0) for a, b in (eye, far))
        assert both_ways(v, x, disc) == (holds, holds)


def test_many_leaves_of_many_occluders_at_once():
    random = np.random.default_rng(0)
    wall = np.array([[[-25, -25], [25, 25]], [[25, -25], [60, 0]]])
    ring = np.array([[-30, -30, 2], [30, -30, 0], [30, 30, 1], [-30, 30, 0]])
    occluders = [
        Region(2, 1, wall),
        Disc(ring.tolist(), np.array([ring[[0, 1, 2]], ring[[0, 2, 3]]], np.int64)),
        Region(0, 3, wall),
        Disc(ring[:3].tolist(), ring[None, :3].astype(np.int64)),
    ]
    low = random.integers(-30, 30, (800, 2, 3))
    low[:, 0, 2], low[:, 1, 2] = -random.integers(20, 40, 800), random.integers(3, 40, 800)
    boxes = np.stack([low, low + random.integers(1, 20, (800, 2, 3))], axis=2).reshape(-1, 4, 3)
    flip = random.random(800) < 0.5
    boxes[flip] = boxes[flip][:, [2, 3, 0, 1]]
    occluder = random.integers(0, 4, 800)
    fast = leaves_hold(boxes.astype(np.int32), occluder, occluders)
    slow = [leaf_holds(box[:2], box[2:], occluders[k]) for box, k in zip(boxes, occluder, strict=True)]
    assert fast.tolist() == slow
    assert all(0 < fast[occluder == k].mean() < 1 for k in range(3))


def cut_up(random, box, depth):
    """Parts of a box of six axes after random cuts across."""
    axis = random.integers(6)
    if depth == 0 or box[1, axis] - box[0, axis] < 2:
        return [box]
    at = random.integers(box[0, axis] + 1, box[1, axis])
    first, second = box.copy(), box.copy()
    first[1, axis] = second[0, axis] = at
    return cut_up(random, first, depth - random.integers(1, 3)) + cut_up(random, second, depth - 1)


def tiling(seed, proofs=3, depth=4):
    """Cells, boxes, leaves and the proof of each, in random order; some sides are flat."""
    random = np.random.default_rng(seed)
    low = random.integers(-9, 9, (proofs, 6))
    whole = np.stack([low, low + random.integers(0, 9, (proofs, 6)) * (random.random((proofs, 6)) < 0.8)], axis=1)
    parts = [cut_up(random, box, depth) for box in whole]
    proof = np.repeat(np.arange(proofs), [len(part) for part in parts])
    leaves = np.concatenate(parts)
    order = random.permutation(len(leaves))
    leaves = leaves[order].reshape(-1, 2, 2, 3).transpose(0, 2, 1, 3).reshape(-1, 4, 3)
    return whole[:, :, :3], whole[:, :, 3:], proof[order], leaves


@given(st.integers(0, 2**32 - 1))
def test_cuts_tile(seed):
    cells, boxes, proof, leaves = tiling(seed)
    assert tiled(cells, boxes, proof, leaves).all()


@given(st.integers(0, 2**32 - 1), st.integers(0, 11), st.sampled_from([-1, 1]), st.booleans())
def test_whatever_is_changed_in_a_tiling_is_noticed(seed, place, change, drop):
    cells, boxes, proof, leaves = tiling(seed)
    broken = proof[0]
    if drop:
        proof, leaves = proof[1:], leaves[1:]
    else:
        leaves[0, place // 3, place % 3] += change
    assert tiled(cells, boxes, proof, leaves).tolist() == [row != broken for row in range(len(cells))]


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
    assert in_boxes(triangle, grid)
    if cut:
        assert not in_boxes(triangle, np.array(kept).reshape(-1, 2, 3))


def test_pieces_with_a_gap_of_a_step_do_not_hold_a_triangle():
    triangle = np.array([[[0, 0, 0], [10, 0, 0], [0, 10, 7]]])
    left, right = [[0, 0, 0], [5, 10, 7]], [[5, 0, 0], [10, 5, 4]]
    assert in_boxes(triangle, np.array([left, right]))
    for side, axis, change in ((0, 0, 1), (1, 1, -1), (1, 2, -1)):
        changed = np.array([left, right])
        changed[1, side, axis] += change
        assert not in_boxes(triangle, changed)
