"""Which setting is recommended, from given measurements: never a worse one, never noise."""

import pytest
from viewcell.workbench.tune.choice import AS_TIGHT, LOOSER, TIGHTER, Row, hopeful, recommended, why_not


def row(ratios=(0.8, 0.8, 0.8), **facts):
    facts = {"tightness": AS_TIGHT, "kept": 0.1, "pairs": 100} | facts
    return Row("a", {"threshold_m2": 1.0}, [10.0 * ratio for ratio in ratios], list(ratios), **facts)


DEFAULT = Row("the default", {}, [10.0] * 3, [1.0] * 3, pairs=100, kept=0.1)


def best(*rows):
    return recommended([DEFAULT, *rows], 3)


def test_as_tight_and_faster_by_more_than_times_vary_is_recommended():
    fast = row((0.78, 0.8, 0.82))
    assert why_not(fast) == "" and best(fast) is fast


@pytest.mark.parametrize("ratios", [(0.7, 0.85, 0.95), (0.97, 0.97, 0.97), (1.0, 1.0, 1.0), (0.85, 0.9, 0.96)])
def test_a_gain_within_the_noise_is_none(ratios):
    assert why_not(row(ratios)) == "no gain beyond noise" and best(row(ratios)) is DEFAULT


@pytest.mark.parametrize("ratios", [(0.95, 1.0, 1.05), (0.99, 1.0, 1.0), (0.5, 0.6, 0.7)])
def test_tighter_and_no_slower_is_recommended(ratios):
    tight = row(ratios, tightness=TIGHTER, kept=0.09)
    assert best(tight) is tight


@pytest.mark.parametrize("ratios", [(1.0, 1.01, 1.02), (0.9, 0.95, 1.2)])
def test_tighter_but_slower_is_not(ratios):
    tight = row(ratios, tightness=TIGHTER, kept=0.09)
    assert why_not(tight) == "tighter, slower" and best(tight) is DEFAULT


@pytest.mark.parametrize(
    ("facts", "why"),
    [
        ({"tightness": LOOSER}, "looser"),
        ({"hidden": 1}, "hides 1 visible"),
        ({"uncovered": 0.02}, "looks from 2 % less"),
        ({"stopped": True}, "slower, stopped"),
        ({"unusable": "says nothing of cells"}, "says nothing of cells"),
    ],
)
def test_faster_is_not_enough(facts, why):
    other = row((0.1, 0.1, 0.1), **facts)
    assert why_not(other) == why and best(other) is DEFAULT and not hopeful(other)


def test_what_was_measured_too_seldom_is_not_recommended():
    assert best(row((0.5, 0.5))) is DEFAULT


def test_the_tightest_comes_first_then_the_fastest():
    fast, tight, both = row((0.3,) * 3), row((0.9,) * 3, tightness=TIGHTER, kept=0.09), row((0.8,) * 3, kept=0.1)
    assert best(fast, tight, both) is tight and best(both, fast) is fast


def test_hopeless_rows_get_no_second_round():
    assert hopeful(row((1.2,))) and not hopeful(row((1.3,)))
