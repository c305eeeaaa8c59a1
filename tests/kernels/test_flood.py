"""Portal-sequence flood and target search against an exact search in plain Python, on random and shared graphs."""

import numpy as np
import pytest
from builders import corridors, needles, random_buildings
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
# Offices: floors, and rooms on a side.
MADE = {"small office": (1, 2), "office": (1, 3), "two floors": (2, 2)}
BUILDINGS = ["office", "w48"]


def shared_graph(name):
    """A graph of the shared folder, or one of a building made here, so that no claim rests on the folder alone."""
    if name in MADE:
        return corridors.office_graph(*MADE[name], furnished=False)
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
    assert found.complete.all() and not len(found.undecided)
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


@pytest.mark.parametrize(
    ("name", "every"), [("small office", 1), pytest.param("two floors", 1, marks=pytest.mark.slow), ("w48", 12)]
)
def test_building(name, every):
    graph = shared_graph(name)
    sources = np.arange(every // 2, graph.cell_count, every)
    truth = np.zeros((len(sources), graph.cell_count), bool)
    for row, source in enumerate(sources):
        truth[row, list(random_buildings.reached_cells(graph, int(source)))] = True
    lines, witnesses = check_pairs(model_of(graph), truth, sources)
    assert witnesses > 0.99 * lines


@pytest.mark.parametrize(
    ("name", "mean"),
    [
        ("small office", 21.72),
        ("two floors", 37.8),
        ("w48", 38.43),
        ("l50", 175.20),
        ("w300", 66.29),
        pytest.param("w1500", 74.57, marks=pytest.mark.slow),
    ],
)
def test_known_means(name, mean):
    """Of the shared graphs the published ones; of the offices what the exact search finds (in the slow tests)."""
    graph = shared_graph(name).tiles
    engine = GraphEngine(graph, device=Device(threads=2))
    rows = engine.join([engine.visible(np.arange(graph.cell_count))])[0]
    assert round(len(rows.source) / graph.cell_count, 2) == mean
    assert rows.seen.mean() > 0.999
    key = rows.source.astype(np.int64) * graph.cell_count + rows.target
    mirrored = np.sort(rows.target.astype(np.int64) * graph.cell_count + rows.source)
    np.testing.assert_array_equal(key, mirrored, "A sees B exactly when B sees A")


def check_cut_off(model, caps):
    """With any cap an answer is that of the whole search, or it is none; some are."""
    truth, whole = flooded(model)
    assert whole.complete.all() and not len(whole.undecided)
    cut = {"flood": 0, "target": 0}
    for cap in caps:
        reached, found = flooded(model, cap=cap)
        assert (reached <= truth).all()
        np.testing.assert_array_equal(reached[found.complete], truth[found.complete], f"flood, cap {cap}")
        cut["flood"] += (~found.complete).sum()
        rows, answers = searched(model, cap=cap)
        visible = truth[rows[:, 0], rows[:, 1]]
        assert not (visible & (answers.verdict == Verdict.HIDDEN)).any(), f"wrong-hidden, cap {cap}"
        assert not (~visible & (answers.verdict == Verdict.VISIBLE)).any(), f"wrong-visible, cap {cap}"
        cut["target"] += (answers.verdict == Verdict.UNKNOWN).sum()
    return cut


@pytest.mark.parametrize("name", BUILDINGS)
def test_a_search_that_is_cut_off_claims_nothing(name):
    cut = check_cut_off(model_of(shared_graph(name)), [1, 2, 3, 5, 10, 40, 100])
    assert min(cut.values()) > 0


def test_a_search_of_a_random_building_that_is_cut_off_claims_nothing():
    cut = {"flood": 0, "target": 0}
    for seed in range(6):
        graph, _ = random_buildings.random_graph(seed, walls=5)
        more = check_cut_off(model_of(graph), [*range(12), 20, 50])
        cut = {name: count + more[name] for name, count in cut.items()}
    assert min(cut.values()) > 100


@pytest.mark.parametrize("count", [*range(int(flood.MAX_DEPTH) - 1, int(flood.MAX_DEPTH) + 5), 100])
def test_a_corridor_deeper_than_the_search_hides_nothing(count):
    """All cells of it see each other: a source whose search is called whole must have reached them all."""
    graph = corridors.corridor(count)
    reached, found = flooded(model_of(graph))
    assert reached[found.complete].all()
    # From its middle the search ends in time.
    assert reached[count // 2].all() and found.complete[count // 2]
    # The first cell needs a portal for every other one, and a search that is as deep as it may be may have missed some.
    assert found.complete[0] == (count - 1 < int(flood.MAX_DEPTH))
    engine = GraphEngine(graph)
    rows = engine.join([engine.visible(np.arange(count))])[0]
    assert len(rows.source) == count**2, "wrong-hidden"


def test_what_only_a_needle_reaches_is_not_hidden():
    """Three slits a step high at the borders of the grid: what float64 cannot tell is said to be undecided."""
    random, undecided, hidden = np.random.default_rng(4), 0, 0
    for _ in range(40):
        found = needles.needle(random)
        graph = needles.graph_of(random, found)
        model = model_of(graph)
        reached, answers = flooded(model)
        told = answers.complete[:, None] & ~reached
        told[tuple(answers.undecided.T)] = False
        truth = random_buildings.reached_matrix(graph)
        assert not (told & truth).any(), "wrong-hidden"
        assert not (reached & ~truth).any(), "wrong-visible"
        rows, searches = searched(model)
        visible = truth[rows[:, 0], rows[:, 1]]
        assert not (visible & (searches.verdict == Verdict.HIDDEN)).any(), "wrong-hidden by target search"
        assert not (~visible & (searches.verdict == Verdict.VISIBLE)).any(), "wrong-visible by target search"
        undecided, hidden = undecided + len(answers.undecided), hidden + told.sum()
    assert undecided > 5 and hidden > 30


@pytest.mark.parametrize("name", BUILDINGS)
@pytest.mark.parametrize("cap", [1, 20, 100_000])
def test_rows_do_not_depend_on_the_cap(cap, name, monkeypatch):
    graph = shared_graph(name)

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


def same_answers(one, other):
    for name in ("pairs", "line", "offset", "undecided", "complete"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)


@pytest.mark.parametrize("name", BUILDINGS)
def test_what_does_not_fit_is_searched_again(name, monkeypatch):
    """With room for five pairs at first, and the pairs that are left open among them."""
    model = model_of(shared_graph(name))
    _, whole = flooded(model)
    monkeypatch.setattr(flood, "ROOM", 5)
    _, again = flooded(model, device=Device(threads=2))
    same_answers(again, whole)
    random = np.random.default_rng(4)
    for _ in range(20):
        model = model_of(needles.graph_of(random, needles.needle(random)))
        small = flooded(model)[1]
        monkeypatch.setattr(flood, "ROOM", 2**16)
        same_answers(small, flooded(model)[1])
        monkeypatch.setattr(flood, "ROOM", 1)


def test_rows_of_another_flood_take_their_places():
    """What a small cap cuts off, flooded again, is as one flood with a large one."""
    model = model_of(shared_graph("office"))
    _, whole = flooded(model)
    _, few = flooded(model, cap=20)
    cut = np.flatnonzero(~few.complete)
    assert 3 < len(cut) < len(few.complete) - 3
    same_answers(few.replaced(cut, flooded(model, cut)[1]), whole)


@pytest.mark.parametrize("name", BUILDINGS)
def test_threads_and_chunks_change_nothing(name, monkeypatch):
    model = model_of(shared_graph(name))
    _, one = flooded(model)
    _, two = flooded(model, device=Device(threads=2))
    monkeypatch.setattr(flood, "CHUNK", 7)
    _, chunked = flooded(model, device=Device(threads=2))
    for other in (two, chunked):
        for name in one.__dataclass_fields__:
            np.testing.assert_array_equal(getattr(other, name), getattr(one, name), err_msg=name)
