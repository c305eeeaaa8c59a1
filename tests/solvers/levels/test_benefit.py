"""Benefit of tuples, and the choice of levels along a path."""

import itertools

import numpy as np
import pytest
from builders import small_house
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.camera import NEAR_M, CameraPath, Screen, covered_pixels, on_screen, project_boxes
from viewcell.data.errors import InputError
from viewcell.data.scene import Definition, Instance, Mesh, Role, Scene
from viewcell.kernels.raster import device_triangles, launch_raster
from viewcell.kernels.select import launch_select
from viewcell.solvers.levels.benefit import (
    NOTHING,
    Algorithm,
    BenefitSettings,
    Candidates,
    Sightings,
    accuracy_by_error,
    accuracy_by_samples,
    find_candidates,
    find_sightings,
    find_tuples,
    focus_factor,
    hysteresis_factor,
    motion_factor,
)
from viewcell.solvers.levels.select_frames import Coherence, certified_bound, fitting, frame_problem, select_frames
from viewcell.verify.exact.select import best_by_table

SCREEN = Screen(200, 150, 60.0)


def ball(faces, error_m):
    """So many triangles in a metre's box."""
    return Mesh(small_house.UNIT_BOX, np.resize(small_house.FACES, (faces, 3)), error_m)


def shelf(lods=((12, 0.0), (6, 0.02), (2, 0.1)), count=6):
    """Objects in a row along the x axis, the first near the origin."""
    shape = Definition("ball", tuple(ball(*lod) for lod in lods))
    placed = []
    for k in range(count):
        transform = np.eye(4)
        transform[:3, 3] = (3 * k + 2, 0, 0)
        placed.append(Instance(f"ball {k}", "IfcLamp" if k % 2 else "IfcChair", 0, transform, Role.DETAIL))
    return Scene([shape], placed)


def looking(eyes, yaw=0.0):
    eyes = np.array(eyes, float)
    return CameraPath(eyes, np.full(len(eyes), float(yaw)), np.zeros(len(eyes)), np.arange(len(eyes)) / 10)


def prepared(scene, path, settings, screen=SCREEN):
    tuples = find_tuples(scene, settings)
    everything = np.ones((len(path), len(scene.objects)), bool)
    sightings = find_sightings(scene, path, screen, everything)
    return tuples, sightings, find_candidates(scene, tuples, sightings, screen, settings)


def by_kernel(benefits, costs, starts, budget, _previous):
    return launch_select(benefits, costs, starts, budget).choice[0]


def test_tuples_are_levels_times_algorithms_and_nothing():
    settings = BenefitSettings(algorithms=(Algorithm("flat"), Algorithm("gouraud", 1.5, 1.0, 2.0)))
    found = find_tuples(shelf(count=2), settings)
    assert found.starts.tolist() == [0, 7, 14]
    assert found.lod[:7].tolist() == [0, 0, 1, 1, 2, 2, NOTHING]
    assert found.algorithm[:7].tolist() == [0, 1, 0, 1, 0, 1, 0]
    assert found.primitives[:7].tolist() == [12, 12, 6, 6, 2, 2, 0]
    assert (found.faceless, found.left_out) == (0, 0)


def test_levels_that_cost_no_less_and_empty_ones_are_left_out_and_counted():
    scene = shelf([(12, 0.0), (12, 0.1), (14, 0.2), (4, 0.3), (0, 0.4)], count=1)
    scene.definitions.append(Definition("air", (ball(0, 0.0),)))
    scene.objects.append(Instance("air", "IfcChair", 1, np.eye(4), Role.DETAIL))
    found = find_tuples(scene, BenefitSettings(always=("IfcChair",)))
    assert found.lod.tolist() == [0, 3, NOTHING]
    assert found.starts.tolist() == [0, 2, 3]
    assert (found.faceless, found.left_out) == (1, 4)


def test_factors_are_the_stated_formulas():
    assert accuracy_by_samples(np.array([1, 10]), 1.0).tolist() == [0.5, 0.95]
    assert accuracy_by_samples(np.array([10]), 2.0).tolist() == [0.995]
    # A deviation of 1 cm at 5 m on a screen of focal length 500: one pixel.
    assert accuracy_by_error(np.array([0.0, 0.01]), np.array([5.0, 5.0]), 500.0).tolist() == [1.0, 0.5]
    assert focus_factor(np.array([0.0, 0.5, 1.0]), 0.4).tolist() == pytest.approx([1.0, 0.7, 0.4])
    # 400 pixels in 4 polygons: 10 pixels wide each.
    assert motion_factor(np.array([0.0, 10.0]), np.array([400.0] * 2), np.array([4, 4]), 1.0).tolist() == [1.0, 0.5]
    found = hysteresis_factor(np.array([0, 1, 3, 2]), np.array([0, 0, 0, -1]), np.array([4] * 4), 0.3)
    assert found.tolist() == pytest.approx([1.0, 0.9, 0.7, 1.0])


def test_benefit_is_the_product_of_its_factors():
    scene, path = shelf(), looking([[0, 0.5, 0.5], [0.05, 0.5, 0.6]])
    settings = BenefitSettings(importance={"IfcLamp": 3.0})
    tuples, sightings, found = prepared(scene, path, settings)
    assert len(sightings.object_id) == 12
    for s in range(12):
        own = slice(found.starts[s], found.starts[s + 1])
        assert found.benefit[own][-1] == 0 == found.pixels[own][-1]
        for k in range(own.start, own.stop - 1):
            which = found.tuple_id[k]
            expected = sightings.pixels[s] * (3.0 if sightings.object_id[s] % 2 else 1.0)
            error = tuples.error_m[which] * SCREEN.focal / sightings.distance_m[s]
            expected *= (1 / (1 + error)) * (1 - 0.5 * sightings.off_middle[s])
            width = np.sqrt(sightings.pixels[s] / tuples.primitives[which])
            expected *= 1 / (1 + sightings.speed[s] / width)
            assert found.benefit[k] == pytest.approx(expected)
    assert (sightings.speed[:6] == 0).all() and (sightings.speed[6:] > 0).all()
    assert (np.diff(sightings.distance_m[:6]) > 2.9).all()


def test_samples_give_the_accuracy_where_asked():
    scene, path = shelf(count=1), looking([[0, 0.5, 0.5]])
    kinds = (Algorithm("flat", exponent=1.0), Algorithm("gouraud", 2.0, 0.5, 2.0))
    _, sightings, found = prepared(scene, path, BenefitSettings("samples", algorithms=kinds, edge_focus=1, motion=0))
    shares = [
        1 - 0.5 / 12,
        0.5 * (1 - 0.5 / 144),
        1 - 0.5 / 6,
        0.5 * (1 - 0.5 / 36),
        1 - 0.5 / 2,
        0.5 * (1 - 0.5 / 4),
        0,
    ]
    assert found.benefit.tolist() == pytest.approx([sightings.pixels[0] * share for share in shares])


def test_what_is_behind_or_beside_the_eye_is_not_sighted():
    scene = shelf()
    assert not len(prepared(scene, looking([[0, 0.5, 0.5]], yaw=180), BenefitSettings())[1].object_id)
    assert prepared(scene, looking([[7, 0.5, 0.5]]), BenefitSettings())[1].object_id.tolist() == [2, 3, 4, 5]
    sideways = prepared(scene, looking([[8.5, -1.5, 0.5]], yaw=90), BenefitSettings())[1]
    assert sideways.object_id.tolist() == [2]


def test_covered_pixels_are_those_of_the_box():
    # A square metre face on at 2 m: (focal / 2) ** 2 pixels; the rest of the box is behind it.
    box, eye = np.array([[[2.0, -0.5, -0.5], [3.0, 0.5, 0.5]]]), np.zeros((1, 3))
    axes = looking(eye).axes()
    rectangles, _ = on_screen(SCREEN, project_boxes(SCREEN, eye, axes, box))
    assert covered_pixels(SCREEN, eye, axes, box, rectangles)[0] == pytest.approx((SCREEN.focal / 2) ** 2, rel=1e-3)
    # A box around the eye covers the screen.
    around = np.array([[[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]])
    rectangles, _ = on_screen(SCREEN, project_boxes(SCREEN, eye, axes, around))
    assert covered_pixels(SCREEN, eye, axes, around, rectangles)[0] == pytest.approx(200 * 150)


def test_covered_pixels_are_about_those_that_are_drawn():
    rng, count = np.random.default_rng(0), 60
    middles = np.column_stack([rng.uniform(2, 8, count), rng.uniform(-4, 4, (count, 2))])
    sizes = rng.uniform(0.01, 2, (count, 3))
    boxes = np.round(np.stack([middles - sizes, middles + sizes], axis=1) * 1024) / 1024
    path = CameraPath(np.zeros((1, 3)), np.array([20.0]), np.array([25.0]), np.zeros(1))
    eyes, axes = np.zeros((count, 3)), np.repeat(path.axes(), count, axis=0)
    rectangles, inside = on_screen(SCREEN, project_boxes(SCREEN, eyes, axes, boxes))
    found = covered_pixels(SCREEN, eyes, axes, boxes, rectangles)
    unit, faces = small_house.UNIT_BOX, small_house.FACES
    off = []
    for k in np.flatnonzero(inside):
        corners = (boxes[k, 0] + unit * (boxes[k, 1] - boxes[k, 0])) * 1024
        shown = launch_raster(
            device_triangles(corners[faces].astype(np.int32)),
            np.array([[0, len(faces), 0]]),
            np.array([0, 1]),
            np.zeros((1, 3)),
            path.axes(),
            width=SCREEN.width,
            height=SCREEN.height,
            focal=SCREEN.focal,
            near=NEAR_M * 1024,
        )
        area = (rectangles[k, 1] - rectangles[k, 0]).prod()
        if area > 400:
            off.append((found[k] - (shown.ids[0] == 0).sum()) / area)
    assert len(off) > 20
    assert np.abs(off).max() < 0.15 and np.abs(off).mean() < 0.05


@st.composite
def frames_of_tuples(draw):
    """Random candidates of a few objects in a few frames, small enough for the exact table."""
    frames, objects = draw(st.integers(1, 5)), draw(st.integers(1, 4))
    sizes = draw(st.lists(st.integers(1, 3), min_size=objects, max_size=objects))
    ids, starts, benefit, cost, rank = [], [0], [], [], []
    for _ in range(frames):
        present = draw(st.lists(st.integers(0, objects - 1), unique=True, max_size=objects))
        ids.append(sorted(present))
        for g in sorted(present):
            benefit += [*draw(st.lists(st.integers(0, 50), min_size=sizes[g], max_size=sizes[g])), 0]
            cost += [*draw(st.lists(st.integers(1, 9), min_size=sizes[g], max_size=sizes[g])), 0]
            rank += range(sizes[g] + 1)
            starts.append(len(cost))
    count = np.append(0, np.cumsum([len(one) for one in ids]))
    blank = np.zeros(int(count[-1]))
    sightings = Sightings(count, np.array(list(itertools.chain(*ids)), np.int64), blank, blank, blank, blank)
    found = Candidates(np.array(starts), np.zeros(len(cost), int), np.array(rank, int), np.array(benefit, float), blank)
    return sightings, found, np.array(cost, np.int64)


@given(frames_of_tuples(), st.integers(0, 30), st.sampled_from([0.0, 0.1, 0.4]), st.sampled_from([0.0, 0.05, 0.5]))
def test_coherence_keeps_the_budget_and_loses_no_more_than_it_may(asked, budget, hysteresis, slack):
    sightings, candidates, cost = asked
    how = Coherence(hysteresis, slack)
    found = select_frames(sightings, candidates, cost, budget, by_kernel, how)
    assert (found.cost <= budget).all() and not found.dropped.any()
    before = {}
    for frame in range(len(sightings.starts) - 1):
        problem = frame_problem(sightings, candidates, frame)
        now = dict(zip(problem.objects.tolist(), found.chosen[problem.sightings].tolist(), strict=True))
        assert found.value[frame] == candidates.benefit[list(now.values())].sum()
        assert found.cost[frame] == cost[list(now.values())].sum()
        ranks = {g: int(candidates.rank[k]) for g, k in now.items()}
        assert found.switches[frame] == sum(before.get(g, rank) != rank for g, rank in ranks.items())
        if found.kept[frame]:
            assert found.switches[frame] == 0
        if now:
            groups = [
                [(int(cost[k]), int(candidates.benefit[k])) for k in problem.candidates[a:b]]
                for a, b in itertools.pairwise(problem.starts)
            ]
            best = float(exact_best(groups, budget))
            bound = certified_bound(problem, candidates, cost, budget)
            assert bound >= best
            # Half is what the kernel itself may lose.
            assert found.value[frame] >= min((1 - slack) * best, (1 - hysteresis) * best / 2) - 1e-9
            if slack == hysteresis == 0:
                assert found.value[frame] >= best / 2
        before = ranks


def exact_best(groups, budget):
    return best_by_table(
        [[benefit for _, benefit in group] for group in groups],
        [[cost for cost, _ in group] for group in groups],
        budget,
    ).value


def flickering(frames=30):
    """Two equal objects of which one fits, the better one in turn by a hair."""
    count = 2 * frames
    sightings = Sightings(np.arange(frames + 1) * 2, np.tile([0, 1], frames), *[np.ones(count)] * 4)
    benefit = np.array([[100 + f % 2, 0, 101 - f % 2, 0] for f in range(frames)], float).ravel()
    candidates = Candidates(
        np.arange(count + 1) * 2, np.zeros(2 * count, int), np.tile([0, 1], count), benefit, np.ones(2 * count)
    )
    return sightings, candidates, np.tile([10, 0], count)


def test_coherence_stops_flicker():
    sightings, candidates, cost = flickering()
    switches = {
        how: select_frames(sightings, candidates, cost, 10, by_kernel, how).switches.sum()
        for how in (Coherence(), Coherence(hysteresis=0.1), Coherence(slack=0.02))
    }
    assert list(switches.values()) == [58, 0, 0]
    kept = select_frames(sightings, candidates, cost, 10, by_kernel, Coherence(slack=0.02)).kept
    assert kept.tolist() == [False] + [True] * 29


def test_slack_is_spent_no_further_than_allowed():
    sightings, candidates, cost = flickering()
    # 100 instead of 101 loses 0.99 %.
    assert select_frames(sightings, candidates, cost, 10, by_kernel, Coherence(slack=0.0098)).switches.sum() == 58


def test_what_returns_into_view_has_no_past():
    sightings = Sightings(np.array([0, 1, 1, 2]), np.array([0, 0]), *[np.ones(2)] * 4)
    candidates = Candidates(
        np.array([0, 2, 4]), np.zeros(4, int), np.array([0, 1, 0, 1]), np.array([5.0, 0, 0, 5.0]), np.ones(4)
    )
    found = select_frames(sightings, candidates, np.array([1, 0, 1, 0]), 9, by_kernel, Coherence(0.5, 0.5))
    assert found.chosen.tolist() == [0, 3]
    assert found.switches.tolist() == [0, 0, 0] and found.shown.tolist() == [1, 0, 1]


def test_what_must_be_drawn_and_does_not_fit_is_dropped_least_worth_first():
    sightings = Sightings(np.array([0, 4]), np.arange(4), *[np.ones(4)] * 4)
    benefit = np.array([8.0, 4.0, 9.0, 3.0, 3.0, 5.0, 0.0])
    cost = np.array([8, 2, 9, 3, 3, 5, 0])
    candidates = Candidates(np.array([0, 2, 4, 5, 7]), np.zeros(7, int), np.array([0, 1, 0, 1, 0, 0, 1]), benefit, cost)
    problem = frame_problem(sightings, candidates, 0)
    # The cheapest cost 2 + 3 + 3 + 0, worth 2, 1 and 1 a unit: of equals the later goes first.
    for budget, left in (
        (8, [0, 1, 2, 3]),
        (7, [0, 1, 3]),
        (5, [0, 1, 3]),
        (4, [0, 3]),
        (2, [0, 3]),
        (1, [3]),
        (0, [3]),
    ):
        fits, dropped = fitting(problem, benefit, cost, budget)
        assert fits.objects.tolist() == left and dropped == 4 - len(left)
        found = select_frames(sightings, candidates, cost, budget, by_kernel, Coherence())
        assert found.dropped.tolist() == [dropped] and found.cost[0] <= budget
        assert (found.chosen >= 0).tolist() == [g in left for g in range(4)]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"accuracy": "taste"}, "accuracy: expected error or samples"),
        ({"base_error": 1.5}, "base_error"),
        ({"edge_focus": -0.1}, "edge_focus"),
        ({"motion": float("nan")}, "motion"),
        ({"importance": {"IfcDoor": -1.0}}, "importance of IfcDoor"),
        ({"importance": {"IfcDoor": float("nan")}}, "importance of IfcDoor"),
        ({"algorithms": ()}, "algorithms: expected at least one"),
        ({"algorithms": (Algorithm("free", cost_factor=0.0),)}, "algorithm free"),
    ],
)
def test_refuses_weights_out_of_range(wrong, said):
    with pytest.raises(InputError, match=said):
        BenefitSettings(**wrong)


def test_refuses_coherence_out_of_range_and_benefits_that_are_no_numbers():
    sightings, candidates, cost = flickering(2)
    for how in (Coherence(1.0, 0.0), Coherence(0.0, -0.1), Coherence(float("nan"), 0.0)):
        with pytest.raises(InputError, match="coherence"):
            select_frames(sightings, candidates, cost, 10, by_kernel, how)
    candidates.benefit[0] = np.nan
    with pytest.raises(InputError, match="expected a finite benefit"):
        select_frames(sightings, candidates, cost, 10, by_kernel, Coherence())


def test_slack_never_spends_more_than_the_budget():
    sightings = Sightings(np.array([0, 1, 2]), np.array([0, 0]), *[np.ones(2)] * 4)
    candidates = Candidates(
        np.array([0, 2, 4]), np.zeros(4, int), np.array([0, 1, 0, 1]), np.array([9.0, 0, 9.0, 0]), np.ones(4)
    )
    found = select_frames(sightings, candidates, np.array([5, 0, 20, 0]), 10, by_kernel, Coherence(slack=0.5))
    assert found.cost.tolist() == [5, 0] and found.kept.tolist() == [False, False]
