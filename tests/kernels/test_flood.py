"""Portal-sequence flood and target search against an exact search in plain Python, on random and shared graphs."""

import numpy as np
import pytest
from builders import random_buildings
from builders.places import SHARED
from viewcell.data.graph import OTHER_AXES
from viewcell.data.store.graph_folder import read_graph
from viewcell.data.verdict import Verdict
from viewcell.kernels import flood
from viewcell.kernels.flood import launch_flood
from viewcell.kernels.launch import Device
from viewcell.kernels.target import TargetAnswers, launch_target_search
from viewcell.solvers.visibility import graph_engine
from viewcell.solvers.visibility.cells import accept
from viewcell.solvers.visibility.graph_engine import GraphEngine
from viewcell.solvers.visibility.search import segments
from viewcell.verify.exact.sightline import Sight, Sightlines

GRAPHS = SHARED / "graphs"
CAP = 1_000_000


def shared_graph(name):
    if not (GRAPHS / name).is_dir():
        pytest.skip(f"needs {name} of the shared graphs folder")
    return read_graph(GRAPHS / name)[0]


def model_of(graph):
    return GraphEngine(graph).model


def flooded(model, sources=None, **options):
    """Reached cells of each source, bool, and the answers."""
    sources = np.arange(model.graph.cell_count) if sources is None else sources
    found = launch_flood(model.device_graph, sources, cap=options.pop("cap", CAP), **options)
    reached = np.zeros((len(sources), model.graph.cell_count), bool)
    reached[np.arange(len(sources)), sources] = True
    reached[found.pairs[:, 0], found.pairs[:, 1]] = True
    return reached, found


def searched(model, sources=None, cap=CAP):
    """Target search for every source and target but itself: rows and answers."""
    cells = np.arange(model.graph.cell_count)
    sources = cells if sources is None else sources
    pairs = np.stack(np.meshgrid(sources, cells, indexing="ij"), axis=-1).reshape(-1, 2)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    rows = np.column_stack([pairs, np.zeros(len(pairs), int)])
    return rows, launch_target_search(model.tree, model.graph.cells, rows, cap=cap)


def check_pairs(model, truth, sources=None, walls=None):
    """Both kernels reach exactly the true cells of each source, and no witness of theirs touches a wall.

    Returns the number of lines and of those that are witnesses; a line through the seam of two portals, or a hair's
    breadth from an edge, keeps its verdict but is none.
    """
    sources = np.arange(model.graph.cell_count) if sources is None else sources
    reached, found = flooded(model, sources)
    assert found.complete.all() and not found.undecided.any()
    np.testing.assert_array_equal(reached, truth, "flood")
    rows, answers = searched(model, sources)
    assert (answers.verdict != Verdict.UNKNOWN).all()
    index = np.full(model.graph.cell_count, -1)
    index[sources] = np.arange(len(sources))
    visible = answers.verdict == Verdict.VISIBLE
    np.testing.assert_array_equal(visible, truth[index[rows[:, 0]], rows[:, 1]], "target search")
    seen = np.flatnonzero(visible)
    others = np.flatnonzero(found.pairs[:, 1] != sources[found.pairs[:, 0]])
    lines = TargetAnswers(None, None, found.pairs[:, 2], found.line, found.offset)
    pairs = np.column_stack([sources[found.pairs[:, 0]], found.pairs[:, 1]])[others]
    held = []
    for taken, source, target, at in ((lines, *pairs.T, others), (answers, *rows[seen, :2].T, seen)):
        origin, end = segments(taken, at, model.graph.cells[source], model.graph.cells[target])
        held.append(accept(model, source, target, origin, end))
        if walls is not None:
            assert (walls.check(origin, end)[held[-1]] == Sight.CLEAR).all()
    return sum(map(len, held)), sum(x.sum() for x in held)


def random_building(seed):
    """Model, truth and walls of a random building."""
    graph, opaque = random_buildings.random_graph(seed, walls=3 + seed % 3)
    walls = [
        (axis, box[0, axis], *box[:, OTHER_AXES[axis]].T.ravel()) for axis in range(3) for box in opaque.boxes[axis]
    ]
    return (
        model_of(graph),
        random_buildings.reached_matrix(graph),
        Sightlines(random_buildings.rectangle_triangles(walls, 1)),
    )


def check_random(seeds):
    lines, witnesses, shares = 0, 0, []
    for seed in seeds:
        model, truth, walls = random_building(seed)
        total, held = check_pairs(model, truth, walls=walls)
        lines, witnesses = lines + total, witnesses + held
        shares.append(truth.mean())
    print(f"{lines} lines, {witnesses} of them witnesses; {100 * np.mean(shares):.1f} % of the pairs are visible")
    assert witnesses > 0.97 * lines
    # No walk-over: some buildings hide much.
    assert min(shares) < 0.75 and np.mean(shares) < 0.95


def test_random_buildings():
    check_random(range(30))


@pytest.mark.slow
def test_more_random_buildings():
    check_random(range(1000, 1400))


def test_shared_building():
    graph = shared_graph("w48")
    sources = np.arange(5, graph.cell_count, 12)
    truth = np.zeros((len(sources), graph.cell_count), bool)
    for row, source in enumerate(sources):
        truth[row, list(random_buildings.reached_cells(graph, int(source)))] = True
    lines, witnesses = check_pairs(model_of(graph), truth, sources)
    assert witnesses > 0.99 * lines


@pytest.mark.parametrize(
    ("name", "mean"),
    [("w48", 38.43), ("l50", 175.20), ("w300", 66.29), pytest.param("w1500", 74.57, marks=pytest.mark.slow)],
)
def test_published_means(name, mean):
    graph = shared_graph(name)
    engine = GraphEngine(graph, device=Device(threads=2))
    rows = engine.join([engine.visible(np.arange(graph.cell_count))])[0]
    assert round(len(rows.source) / graph.cell_count, 2) == mean
    assert rows.seen.mean() > 0.999
    key = rows.source.astype(np.int64) * graph.cell_count + rows.target
    mirrored = np.sort(rows.target.astype(np.int64) * graph.cell_count + rows.source)
    np.testing.assert_array_equal(key, mirrored, "A sees B exactly when B sees A")


def test_a_search_that_is_cut_off_claims_nothing():
    model = model_of(shared_graph("w48"))
    truth, _ = flooded(model)
    reached, found = flooded(model, cap=40)
    assert not found.complete.all() and found.complete.any()
    assert (reached <= truth).all()
    np.testing.assert_array_equal(reached[found.complete], truth[found.complete])
    rows, answers = searched(model, cap=1)
    assert (answers.verdict == Verdict.UNKNOWN).any()
    visible = truth[rows[:, 0], rows[:, 1]]
    assert not (visible & (answers.verdict == Verdict.HIDDEN)).any(), "wrong-hidden"
    assert not (~visible & (answers.verdict == Verdict.VISIBLE)).any(), "wrong-visible"


@pytest.mark.parametrize("cap", [1, 20, 100_000])
def test_rows_do_not_depend_on_the_cap(cap, monkeypatch):
    graph = shared_graph("w48")

    def rows():
        engine = GraphEngine(graph)
        joined = engine.join([engine.visible(np.arange(graph.cell_count))])[0]
        return joined.source, joined.target, joined.seen

    def capped(*args, **options):
        return launch_flood(*args, **(options | {"cap": cap}))

    expected = rows()
    monkeypatch.setattr(
        graph_engine, "launch_flood", lambda *args, **kwargs: launch_flood(*args, **(kwargs | {"cap": cap}))
    )
    for got, wanted in zip(rows(), expected, strict=True):
        np.testing.assert_array_equal(got, wanted)


def test_threads_and_chunks_change_nothing(monkeypatch):
    model = model_of(shared_graph("w48"))
    _, one = flooded(model)
    _, two = flooded(model, device=Device(threads=2))
    monkeypatch.setattr(flood, "CHUNK", 7)
    _, chunked = flooded(model, device=Device(threads=2))
    for other in (two, chunked):
        for name in one.__dataclass_fields__:
            np.testing.assert_array_equal(getattr(other, name), getattr(one, name), err_msg=name)
