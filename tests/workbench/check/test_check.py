"""`viewcell check`: finds what is planted in anybody's sets, nothing in true ones, and says how sure it is."""

import dataclasses
import json
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
import viewcell
from builders import four_rooms, small_house, turned_house
from scipy.spatial import cKDTree
from viewcell import InputError
from viewcell.data.scene import Role
from viewcell.data.store.bake_folder import cells_table
from viewcell.data.store.claims import Claims
from viewcell.data.store.scene_folder import write_scene
from viewcell.data.store.view_cells import view_cells
from viewcell.verify.check_result import WrongPair
from viewcell.verify.exact.sightline import Sightlines
from viewcell.verify.rays.clearance import clearances
from viewcell.verify.rays.confidence import Confidence
from viewcell.verify.rays.embree import Candidates
from viewcell.verify.rays.free_space import FreeSpace
from viewcell.verify.rays.second_look import SecondLook
from viewcell.verify.rays.targets import Targets
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.check.run import _Hunt, assert_conservative, check
from viewcell.workbench.cli import main

GRID = 2.0**-10
RAYS = 60_000


@pytest.fixture
def house(tmp_path):
    return small_house.small_house(tmp_path)


def boxes_of(house):
    return cells_table(house.graph, GRID)


def pairs_of(matrix, rows, target):
    kept = [(cell, other) for cell, other in np.argwhere(matrix).tolist() if rows[cell]]
    return pa.table({"cell_id": [cell for cell, _ in kept], target: [other for _, other in kept]})


@pytest.fixture
def claims(house):
    """True claims about objects and about cells."""
    rows = house.graph.inhabitable
    return [
        pairs_of(house.potential_objects, rows, "object_id"),
        pairs_of(house.potential_cells, rows, "reached_cell_id"),
    ]


def without(table, row):
    return table.filter(pa.array(np.arange(table.num_rows) != row))


def test_true_sets_stand(house, claims):
    result = check(house.scene, claims, boxes_of(house), rays=RAYS)
    assert result.ok and not result.wrong
    assert result.rays >= RAYS and result.uniform.sum() > RAYS / 8
    for kind in ("object", "cell"):
        claimed, seen, wrong = result.by_cell(kind)
        assert (seen <= claimed).all() and not wrong.any()
        assert seen.sum() > 0.9 * claimed.sum()
    assert "with 95 % confidence no view cell of 4 hides more than" in result.confidence_line()
    assert "| objects | " in result.table() and "worst cells for cells" in result.table()


@pytest.mark.parametrize("kind", ["object", "cell"])
def test_every_omission_is_found(house, claims, kind):
    place = ("object", "cell").index(kind)
    names = ("object_id", "reached_cell_id")
    own = claims[place]["cell_id"].to_numpy() == claims[place][names[place]].to_numpy()
    rows = np.flatnonzero(~own) if kind == "cell" else np.arange(claims[place].num_rows)
    rows = rows[:: max(1, len(rows) // 6)]
    for row in rows:
        cut = [*claims]
        cut[place] = without(claims[place], row)
        result = check(house.scene, cut, boxes_of(house), rays=RAYS, seed=int(row))
        pair = tuple(int(claims[place][name][int(row)].as_py()) for name in ("cell_id", names[place]))
        assert [(w.kind, w.cell, w.target) for w in result.wrong] == [(kind, *pair)]
        assert not result.ok and result.confidence_line() == "none: the claims are refuted"
        assert result.wrong[0].margin > 0
        text = result.table()
        called = house.graph.cell_names
        seen = f"cell {pair[1]} ({called[pair[1]]})" if kind == "cell" and called[pair[1]] else f"{kind} {pair[1]}"
        assert f"cell {pair[0]} ({called[pair[0]]}) sees {seen}" in text and "clear of everything by" in text


def test_the_order_of_cells_and_names_do_not_matter(house, claims):
    table = boxes_of(house)
    order = np.random.default_rng(0).permutation(table.num_rows)
    names = np.array([placed.name for placed in house.scene.objects], object)
    assert len(set(names)) == len(names)
    named = claims[0].set_column(1, "object_id", pa.array(names[claims[0]["object_id"].to_numpy()].tolist()))
    result = check(house.scene, named, table.take(order), rays=RAYS)
    assert result.ok and result.claimed["object"].sum() == claims[0].num_rows


def test_cells_are_snapped_into_the_given_boxes(house):
    table = pa.table({name: [0.1 * GRID, 9.9 * GRID] for name in ("min_x", "min_y", "min_z")})
    for name in ("max_x", "max_y", "max_z"):
        table = table.append_column(name, pa.array([8.9 * GRID, 99.9 * GRID]))
    inner = view_cells(table, house.scene, "boxes", inwards=True).graph.cells
    outer = view_cells(table, house.scene, "boxes").graph.cells
    assert inner[:, :, 0].tolist() == [[1, 8], [10, 99]] and outer[:, :, 0].tolist() == [[0, 9], [9, 100]]


@pytest.mark.parametrize("written", [False, True])
def test_no_eye_is_outside_the_given_boxes(written, house, claims, tmp_path):
    """Cells that are off the grid become smaller, not larger: what is judged is in the cell that was asked about."""
    table = boxes_of(house)
    moved = {f"{side}_{a}": by * GRID for side, by in (("min", 0.3), ("max", -0.4)) for a in "xyz"}
    for name, by in moved.items():
        place = table.column_names.index(name)
        table = table.set_column(place, name, pa.array(table[name].cast(pa.float64()).to_numpy() + by))
    if written:
        pq.write_table(table, tmp_path / "cells.parquet")
    found = check(house.scene, claims, tmp_path / "cells.parquet" if written else table, rays=RAYS)
    for side, name in enumerate(("min", "max")):
        given = np.column_stack([table[f"{name}_{a}"].to_numpy() for a in "xyz"]) / GRID
        assert ((found.boxes[:, side] - given) * (1, -1)[side] > 0).all()
    assert found.ok


def test_view_cells_of_a_bake_lie_where_the_bake_does(house, tmp_path):
    """A bake's own origin counts, and the model may have another."""
    here, there = np.array([1000.0, -3000.0, 20.0]), np.array([1016.0, -3016.0, 24.0])
    made = bake(dataclasses.replace(house.scene, origin=here), tmp_path / "b", threads=1)
    objects = [
        dataclasses.replace(placed, transform=placed.transform - np.pad((there - here)[:, None], ((0, 1), (3, 0))))
        for placed in house.scene.objects
    ]
    for scene, origin in (
        (dataclasses.replace(house.scene, origin=here), here),
        (dataclasses.replace(house.scene, objects=objects, origin=there), there),
    ):
        found = assert_conservative(made, scene, rays=RAYS)
        assert (found.boxes == made.graph.cells - (origin - here) / GRID).all()
        assert found.by_cell("object")[1].sum() > 0


def test_everything_claimed_is_never_wrong(house):
    everything = np.ones((house.graph.cell_count, len(house.scene.objects)), bool)
    result = check(house.scene, everything, boxes_of(house), rays=RAYS)
    assert result.ok and "exact: everything is claimed" in result.confidence_line()
    assert result.by_cell("object")[1].sum() > 0


def test_a_seed_repeats_the_answer(house, claims):
    cut = without(claims[0], 3)
    first, second = (check(house.scene, cut, boxes_of(house), rays=RAYS, seed=5) for _ in range(2))
    assert [(w.origin.tolist(), w.end.tolist()) for w in first.wrong] == [
        (w.origin.tolist(), w.end.tolist()) for w in second.wrong
    ]
    assert np.array_equal(first.seen["object"], second.seen["object"])


def test_clearances_are_distances():
    random = np.random.default_rng(3)
    triangles = random.integers(-60, 60, (40, 1, 3)) + random.integers(-9, 9, (40, 3, 3))
    owners = np.repeat(np.arange(8), 5)
    origins, ends = random.uniform(-60, 60, (60, 3)), random.uniform(-60, 60, (60, 3))
    targets = random.integers(-1, 8, 60)
    segments, hit, _ = Sightlines(triangles).hits(origins, ends)
    pierced = set(segments[owners[hit] != targets[segments]].tolist())
    clear = np.array([row for row in range(60) if row not in pierced])
    assert len(clear) > 30
    found, objects = clearances(origins[clear], ends[clear], targets[clear], triangles, owners)
    share = np.linspace(0, 1, 60)
    u, v = (part.ravel() for part in np.meshgrid(share, share))
    u, v = (part[u + v <= 1][:, None] for part in (u, v))
    on = triangles[:, :1] + u * (triangles[:, 1:2] - triangles[:, :1]) + v * (triangles[:, 2:] - triangles[:, :1])
    for row, number in enumerate(clear):
        along = origins[number] + share[:, None] * (ends[number] - origins[number])
        trees = {k: cKDTree(on[owners == k].reshape(-1, 3)) for k in range(8) if k != targets[number]}
        near = {k: tree.query(along)[0].min() for k, tree in trees.items()}
        ranked = sorted(near.values())[:3]
        # Samples are up to 2 steps apart, so their distances are a little too long.
        assert (found[row] <= np.array(ranked) + 1e-9).all() and (found[row] >= np.array(ranked) - 2).all()
        assert all(near[k] - 2 <= d <= near[k] for k, d in zip(objects[row], found[row], strict=True))


def test_a_second_look_sees_what_is_visible_and_nothing_else(house):
    sources = np.flatnonzero(house.graph.inhabitable)
    triangles, owners = house.scene.triangles()
    opaque = house.scene.object_mask(Role.OCCLUDER, Role.DETAIL)[owners]
    boxes, lines = house.graph.cells, Sightlines(triangles[opaque], owners[opaque])
    free = FreeSpace(boxes[sources], [np.zeros((0, 3), np.float32)] * len(sources), lines)
    targets = Targets(triangles, owners, len(house.scene.objects), boxes)
    look = SecondLook(free, targets, (triangles[opaque], owners[opaque]))
    truth = np.concatenate([house.potential_objects, house.potential_cells], axis=1)[sources]
    rows, columns = (part.ravel() for part in np.indices(truth.shape))
    seen, cast = look.see(rows, columns, 1000, 0)
    assert not (seen & ~truth.ravel()).any()
    # A wall of which a sliver shows through two doorways takes more than a thousand rays.
    assert seen.sum() >= truth.sum() - 3
    assert len(rows) < cast < 1000 * len(rows)
    # Whatever side of the desk a ray is aimed at, from within its room it meets the desk.
    room, desk = np.full(500, list(sources).index(2)), np.full(500, len(house.scene.objects) - 2)
    assert look.see(room, desk, 1, 0)[0].mean() > 0.95
    glass = house.scene.objects[-1].role is Role.TRANSPARENT
    assert glass and seen.reshape(truth.shape)[:, len(house.scene.objects) - 1].any()


def test_a_second_look_never_looks_from_within_a_solid():
    """A solid hides what is in it, from a view cell that reaches into the solid and from one that is all inside."""
    solid, hidden = ((small_house.UNIT_BOX * size + low)[small_house.FACES] for size, low in ((1000, 0), (99, 40)))
    triangles, owners = np.concatenate([solid, hidden]).astype(np.int64), np.repeat([0, 1], 12)
    boxes, lines = np.array([[[-30, 0, 0], [30, 90, 90]], [[300] * 3, [400] * 3]]), Sightlines(triangles, owners)
    free = FreeSpace(boxes, [np.zeros((0, 3), np.float32)] * 2, lines)
    look = SecondLook(free, Targets(triangles, owners, 2, np.zeros((0, 2, 3), int)), (triangles, owners))
    pairs = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
    assert look.see(*pairs.T, 3000, 0)[0].tolist() == [True, False, False, False]


def test_confidence_holds_as_often_as_it_says():
    hole, random = 0.05, np.random.default_rng(0)
    statement = Confidence(np.array([400]))
    missed = (random.random((20_000, 400)) > hole / (4 * np.pi)).all(axis=1).mean()
    assert abs(missed - statement.chance_missed(hole)) < 0.01
    # The size that is ruled out is missed with just the chance that is left.
    assert Confidence(np.array([400])).chance_missed(statement.holes_sr[0]) == pytest.approx(0.05)
    many = Confidence(np.full(100, 400))
    assert many.chance_missed(many.holes_sr[0]) == pytest.approx(0.05 / 100)
    assert Confidence(np.array([400, 0])).line() == "none: a view cell got no random ray"
    # Of several cells the one with the fewest rays counts; without rays nothing is ruled out.
    uneven = Confidence(np.array([100, 10_000, 3000]))
    assert uneven.chance_missed(hole) == pytest.approx((1 - hole / (4 * np.pi)) ** 100)
    assert uneven.holes_sr.argmax() == 0 and (np.diff(uneven.holes_sr[[1, 2, 0]]) > 0).all()
    assert (
        "at least 100 random rays per cell" in uneven.line() and f"{uneven.holes_sr[0]:.2g} sr of what" in uneven.line()
    )
    alone = 4 * np.pi * (1 - 0.01 ** (1 / 100))
    assert f"a hole of {alone:.2g} sr in a given cell" in uneven.line()
    assert Confidence(np.array([0, 5])).holes_sr[0] == pytest.approx(4 * np.pi)
    assert Confidence(np.array([0, 5])).chance_missed(9.0) == 1.0 == Confidence(np.zeros(0, int)).chance_missed(9.0)


def test_confidence_in_many_cells_at_once_holds_as_often_as_it_says():
    """Holes of just the size that is ruled out, one in every cell: that any is missed happens in 5 of 100 checks."""
    random, rays = np.random.default_rng(1), np.array([50, 200, 800, 200])
    sizes = Confidence(rays).holes_sr / (4 * np.pi)
    missed = random.random((20_000, 4)) < (1 - sizes) ** rays
    assert abs(missed.any(axis=1).mean() - 0.05) < 0.006


def write_inputs(folder, house, claims):
    write_scene(house.scene, folder / "house.scene")
    pq.write_table(boxes_of(house), folder / "cells.parquet")
    pyarrow.csv.write_csv(claims[0], folder / "pvs.csv")
    return [str(folder / "house.scene"), "--cells", str(folder / "cells.parquet"), "--pvs", str(folder / "pvs.csv")]


def test_command_line(house, claims, tmp_path, capsys):
    arguments = ["check", *write_inputs(tmp_path, house, claims), "--rays", str(RAYS)]
    assert main([*arguments, "--out", str(tmp_path / "clean")]) == 0
    assert "with 95 % confidence" in capsys.readouterr().out
    assert main(["check", "--replay", str(tmp_path / "clean")]) == 0
    assert "0 of 0 sightlines are clear" in capsys.readouterr().out
    cut = without(claims[0], 2)
    pyarrow.csv.write_csv(cut, tmp_path / "pvs.csv")
    assert main([*arguments, "--out", str(tmp_path / "found")]) == 1
    assert "wrong-hidden, the clearest sightlines first:" in capsys.readouterr().out
    assert main(["check", "--replay", str(tmp_path / "found")]) == 1
    assert "1 of 1 sightlines are clear" in capsys.readouterr().out
    rows = pq.read_table(tmp_path / "found" / "wrong_hidden.parquet").to_pylist()
    missing = {name: claims[0][name][2].as_py() for name in claims[0].column_names}
    assert (rows[0]["cell"], rows[0]["target"]) == (missing["cell_id"], missing["object_id"])
    assert rows[0]["passes"] and rows[0]["margin"] == rows[0]["clearances"][0] > 0
    cells = pq.read_table(tmp_path / "found" / "cells.parquet").to_pylist()
    assert sum(row["wrong_hidden_objects"] for row in cells) == 1
    assert json.loads((tmp_path / "found" / "manifest.json").read_text())["wrong_hidden"] == 1


def test_a_sightline_that_is_blocked_by_now_is_told(house, claims, tmp_path, capsys):
    arguments = ["check", *write_inputs(tmp_path, house, [without(claims[0], 2)]), "--rays", str(RAYS)]
    assert main([*arguments, "--out", str(tmp_path / "found")]) == 1
    rows = pq.read_table(tmp_path / "found" / "wrong_hidden.parquet").to_pylist()
    for name in ("direction_x", "direction_y", "direction_z"):
        rows[0][name] = -rows[0][name]
    schema = pq.read_schema(tmp_path / "found" / "wrong_hidden.parquet")
    pq.write_table(pa.Table.from_pylist(rows, schema), tmp_path / "found" / "wrong_hidden.parquet")
    capsys.readouterr()
    assert main(["check", "--replay", str(tmp_path / "found")]) == 0
    assert "no longer visible: cell" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"min_x": 400.0, "max_x": 401.0}, "expected view cells within 10 m of the model, found cell 0 outside"),
        ({"max_x": 0.0}, "found cell 0 without volume"),
        ({"min_x": float("nan")}, "expected finite numbers"),
        ({"cell_id": 2}, "expected each cell_id once, found 2 2 times"),
    ],
)
def test_bad_cells_are_refused(house, claims, change, words):
    rows = boxes_of(house).to_pylist()
    rows[0].update(change)
    with pytest.raises(InputError, match=words):
        check(house.scene, claims[0], pa.Table.from_pylist(rows), rays=RAYS)


def test_words_are_no_flags(house, claims):
    table = boxes_of(house)
    words = pa.array(["yes" if flag else "no" for flag in table["inhabitable"].to_pylist()])
    with pytest.raises(InputError, match="cells: expected true or false as inhabitable, found 'yes'"):
        check(house.scene, claims[0], table.set_column(7, "inhabitable", words), rays=RAYS)


def candidates(*rows):
    """Suspects (row of the view cells, kind, target, origin, direction, reach)."""
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return Candidates(*columns[:3], *(column.astype(float) for column in columns[3:]))


def test_only_what_the_judge_calls_visible_accuses(house):
    """A suspect that grazes, one that is blocked, one that starts in a wall, and the same pair twice."""
    view = view_cells(boxes_of(house), house.scene, "cells", inwards=True)
    objects, cells = house.potential_objects.copy(), house.potential_cells.copy()
    cells[0, 2], objects[2, 17] = False, False
    hunt = _Hunt(house.scene, view, Claims(objects, cells), RAYS, 0)
    along, diagonal = [1.0, 0, 0], [0.6, 0.8, 0]
    room = int(np.flatnonzero(hunt.result.sources == 2)[0])
    hunt.judge_suspects(
        candidates(
            # Along the edge of doorway 1, into the wall beside it, and from within the outer wall.
            (0, 0, 2, [2500.0, 960, 640], along, 4000.0),
            (0, 0, 2, [2500.0, 961, 640], along, 4000.0),
            (0, 0, 2, [-10.0, 640, 640], along, 4000.0),
            # Along the top of the desk, past it, and from within it.
            (room, 1, 17, [2900.0, 2200, 512], along, 940.0),
            (room, 1, 17, [2900.0, 2200, 600], along, 940.0),
            (room, 1, 17, [4000.0, 2200, 200], along, 100.0),
        )
    )
    assert hunt.result.wrong == [] and (hunt.result.grazes, hunt.result.blocked) == (3, 3)
    clear = (0, 0, 2, [2500.0, 640, 640], along, 4000.0)
    desk = (room, 1, 17, [2900.0, 2200, 200], along, 940.0)
    hunt.judge_suspects(candidates(clear, clear, desk, (0, 0, 2, [2400.0, 600, 640], diagonal, 100.0)))
    assert [(w.kind, w.cell, w.target) for w in hunt.result.wrong] == [("cell", 0, 2), ("object", 2, 17)]


def test_a_narrow_sightline_is_told(house, claims):
    """The desk alone is 0.3 of a step off the grid, so a sightline through a slit may be there by snapping only."""
    result = check(house.scene, without(claims[0], 2), boxes_of(house), rays=RAYS)
    assert not result.notes
    objects = [*house.scene.objects]
    transform = objects[-2].transform.copy()
    transform[0, 3] += 0.3 * GRID
    objects[-2] = dataclasses.replace(objects[-2], transform=transform)
    scene = dataclasses.replace(house.scene, objects=objects)
    result = check(scene, without(claims[0], 2), boxes_of(house), rays=RAYS)
    assert result.wrong and result.snap_m == pytest.approx(0.3 * GRID) and not result.notes
    result.wrong[:] = []
    hunt = _Hunt(
        scene, view_cells(boxes_of(house), scene, "cells", inwards=True), Claims(house.potential_objects), RAYS, 0
    )
    # From a corner of room 2 along its wall, a tenth of a step off it.
    hunt.result.wrong.append(WrongPair("cell", 2, 2, np.array([3000.0, 0.1, 900]), np.array([4000.0, 0.1, 900])))
    hunt.measure()
    assert "1 sightline cleared everything by less than vertices were moved" in hunt.result.table()


def test_cells_inside_solids_are_refused(house):
    # The outer wall on the low side of x, whole.
    inside = {"min": (-3.5 * 64, 0, 0), "max": (-0.5 * 64, 100, 100)}
    box = {f"{side}_{axis}": [corner[i] * GRID] for side, corner in inside.items() for i, axis in enumerate("xyz")}
    with pytest.raises(InputError, match="expected view cells with a point outside every solid, found none in cell 0"):
        check(house.scene, {"cell_id": [0], "object_id": [0]}, pa.table(box), rays=RAYS)


def test_bad_input_is_one_line(house, claims, tmp_path, capsys):
    arguments = write_inputs(tmp_path, house, claims)
    graph = str(four_rooms.write_graph(tmp_path / "rooms"))
    pq.write_table(claims[0], tmp_path / "objects.parquet")
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "letter.txt").write_text("mine")
    (tmp_path / "glass.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\ng glass window\nf 1 2 3\n")
    cases = [
        (["check"], "expected a model or --replay FOLDER, found neither"),
        (["check", arguments[0]], "expected claims beside it, found none"),
        (["check", arguments[0], "--pvs", arguments[4]], "expected a table of view cells beside it, found none"),
        (["check", *arguments, "--rays", "0"], "expected a whole number from 1"),
        (["check", *arguments, "--out", str(tmp_path / "taken")], "found something else there"),
        (
            ["check", graph, "--pvs", str(tmp_path / "objects.parquet")],
            "expected claims of cells for a model without objects",
        ),
        (["check", str(tmp_path / "glass.obj"), *arguments[1:]], "expected"),
        (["check", "--replay", str(tmp_path)], "expected a check folder's manifest"),
    ]
    for words, said in cases:
        assert main(words) == 2
        out, err = capsys.readouterr()
        assert out == "" and err.count("\n") == 1 and said in err, err
    assert (tmp_path / "taken" / "letter.txt").read_text() == "mine"


def test_a_bake_needs_no_cells(tmp_path, house):
    made = viewcell.bake(house.scene, tmp_path / "house.bake")
    result = assert_conservative(made, house.scene, rays=RAYS)
    assert result.ok and set(result.claimed) == {"object", "cell"}
    assert check(tmp_path / "house.bake", tmp_path / "house.bake", rays=RAYS).ok
    # Wherever its folder goes, the bake itself does.
    assert check(made, [made], made, rays=RAYS).ok and check(house.scene, made, made, rays=RAYS).ok


def test_assert_conservative_fails_usefully(house, claims):
    assert_conservative(claims[0], house.scene, boxes_of(house), rays=RAYS)
    with pytest.raises(AssertionError, match=r"not conservative: 1 visible pair claimed hidden(.|\n)*sees object"):
        assert_conservative(without(claims[0], 2), house.scene, boxes_of(house), rays=RAYS)


def test_plugin(tmp_path, house, claims):
    write_inputs(tmp_path, house, claims)
    pyarrow.csv.write_csv(without(claims[0], 2), tmp_path / "cut.csv")
    (tmp_path / "pytest.ini").write_text("[pytest]\nviewcell_model = house.scene\n")
    (tmp_path / "test_mine.py").write_text(
        "import pytest\n\n"
        "@pytest.mark.parametrize('sets', ['pvs.csv', 'cut.csv'])\n"
        "def test_pvs(viewcell_scene, assert_conservative, sets):\n"
        f"    assert_conservative(sets, viewcell_scene, cells='cells.parquet', rays={RAYS})\n"
    )
    done = run_pytest(tmp_path)
    assert done.returncode == 1 and "1 failed, 1 passed" in done.stdout, done.stdout + done.stderr
    assert "FAILED test_mine.py::test_pvs[cut.csv]" in done.stdout
    assert "not conservative: 1 visible pair claimed hidden" in done.stdout and "sees object" in done.stdout


def run_pytest(folder):
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_the_plugin_takes_no_name_that_is_not_its_own(tmp_path):
    """A fixture `scene` only where it is asked for; a missing model is one line."""
    asks = "def test_mine(scene):\n    assert len(scene.objects)\n"
    (tmp_path / "test_mine.py").write_text(asks)
    assert "fixture 'scene' not found" in run_pytest(tmp_path).stdout
    (tmp_path / "pytest.ini").write_text("[pytest]\nviewcell_names = short\n")
    assert "1 passed" in run_pytest(tmp_path).stdout
    (tmp_path / "pytest.ini").write_text("[pytest]\nviewcell_names = short\nviewcell_model = none.ifc\n")
    told = run_pytest(tmp_path).stdout
    assert "none.ifc: expected a model file or folder, found nothing there" in told and "Traceback" not in told
    # Once as the error, and once in pytest's summary, which cuts its lines only where no CI is.
    told_of = [line for line in told.splitlines() if "none.ifc" in line]
    assert len([line for line in told_of if not line.startswith("ERROR")]) == 1 and "pytest_plugin.py" not in told
    (tmp_path / "pytest.ini").write_text("[pytest]\nviewcell_names = shorter\n")
    assert "viewcell_names: expected long or short, found 'shorter'" in run_pytest(tmp_path).stderr


def test_a_bake_of_prisms_alone_stands_by_its_claims_of_objects(tmp_path):
    baked = turned_house.turned_bake(tmp_path / "turned.bake")
    result = check(baked.scene, baked.folder, baked.folder, rays=RAYS)
    assert result.ok and result.rays and list(result.claimed) == ["object"]
    # Cells are called by their rooms, which the bake knows more of than a table of boxes does.
    rooms = baked.rooms.to_pylist()
    rooms[1] |= {"long_name": "Stube", "storey": "EG"}
    pq.write_table(pa.Table.from_pylist(rooms, schema=baked.rooms.schema), baked.folder / "rooms.parquet")
    (cell,) = rooms[1]["cells"]
    assert f"| {cell} (room 1 Stube, EG) |" in check(baked.scene, baked.folder, baked.folder, rays=1000).table()


@pytest.mark.slow
def test_a_bake_with_prisms_stands_by_its_claims_of_cells(tmp_path):
    """Nothing is claimed of which cells a prism sees, so none of them is judged; its objects are."""
    scene = viewcell.make_office(floors=1, rooms_per_side=1, wings=2, wing_angle_deg=30)
    baked = bake(scene, tmp_path / "wings.bake", settings=Settings(yaw="0"), threads=2)
    planned = np.flatnonzero(np.arange(baked.graph.cell_count) >= baked.graph.tile_count)
    result = check(scene, baked.folder, baked.folder, rays=RAYS)
    assert result.ok and len(planned) and np.flatnonzero(result.silent).tolist() == planned.tolist()
    assert f"note: {len(planned)} view cells at an angle" in result.table()
    assert result.by_cell("cell")[0].sum() == baked.cell_to_cell.num_rows

    def near(target):
        """Length of the sightline: what is near is found by few rays."""
        witness = baked.witness(cell, int(target))
        return np.linalg.norm(witness.end - witness.origin)

    cell = planned[0]
    target = int(min(baked.seen(cell), key=near))
    pairs = baked.cell_to_object
    rows = (pairs["cell_id"].to_numpy() != cell) | (pairs["object_id"].to_numpy() != target)
    told = check(scene, pairs.filter(pa.array(rows)), baked.folder, rays=RAYS)
    assert [(wrong.cell, wrong.target) for wrong in told.wrong] == [(cell, target)]
