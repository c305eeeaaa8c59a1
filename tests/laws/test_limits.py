"""Searches that run out of room, pieces or depth: what they say is what they say with room enough, or UNKNOWN."""

import numpy as np
import pytest
import warp as wp
from builders import limits, random_buildings, random_solids
from builders.blocker_scenes import blockers_of, ladder, screened
from viewcell.data.verdict import Verdict
from viewcell.kernels.blockers import blocker_tree
from viewcell.kernels.flood import launch_flood
from viewcell.kernels.graph import device_graph
from viewcell.kernels.line_tree import launch_line_trees
from viewcell.kernels.shaft import launch_shaft
from viewcell.kernels.stab_batch import launch_stab
from viewcell.kernels.target import launch_target_search
from viewcell.verify.exact.stab import stab
from viewcell.verify.proofs.line_tree import Blocker, hides
from viewcell.verify.proofs.ways import End

CAP = 100_000
# Rows in a list, edges of a polygon of directions, and trials of a decision: enough for the first steps of a search.
SMALL = {"LIST_CAPACITY": 8, "EDGE_CAPACITY": 4, "MAX_TRIALS": 1}


@pytest.fixture
def small():
    with limits.limited(**SMALL):
        yield


def buildings(seeds, walls=6):
    for seed in seeds:
        graph, _ = random_buildings.random_graph(seed, walls=walls)
        yield graph, random_buildings.reached_matrix(graph)


def box_lists(rng, count):
    """Portals near common lines: boxes, shape (count, 8, 2, 3), of which an octant +++ line passes all or nearly so."""
    speed = rng.integers(1, 60, (count, 1, 3))
    touch = np.sort(rng.integers(0, 60, (count, 8, 1)), axis=1) * speed + rng.integers(-3, 4, (count, 8, 3))
    boxes = np.stack([touch - rng.integers(0, 90, touch.shape), touch + rng.integers(1, 90, touch.shape)], axis=2)
    axis = rng.integers(0, 3, (count, 8, 1, 1)) == np.arange(3)
    return np.where(axis, touch[:, :, None], boxes)


def test_lists_of_boxes(small):
    boxes = box_lists(np.random.default_rng(0), 600)
    verdict = launch_stab(boxes, np.ones((len(boxes), 3), int)).verdict
    truth = np.array([stab(one, (1, 1, 1)).verdict is Verdict.VISIBLE for one in boxes])
    assert not (truth & (verdict == Verdict.HIDDEN)).any(), "wrong-hidden"
    assert not (~truth & (verdict == Verdict.VISIBLE)).any(), "wrong-stabbed"
    assert np.bincount(verdict, minlength=3).min() > 20


def test_floods(small):
    cut = 0
    for graph, truth in buildings(range(8)):
        found = launch_flood(device_graph(graph), np.arange(graph.cell_count), cap=CAP)
        reached = np.eye(graph.cell_count, dtype=bool)
        reached[found.pairs[:, 0], found.pairs[:, 1]] = True
        assert not (reached & ~truth).any(), "wrong-visible"
        told = found.complete[:, None] & ~reached
        told[tuple(found.undecided.T)] = False
        assert not (told & truth).any(), "wrong-hidden"
        cut += (~found.complete).sum() + len(found.undecided)
    assert cut > 20


def searched(source, target, boxes, strict, cap=CAP):
    tree, ends = blocker_tree(blockers_of(boxes)), np.stack([source, target]).astype(np.int32)
    return launch_target_search(tree, ends, np.array([[0, 1, int(strict)]]), cap=cap)


@pytest.fixture(scope="module")
def decided():
    """Scenes and what an ample search says of them, which it does say."""
    scenes = [screened(seed, holes=seed // 4 % 3) for seed in range(600)]
    random = np.random.default_rng(0)
    scenes += [ladder(random, 400, 1 + n % 3, n % 4, square=n % 5 == 0) for n in range(60)]
    found = [(scene, int(searched(*scene).verdict[0])) for scene in scenes if len(scene[2]) > 3]
    assert all(verdict != Verdict.UNKNOWN for _, verdict in found)
    return found


def test_target_searches(decided, small):
    withheld = 0
    for scene, truth in decided:
        verdict = searched(*scene).verdict[0]
        assert verdict in (truth, Verdict.UNKNOWN), scene
        withheld += verdict == Verdict.UNKNOWN
    assert 10 < withheld < 0.9 * len(decided)


def test_target_searches_without_trials(decided):
    """Nothing is decided but by what surely has no line: the first step of a search, too, is then in doubt."""
    with limits.limited(MAX_TRIALS=0):
        verdicts = [(searched(*scene).verdict[0], truth) for scene, truth in decided]
    assert all(verdict in (truth, Verdict.UNKNOWN) for verdict, truth in verdicts)
    assert sum(verdict == Verdict.UNKNOWN for verdict, _ in verdicts) > len(decided) / 2


@pytest.mark.parametrize("cap", [1, 2, 3, 5, 9, 17])
def test_target_searches_of_few_lines(decided, cap):
    verdicts = [(searched(*scene, cap=cap).verdict[0], truth) for scene, truth in decided]
    assert all(verdict in (truth, Verdict.UNKNOWN) for verdict, truth in verdicts)
    assert cap > 5 or sum(verdict == Verdict.UNKNOWN for verdict, _ in verdicts) > 5


def test_line_trees(decided, small):
    """A tree that finds no room is not written; one that is written holds."""
    written = missing = 0
    for (source, target, boxes, strict), truth in decided:
        tree, ends = blocker_tree(blockers_of(boxes)), np.stack([source, target]).astype(np.int32)
        for room in (1, 3, 50):
            trees = launch_line_trees(tree, ends, np.array([[0, 1, int(strict)]]), np.array([room]))
            blockers = {n: Blocker(int((box[0] == box[1]).argmax()), box.tolist()) for n, box in enumerate(boxes)}
            if len(trees.words):
                assert truth == Verdict.HIDDEN
                assert hides(End(source.tolist()), End(target.tolist()), strict, trees.words.tolist(), blockers)
                written += 1
            missing += truth == Verdict.HIDDEN and not len(trees.words)
    assert min(written, missing) > 20


@pytest.mark.usefixtures("small")
def test_line_trees_stay_in_their_room(decided, monkeypatch):
    """What lies behind the last tree's room is not written to."""
    held, behind = [], 5000

    def roomy(shape, **options):
        held.append(wp.full(shape + behind, value=-77, **options))
        return held[-1]

    monkeypatch.setattr(wp, "empty", roomy)
    for (source, target, boxes, strict), truth in decided:
        if truth == Verdict.HIDDEN:
            tree, ends = blocker_tree(blockers_of(boxes)), np.stack([source, target]).astype(np.int32)
            launch_line_trees(tree, ends, np.array([[0, 1, int(strict)]]), np.array([0]))
    assert len(held) > 20 and all((words.numpy()[-behind:] == -77).all() for words in held)


@pytest.mark.parametrize("values", [{"STACK": 3}, {"STACK": 6, "RECENT": 1}])
def test_pieces_of_shafts(values):
    scene = random_solids.random_solids(3, axial=6, turned=4)
    shields, _, _ = random_solids.shields_of(scene)
    random = np.random.default_rng(3)
    low = random.integers(-1024, 6144, (3000, 3))
    boxes = np.stack([low, low + random.integers(64, 1500, (3000, 3))], axis=1).astype(np.int32)
    rows = np.arange(3000).reshape(-1, 2)
    options = {"smallest": (16, 16), "cap": 4000}
    ample = launch_shaft(shields, boxes, rows, **options).verdict
    for cap in (1, 2, 3, 10, 50):
        hidden = launch_shaft(shields, boxes, rows, smallest=(16, 16), cap=cap).verdict == Verdict.HIDDEN
        assert not (hidden & (ample != Verdict.HIDDEN)).any()
    with limits.limited(**values):
        few = launch_shaft(shields, boxes, rows, **options).verdict
    assert not ((few == Verdict.HIDDEN) & (ample != Verdict.HIDDEN)).any()
    assert (few != ample).sum() > 5 and (few == Verdict.HIDDEN).sum() > 50
