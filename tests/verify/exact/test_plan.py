"""Points in plans, exactly, up to the border of the grid."""

from fractions import Fraction

import numpy as np
from builders.oblique_scenes import LIMIT, random_plan
from viewcell.data.plans import NO_PLANS, Plans
from viewcell.verify.exact.plan import inside_plans


def by_hand(plan, point):
    """In rationals."""
    x, y = (Fraction(float(c)) for c in point[:2])
    corners = [[int(c) for c in p] for p in plan]
    pairs = zip(corners, corners[1:] + corners[:1], strict=True)
    return all((c - a) * (y - b) - (d - b) * (x - a) > 0 for (a, b), (c, d) in pairs)


def test_points_near_edges_are_told_apart():
    random = np.random.default_rng(0)
    plans = np.array([random_plan(random, random.uniform(-50, 50, 2)) for _ in range(30)])
    plans = np.concatenate([plans, plans * 1000 + LIMIT - 2_000_000]).astype(np.int32)
    held = Plans(2 * np.arange(len(plans)), plans)
    boxes, points = [], []
    for n, plan in enumerate(plans.astype(float)):
        for k in range(4):
            a, b = plan[k], plan[(k + 1) % 4]
            for share in (0, 0.25, 0.5, 0.7, 1):
                for off in (-1, -(2.0**-10), 0, 2.0**-10, 1):
                    points.append([*(a + share * (b - a) + off * random.normal(size=2)), 5.0])
                    boxes.append(2 * n)
    boxes, points = np.array(boxes), np.array(points)
    wanted = [by_hand(plans[box // 2], point) for box, point in zip(boxes, points, strict=True)]
    found = inside_plans(held, boxes, points)
    assert found.tolist() == wanted and 100 < sum(wanted) < len(wanted) - 100


def test_edges_and_corners_are_outside():
    plan = np.array([[0, 0], [40, 30], [10, 70], [-30, 40]])
    held = Plans(np.array([0]), plan[None].astype(np.int32))
    points = np.concatenate([plan, (plan + np.roll(plan, -1, axis=0)) / 2, [[5, 35]]])
    points = np.column_stack([points, np.zeros(len(points))])
    assert inside_plans(held, np.zeros(len(points), int), points).tolist() == [False] * 8 + [True]


def test_boxes_without_a_plan_hold_everything():
    points = np.array([[1e6, 1e6, 0]])
    assert inside_plans(NO_PLANS, np.array([3]), points).all()
    held = Plans(np.array([3]), np.array([[[0, 0], [4, 0], [4, 4], [0, 4]]], np.int32))
    assert inside_plans(held, np.array([2]), points)[0] and inside_plans(held, np.array([9]), points)[0]
    assert not inside_plans(held, np.array([3]), points)[0]
