"""Plans of boxes: places, joining, what they hold, and what an edge parts."""

import numpy as np
from builders.oblique_scenes import corners_of, random_ends, random_plan
from scipy.optimize import linprog
from viewcell.data.plans import NO_PLANS, Plans
from viewcell.verify.exact.plan import inside_plans

SQUARE = np.array([[0, 0], [4, 0], [4, 4], [0, 4]], np.int32)


def some(rows):
    return Plans(np.array(rows), np.stack([SQUARE + 10 * row for row in rows]))


def test_places_taking_filling_and_joining():
    plans = some([1, 3])
    assert plans.places(5).tolist() == [-1, 0, -1, 1, -1]
    taken = plans.take(np.array([3, 0, 3, 1]), 5)
    assert taken.rows.tolist() == [0, 2, 3] and taken.corners[:, 0, 0].tolist() == [30, 30, 10]
    filled = plans.filled(5, np.array([3, 2]))
    assert (filled[0] == SQUARE + 30).all() and not filled[1].any()
    both = Plans.join([(plans, 5), (NO_PLANS, 2), (some([0]), 1)])
    assert both.rows.tolist() == [1, 3, 7] and both.corners[2, 0].tolist() == [0, 0]


def test_points_that_are_held_are_those_of_the_exact_test():
    random = np.random.default_rng(0)
    plans = Plans(np.arange(20), np.array([random_plan(random, random.uniform(-9, 9, 2)) for _ in range(20)], np.int32))
    boxes = random.integers(0, 24, 4000)
    points = np.round(random.uniform(-40, 40, (4000, 3)) * 4) / 4
    held = plans.hold(boxes, points, 24)
    assert (held == inside_plans(plans, boxes, points)).all() and 0 < held.sum() < 4000
    assert held[boxes >= 20].all()


def test_what_an_edge_parts_has_no_point_in_common():
    """Two convex plans overlap iff a linear programme finds a point in both; axial sides are not asked here."""
    random, found = np.random.default_rng(1), [0, 0]
    for _ in range(200):
        plans = [random_plan(random, random.uniform(-15, 15, 2)) for _ in range(2)]
        held = Plans(np.arange(2), np.array(plans, np.int32))
        boxes = np.array([[[*p.min(axis=0), 0], [*p.max(axis=0), 9]] for p in plans])
        parted = held.part(2, np.array([0]), np.array([1]), boxes)[0]
        rows, most = [], []
        for plan in plans:
            for a, b in zip(plan, np.roll(plan, -1, axis=0), strict=True):
                inward = np.array([a[1] - b[1], b[0] - a[0]])
                rows.append([*-inward, 1.0])
                most.append(-(inward @ a))
        best = linprog([0, 0, -1], A_ub=rows, b_ub=most, bounds=[(None, None), (None, None), (None, 1)])
        assert parted == (-best.fun < 1e-9)
        found[int(parted)] += 1
    assert min(found) > 40


def test_ends_of_random_scenes_are_apart():
    random, parted = np.random.default_rng(2), 0
    for _ in range(100):
        boxes, plans, _ = random_ends(random)
        if all(plan is None for plan in plans):
            continue
        rows = [n for n in (0, 1) if plans[n] is not None]
        held = Plans(np.array(rows), np.array([plans[n] for n in rows], np.int32))
        if held.part(2, np.array([0]), np.array([1]), boxes)[0]:
            first, second = (corners_of(box, plan) for box, plan in zip(boxes, plans, strict=True))
            middle = [first.mean(axis=0), second.mean(axis=0)]
            assert not inside_plans(Plans(np.array([0]), first[None]), np.array([0]), np.array([[*middle[1], 0]]))[0]
            parted += 1
    assert parted > 30
