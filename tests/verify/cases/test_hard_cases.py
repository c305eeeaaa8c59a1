"""Hard cases: every answer in the files against a twin, and every kernel against the files."""

import ast
from dataclasses import replace
from itertools import islice, pairwise, product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from builders import random_buildings
from builders.places import ROOT
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.scene import GRID_LIMIT, Role
from viewcell.data.store.view_cells import read_view_cells
from viewcell.data.verdict import Verdict
from viewcell.kernels.launch import CPU
from viewcell.verify.arithmetic import cross, dot, minus
from viewcell.verify.cases.hard_cases import FOLDER, LOADERS, end_faces, faces, fan, load_hard_cases
from viewcell.verify.exact.backface import back_facing, outward_triangles
from viewcell.verify.exact.coverage import cover_polygon
from viewcell.verify.exact.occludee import covers_box
from viewcell.verify.exact.region import region_visible
from viewcell.verify.exact.select import best_by_table
from viewcell.verify.exact.sightline import Sight, Sightlines
from viewcell.verify.exact.tour import as_columns, least_runs
from viewcell.verify.exact.trace import portal_links, portal_path
from viewcell.workbench.bake.settings import METHODS
from viewcell.workbench.cli import main
from viewcell.workbench.hard import bakes, looks, meshes, orders, searches, shadows
from viewcell.workbench.hard import run as hard_cases
from viewcell.workbench.hard.bakes import write_model
from viewcell.workbench.hard.kernels import KERNELS
from viewcell.workbench.hard.outcomes import Outcome
from viewcell.workbench.hard.run import Row, hard_cases_table, run_hard_cases
from viewcell.workbench.hard.searches import graph_of

CASES = load_hard_cases()
# Kernels that take seconds.
LONG = ("launch_shrink", "launch_occludees", "launch_deviation", "launch_raster", "vlod_hidden", "solve_points")
LONG += tuple(f"bake {m}" for m in METHODS[1:])
# Cases in which a kernel may withhold its answer, because they are on the edge of one; none where it is not named.
MOST_WITHHELD = {
    "launch_target_search": 18, "launch_line_trees": 13, "launch_confirm": 5, "launch_aim": 3, "launch_shaft": 15,
    "launch_umbra": 51, "launch_shrink": 62, "launch_coverage": 20, "launch_occludees": 84, "launch_backface": 1,
    "launch_select": 2, "launch_raster": 3, "launch_tour": 4, "bake portals": 5, "bake occluders": 1,
    "bake both": 1, "bake vlod": 1, "vlod_hidden": 82, "solve_points": 162,
}  # fmt: skip


def polygons(shapes):
    return [face for shape in shapes for face in faces(shape)]


def test_there_are_many_and_they_differ():
    assert CASES.count() >= 300
    base = {case.name.partition(",")[0] for cases in vars(CASES).values() for case in cases}
    assert len(base) >= 120
    assert all(len(cases) >= 25 for cases in vars(CASES).values())
    for cases in (CASES.region, CASES.oblique, CASES.sightline, CASES.coverage, CASES.shadow, CASES.stab):
        counts = np.unique([case.expected for case in cases], return_counts=True)[1]
        assert len(counts) > 1 and counts.min() >= 4


def region_answer(case):
    """Verdict of the from-region twin."""
    return region_visible(case.cell, faces(case.target), polygons(case.occluders)).verdict.word


def oblique_answer(case):
    """Verdict of the from-region twin, which takes prisms as they are."""
    return region_visible(end_faces(case.cell), end_faces(case.target), polygons(case.occluders)).verdict.word


def sightline_answer(case):
    """Verdict of the exact segment test, without the excepted triangle."""
    triangles = [t for number, t in enumerate(case.triangles) if number != case.excepted]
    ends = np.array(case.segment, float)[:, None]
    return Sight(int(Sightlines(np.array(triangles).reshape(-1, 3, 3)).check(*ends)[0])).name.lower()


def covered_pixels(case):
    """(face, row, pixel) that one polygon covers wholly."""
    found = set()
    for polygon, face in product(polygons(case.polygons), range(6)):
        image = cover_polygon(np.array(case.viewpoint), np.array(polygon, float), face, case.size)
        found |= {(face, i, j) for i, j in np.ndindex(case.size, case.size) if image[i][j] is not None}
    return found


def coverage_answer(case):
    """Whether the box is behind covered pixels."""
    corners = [np.array(polygon, float) for polygon in polygons(case.polygons)]
    hidden = covers_box(np.array(case.viewpoint), corners, np.array(case.box, float), case.size)
    return "hidden" if hidden else "seen"


def backface_answer(case):
    """Triangles of outward shells that are turned away."""
    triangles = np.array([t for polygon in polygons(case.surface) for t in fan(polygon)])
    return int((np.array(back_facing(triangles, np.array(case.cell))) & outward_triangles(triangles)).sum())


def graph_answer(case):
    """Pairs of cells that an exact stabbing line joins."""
    reached = random_buildings.reached_matrix(graph_of(case))
    return set(map(tuple, np.argwhere(np.triu(reached, 1)).tolist()))


def traces_answer(case):
    """Cells where the traces end."""
    graph, found = graph_of(case), []
    for trace in case.traces:
        origin, end = np.array(trace.segment)
        holding = np.flatnonzero(((graph.cells[:, 0] < end) & (graph.cells[:, 1] > end)).all(axis=1)).tolist()
        paths = [
            portal_path(portal_links(graph), graph.cells, trace.source, cell, origin, end - origin) for cell in holding
        ]
        found.append(-1 if paths in ([], [None]) else holding[0])
    return found


def model_answer(case):
    """(cell, object) pairs that the from-region twin finds visible in the model as it was read."""
    with TemporaryDirectory() as name:
        path, table = write_model(case, Path(name))
        scene = read(path)
        cells = read_view_cells(table, scene).cells.tolist()
    assert len(scene.objects) == len(case.objects) and not scene.skipped
    triangles, owners = scene.triangles()
    opaque = triangles[scene.object_mask(Role.OCCLUDER, Role.DETAIL)[owners]].tolist()
    verdicts = {
        (cell, target): region_visible(box, triangles[owners == target].tolist(), opaque).verdict
        for cell, box in enumerate(cells)
        for target in range(len(case.objects))
    }
    assert Verdict.UNKNOWN not in verdicts.values()
    return {pair for pair, verdict in verdicts.items() if verdict is Verdict.VISIBLE}


def knapsack_answer(case):
    """The largest benefit within the budget, if anything fits."""
    benefits, costs = ([[level[i] for level in levels] for levels in case.objects] for i in range(2))
    found = best_by_table(benefits, costs, case.budget)
    return found and found.value


def tour_answer(case):
    """The fewest runs over all orders."""
    return least_runs(as_columns(case.rows))


def said(case):
    return case.expected


# Kind of case, its twin, what the file says, and each how manyth case the default suite has time for.
ANSWERS = {
    "region": (CASES.region, region_answer, said, 1),
    "oblique": (CASES.oblique, oblique_answer, said, 1),
    "sightline": (CASES.sightline, sightline_answer, said, 1),
    "covered pixels": (CASES.coverage, covered_pixels, lambda case: case.pixels, 1),
    "covered boxes": (CASES.coverage, coverage_answer, said, 16),
    "backface": (CASES.backface, backface_answer, said, 1),
    "graph": (CASES.graph, graph_answer, lambda case: case.seen, 1),
    "traces": (CASES.graph, traces_answer, lambda case: [trace.reached for trace in case.traces], 1),
    "model": (CASES.model, model_answer, lambda case: case.seen, 18),
    "knapsack": (CASES.knapsack, knapsack_answer, said, 1),
    "tour": (CASES.tour, tour_answer, said, 4),
}


@pytest.mark.parametrize("kind", ANSWERS)
def test_answers_are_those_of_the_twin(kind):
    cases, twin, wanted, step = ANSWERS[kind]
    assert [case.name for case in cases[::step] if twin(case) != wanted(case)] == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind, row in ANSWERS.items() if row[-1] > 1])
def test_all_answers_are_those_of_the_twin(kind):
    cases, twin, wanted, _ = ANSWERS[kind]
    assert [case.name for case in cases if twin(case) != wanted(case)] == []


def test_cells_of_graphs_are_apart_and_portals_on_their_faces():
    for case in CASES.graph:
        cells = np.array(case.cells)
        apart = (cells[:, None, 1] <= cells[None, :, 0]).any(axis=2)
        assert (apart | apart.T | np.eye(len(cells), dtype=bool)).all(), case.name
        for low, high, (start, end) in case.portals:
            axis = int(np.argmax(np.equal(start, end)))
            assert cells[low, 1, axis] == start[axis] == cells[high, 0, axis], case.name
            for other in {0, 1, 2} - {axis}:
                inner = cells[[low, high], 0, other].max(), cells[[low, high], 1, other].min()
                assert inner[0] <= start[other] < end[other] <= inner[1], case.name


def test_models_far_away_are_read_with_their_digits():
    far = next(case for case in CASES.model if "100 km and fractions" in case.name)
    numbers = [c for _, shapes in far.objects for shape in shapes for point in shape for c in point]
    assert max(numbers) > 100_000 and max(len(repr(c)) for c in numbers) >= 16


@pytest.mark.parametrize("kernel", [pytest.param(k, marks=[pytest.mark.slow] if k in LONG else []) for k in KERNELS])
def test_no_kernel_is_wrong(kernel):
    (row,) = run_hard_cases(["cpu"], kernels=[kernel])
    assert not row.wrong
    assert row.cases >= 15 and row.right == row.cases - len(row.withheld)
    assert len(row.withheld) <= MOST_WITHHELD.get(kernel, 0), row.withheld


def test_boxes_in_cube_maps():
    """A point at the viewpoint is in no face's pyramid, and once was called covered."""
    judge = KERNELS["launch_occludees"](CASES, CPU)
    outcomes = dict(islice(judge, len(CASES.coverage)))
    assert outcomes["box at the viewpoint"] is Outcome.RIGHT
    assert Outcome.WRONG not in outcomes.values()


def test_every_kernel_has_cases():
    found = set()
    for path in (ROOT / "kernels").glob("*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and node.name.startswith("launch_") and path.stem != "launch":
                found.add(node.name)
    assert found <= set(KERNELS)


def hide_all(answers):
    return replace(answers, verdict=np.full_like(answers.verdict, Verdict.HIDDEN))


def everywhere(umbras):
    planes = np.zeros_like(umbras.planes)
    return replace(umbras, far=umbras.far - 1e9, planes=planes - [0, 0, 0, 1], limits=planes - [0, 0, 0, 1])


def resized(polygons, factor):
    """Each polygon about its middle."""
    corners = polygons.corners.copy()
    for begin, end in pairwise(polygons.starts):
        middle = corners[begin:end].sum(axis=0) / max(1, end - begin)
        corners[begin:end] = middle + factor * (corners[begin:end] - middle)
    return replace(polygons, corners=corners)


class FullMaps:
    """A cube map without an open pixel."""

    def __init__(self, maps):
        self.maps = maps

    def depth(self, number):
        return np.ones_like(self.maps.depth(number))


class HidingBake:
    """A bake that hides everything."""

    def __init__(self, made):
        self.potential_objects = np.zeros_like(made.potential_objects)
        self.seen = lambda cell: np.zeros(0, int)


# What each kernel would say if it were broken.
BROKEN = {
    "launch_stab": ("launch_stab", hide_all),
    "launch_flood": ("launch_flood", lambda found: replace(found, pairs=found.pairs[:0])),
    "launch_target_search": ("launch_target_search", hide_all),
    "launch_line_trees": ("launch_line_trees", lambda trees: replace(trees, words=trees.words - 1)),
    "launch_trace": ("launch_trace", lambda found: (np.zeros_like(found[0]), *found[1:])),
    "launch_eye": ("launch_eye", lambda found: replace(found, objects=found.objects[:0], starts=found.starts * 0)),
    "launch_confirm": ("launch_confirm", np.ones_like),
    "launch_aim": ("launch_aim", lambda found: (np.ones_like(found[0]), *found[1:])),
    "launch_shaft": ("launch_shaft", hide_all),
    "launch_umbra": ("launch_umbra", everywhere),
    "launch_shrink": ("launch_shrink", lambda polygons: resized(polygons, 4)),
    "launch_coverage": ("launch_coverage", FullMaps),
    "launch_occludees": ("launch_occludees", np.zeros_like),
    "launch_backface": ("launch_backface", lambda found: (found[0] + 1, found[1])),
    "launch_clip": ("launch_clip", lambda found: found // 2),
    "launch_deviation": ("launch_deviation", lambda found: replace(found, upper=found.upper / 2)),
    "launch_raster": ("launch_raster", lambda images: replace(images, ids=images.ids + 1)),
    "launch_near_columns": ("launch_near_columns", lambda near: near[:, ::-1]),
    "launch_tour": ("launch_tour", np.sort),
    "launch_select": ("launch_select", lambda found: replace(found, bound=found.bound / 2)),
    "vlod_hidden": ("vlod_hidden", lambda found: (np.ones_like(found[0]), found[1])),
    "solve_points": ("launch_occludees", np.zeros_like),
    "bake portals": ("bake", HidingBake),
    "bake occluders": ("bake", HidingBake),
    "bake both": ("bake", HidingBake),
    "bake vlod": ("bake", HidingBake),
}


def spoil_all(monkeypatch, name, spoil):
    """Spoil what a kernel says wherever the hard cases ask it."""
    for module in (bakes, looks, meshes, orders, searches, shadows):
        if launch := getattr(module, name, None):
            monkeypatch.setattr(module, name, lambda *work, launch=launch, **options: spoil(launch(*work, **options)))


@pytest.mark.parametrize("kernel", [pytest.param(k, marks=[pytest.mark.slow] if k in LONG else []) for k in BROKEN])
def test_a_broken_kernel_is_found_out(kernel, monkeypatch):
    name, spoil = BROKEN[kernel]
    spoil_all(monkeypatch, name, spoil)
    (row,) = run_hard_cases(["cpu"], kernels=[kernel])
    assert row.wrong


def test_every_kernel_can_be_found_out():
    assert set(BROKEN) == set(KERNELS)


@pytest.fixture
def only_stab(monkeypatch):
    """One kernel, so that the command is quick."""
    monkeypatch.setattr(hard_cases, "KERNELS", {"launch_stab": KERNELS["launch_stab"]})


def test_command(only_stab, capsys):
    assert main(["verify", "--hard-cases", "--device", "cpu"]) == 0
    assert f"| launch_stab | cpu | {len(CASES.stab)} |" in capsys.readouterr().out


def test_command_exits_1_on_a_wrong_kernel(only_stab, monkeypatch, capsys):
    spoil_all(monkeypatch, "launch_stab", hide_all)
    assert main(["verify", "--hard-cases"]) == 1
    assert "wrong: launch_stab on cpu: facing windows" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--hard-cases", "--device", "gpu9"], "expected one that Warp knows, found 'gpu9'"),
        (["a.bake", "--hard-cases"], "expected no bake, case or certificates beside --hard-cases"),
        (["a.bake", "--device", "cpu"], "expected it beside --hard-cases only, found 'cpu'"),
    ],
)
def test_command_refuses(arguments, message, only_stab, capsys):
    assert main(["verify", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_table():
    rows = [Row("launch_stab", "cpu", 3, ("a",), ()), Row("launch_aim", "cuda:0", 0, (), ("b", "c"))]
    assert hard_cases_table(rows).splitlines()[2:] == [
        "| launch_stab | cpu | 4 | 3 | 1 | 0 |",
        "| launch_aim | cuda:0 | 2 | 0 | 0 | 2 |",
        "wrong: launch_aim on cuda:0: b",
        "wrong: launch_aim on cuda:0: c",
    ]


def test_unknown_device():
    with pytest.raises(InputError, match="device: expected one that Warp knows, found 'gpu9'"):
        run_hard_cases(["gpu9"], kernels=["launch_stab"])


@pytest.fixture
def folder(tmp_path):
    for kind in LOADERS:
        (tmp_path / f"{kind}.txt").write_text("# nothing\n\n")
    return tmp_path


GOOD = {
    "region": "a; hidden; 0 0 0, 1 1 1; 5 0 0, 6 1 1; 3 -9 -9, 3 9 9 | 4 0 0, 4 1 0, 4 1 1; by hand",
    "oblique": "a; hidden; 0 0 0, 1 1 1; 5 0 0, 7 1 0, 6 3 0, 4 2 0, 5 0 9; 3 -9 -9, 3 9 -9, 3 9 9, 3 -9 9; by hand",
    "sightline": "a; clear; 0.5 0 0, 1 1 1e-3; -; 0 0 9, 1 0 9, 0 1 9; by hand",
    "coverage": "a; seen; 0 0 0.5; 4; 3 -9 -9, 3 9 9; 4 0 0, 4 0 0; 0 1 2-3, 5 0 0-0; by hand",
    "backface": "a; 10; 200 10 10, 220 90 90; 0 0 0, 100 100 100; by hand",
    "graph": "a; 0 0 0, 4 4 4 | 4 0 0, 8 4 4; 0 1: 4 1 1, 4 2 2; 0 1; 0 -: 1 1 1, 9 1 1 | 0 1: 1 1 1, 5 1 1; by hand",
    "model": "a; occluder: 0 0 0, 1 1 1 / detail: 0 0 0.5, 1 0 0, 0 1 0; 5 0 0, 6 1 1; 0 0, 0 1; by hand",
    "knapsack": "a; 7; 5; 0 0, 7 5 | 2 0; by hand",
    "tour": "a; 2; 1010 | 0101; by hand",
}
# What is written instead of what.
BAD = {
    "region": [
        ("hidden", "maybe"),
        ("5 0 0, 6 1 1", "5 0 0, 6 1"),
        ("5 0 0, 6 1 1", "5 0 0"),
        ("0 0 0, 1 1 1", "0 0 0, 1 1 0"),
        ("by hand", ""),
        ("3 9 9", "3 -9 9"),
        ("5 0 0", "5.5 0 0"),
        ("; by hand", "; by; hand"),
    ],
    "oblique": [
        ("hidden", "maybe"),
        (", 5 0 9", ""),
        ("5 0 9", "5 1 9"),
        ("5 0 9", "5 0 0"),
        ("7 1 0", "7 1 1"),
        ("7 1 0, 6 3 0", "6 3 0, 7 1 0"),
        ("0 0 0, 1 1 1", "0 0 0, 1 1 0"),
    ],
    "sightline": [
        ("clear", "hidden"),
        ("-; 0 0 9", "1; 0 0 9"),
        ("1e-3", "nan"),
        ("1e-3;", "1e-3, 2 2 2;"),
        (", 0 1 9", ""),
    ],
    "coverage": [
        ("; 4;", "; 3;"),
        ("2-3", "3-2"),
        ("2-3", "2-4"),
        ("5 0 0-0", "6 0 0-0"),
        ("seen", "visible"),
        ("0 0 0.5", "inf 0 0"),
    ],
    "backface": [("10", "-1"), ("220 90 90", "200 90 90")],
    "graph": [
        ("; 0 1; 0 -", "; 1 0; 0 -"),
        ("0 1: 4", "0 0: 4"),
        ("0 1: 4", "0 2: 4"),
        ("4 2 2", "5 2 2"),
        ("0 -", "2 -"),
        ("9 1 1 |", "9 1 1, 1 1 1 |"),
    ],
    "knapsack": [("7;", "x;"), ("; 5;", "; -5;"), ("7 5", "7"), ("7 5", "7 -5"), ("7 5", "7 5.5"), (" | 2 0", " |")],
    "tour": [("2;", "x;"), ("2;", "-2;"), ("0101", "010"), ("1010", "1020"), ("1010 |", "|"), ("1010 | 0101", "|")],
    "model": [("occluder", "wall"), ("0 0, 0 1;", "0 0, 1 0;"), ("0 0, 0 1;", "0 0, 0 2;"), ("0 0 0.5", "0 0 x")],
}


@pytest.mark.parametrize("kind", GOOD)
def test_well_formed_lines(kind, folder):
    (folder / f"{kind}.txt").write_text(f"# {kind}\n{GOOD[kind]}  # why\n")
    (case,) = getattr(load_hard_cases(folder), kind)
    assert (case.name, case.origin) == ("a", "by hand")


@pytest.mark.parametrize(
    ("kind", "old", "new"), [(kind, *change) for kind, changes in BAD.items() for change in changes]
)
def test_malformed_lines_are_refused(kind, old, new, folder):
    assert old in GOOD[kind]
    path = folder / f"{kind}.txt"
    path.write_text("# line 1\n" + GOOD[kind].replace(old, new, 1) + "\n")
    with pytest.raises(InputError, match=rf"{kind}\.txt, line 2: expected 'name; "):
        load_hard_cases(folder)


def test_names_come_once(folder):
    (folder / "region.txt").write_text(f"{GOOD['region']}\n{GOOD['region']}\n")
    with pytest.raises(InputError, match="every name once, found 'a' twice"):
        load_hard_cases(folder)


def test_a_missing_file(folder):
    (folder / "graph.txt").unlink()
    with pytest.raises(InputError, match=r"graph\.txt: expected a file of hard cases"):
        load_hard_cases(folder)


def test_faces_of_a_box_look_outwards():
    box = [[1, 2, 3], [5, 7, 9]]
    middle = [3, 4, 6]
    assert len(faces(box)) == 6
    for a, b, c, _ in faces(box):
        assert dot(cross(minus(b, a), minus(c, a)), minus(a, middle)) > 0
    assert faces([[1, 2, 3], [1, 7, 9]]) == [[[1, 2, 3], [1, 7, 3], [1, 7, 9], [1, 2, 9]]]


def test_cases_are_within_the_grid():
    for case in CASES.region + CASES.backface:
        assert np.abs([case.cell]).max() <= GRID_LIMIT
    assert {path.stem for path in FOLDER.glob("*.txt")} == set(LOADERS)
