"""Intervals hold what their operations give, exactly; found true in rationals where there are any."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from viewcell.data.interval import FAR, Interval, cosine, sine

numbers = st.floats(-1e6, 1e6, allow_nan=False)
OPERATIONS = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
}


@st.composite
def held(draw):
    """An interval and a number in it."""
    a, b = sorted((draw(numbers), draw(numbers)))
    share = draw(st.floats(0, 1))
    return Interval(np.float64(a), np.float64(b)), min(max(a + share * (b - a), a), b)


TINY = -np.finfo(np.float64).tiny


@given(held(), held(), st.sampled_from(sorted(OPERATIONS)))
@example((Interval(np.float64(0.0), np.float64(4.0)), 0.0), (Interval(np.float64(-1.0), np.float64(TINY)), -1.0), "/")
@example((Interval(np.float64(1.0), np.float64(2.0)), 1.0), (Interval(np.float64(5e-324), np.float64(1.0)), 1.0), "/")
def test_results_are_held(first, second, name):
    (p, a), (q, b) = first, second
    if name == "/" and q.low <= 0 <= q.high:
        whole = p / q
        assert whole.low == -np.inf and whole.high == np.inf
        return
    found, truth = OPERATIONS[name](p, q), OPERATIONS[name](Fraction(a), Fraction(b))
    # An infinite end holds anything, and no fraction is infinite.
    assert found.low == -np.inf or Fraction(float(found.low)) <= truth
    assert found.high == np.inf or truth <= Fraction(float(found.high))


@given(held(), held())
def test_other_functions_hold(first, second):
    (p, a), (q, b) = first, second
    for found, truth in ((abs(p), abs(a)), (p.maximum(q), max(a, b)), (p.minimum(q), min(a, b)), (-p, -a)):
        assert found.low <= truth <= found.high
    assert abs(p).low >= 0 and abs(a) <= p.size


@given(held())
def test_waves_hold(pair):
    angle, x = pair
    for wave, truth in ((sine, np.sin), (cosine, np.cos)):
        found = wave(angle)
        assert -1 <= found.low <= truth(x) <= found.high <= 1


@pytest.mark.parametrize("wave", [sine, cosine])
def test_waves_are_tight(wave):
    truth = {sine: np.sin, cosine: np.cos}[wave]
    rng = np.random.default_rng(0)
    low = rng.uniform(-20, 20, 500)
    high = low + rng.uniform(0, 4, 500)
    found = wave(Interval(low, high))
    values = truth(low[:, None] + (high - low)[:, None] * np.linspace(0, 1, 4001))
    assert (found.low <= values.min(axis=1)).all() and (found.high >= values.max(axis=1)).all()
    assert np.abs(found.low - values.min(axis=1)).max() < 1e-6 > np.abs(found.high - values.max(axis=1)).max()


def test_far_and_infinite_angles_may_be_anything():
    for end in (2 * FAR, np.inf):
        found = sine(Interval(np.array([end - 1]), np.array([end])))
        assert found.low == -1 and found.high == 1


def test_infinite_ends():
    ever, nothing = Interval(np.float64(0.0), np.float64(np.inf)), Interval.of(0.0)
    assert (ever * nothing).high < 1e-300 and (ever * nothing).low > -1e-300
    assert (ever - ever).low == -np.inf and (ever - ever).high == np.inf
