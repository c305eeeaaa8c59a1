"""Motions: what they come to, what is refused, and that their boxes hold them at any time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.animation import Animation
from viewcell.data.errors import InputError

FAN = np.array([[x, y, z] for x in (-0.6, 0.6) for y in (-0.1, 0.1) for z in (0.0, 0.02)])


def test_the_papers_own_example():
    """Ten degrees about z every second."""
    turn = Animation("-rz $10 * t$")
    assert np.allclose(turn.matrix(9.0)[:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert np.allclose(turn.matrix(36.0), np.eye(4)) and np.allclose(turn.matrix(0.0), np.eye(4))


def test_steps_are_done_from_left_to_right():
    assert np.allclose(Animation("-tx 1 -rz 90").matrix(0) @ [0, 0, 0, 1], [0, 1, 0, 1])
    assert np.allclose(Animation("-rz 90 -tx 1").matrix(0) @ [0, 0, 0, 1], [1, 0, 0, 1])
    moved = Animation("-sa 2 -sy .5 -rx 90 -ry -90 -tz $-(t / 4) + abs(-1)$").matrix(2.0)
    assert np.allclose(moved @ [1, 1, 1, 1], [-1, -2, 2.5, 1]), moved @ [1, 1, 1, 1]


def test_terms():
    for term, value in {
        "t": 3.0,
        "2 * sin(30 * t - 60) + cos(60)": 1.5,
        "min(t, 2) - max(t, 4) / 8": 1.5,
        "-abs(-t) + +1": -2.0,
        "pi": np.pi,
    }.items():
        assert Animation(f"-tx ${term}$").matrix(3.0)[0, 3] == pytest.approx(value)


def test_a_period_begins_anew():
    swing = Animation("-tx $t$", period_s=4.0)
    assert swing.matrix(5.0)[0, 3] == 1.0 and swing.matrix(3.5)[0, 3] == 3.5


FORMS = [
    "-r{a} ${k} * t + {c}$",
    "-t{a} ${k} * sin({c} * t)$",
    "-s{a} $1 + 0.5 * cos({c} * t)$",
    "-sa {s}",
    "-r{a} {c}",
]


@st.composite
def motions(draw):
    steps = []
    for form in draw(st.lists(st.sampled_from(FORMS), min_size=1, max_size=4)):
        k, c = draw(st.integers(-40, 40)), draw(st.integers(-90, 90))
        steps.append(form.format(a=draw(st.sampled_from("xyz")), k=k, c=c, s=draw(st.sampled_from([0.5, 2, -1]))))
    return Animation(" ".join(steps), draw(st.sampled_from([0.5, 7.0, float("inf")])))


@given(motions(), st.lists(st.floats(0, 1e4), min_size=1, max_size=20), st.integers(0, 99))
def test_boxes_hold_what_moves_at_any_time(motion, times, seed):
    transform = np.eye(4)
    transform[:3] = np.random.default_rng(seed).uniform(-2, 2, (3, 4))
    low, high = motion.swept_box(FAN, transform, "a fan")
    corners = np.column_stack([FAN, np.ones(len(FAN))])
    for t in [*times, 0.0]:
        placed = (corners @ (transform @ motion.matrix(t)).T)[:, :3]
        assert (placed >= low - 1e-9).all() and (placed <= high + 1e-9).all()
    unmoved = (corners @ transform.T)[:, :3]
    assert (unmoved >= low).all() and (unmoved <= high).all()


def test_boxes_hold_the_object_as_it_stands_unmoved():
    """Other commands look at models without a time."""
    low, high = Animation("-tx 5").swept_box(FAN, np.eye(4), "a fan")
    assert np.allclose([low[0], high[0]], [-0.6, 5.6])


def test_boxes_are_tight():
    """A fan's is the square around its circle; a swing of five metres in four seconds reaches five metres."""
    low, high = Animation("-rz $90 * t$", 4.0).swept_box(FAN, np.eye(4), "a fan")
    reach = np.hypot(0.6, 0.1)
    assert np.allclose(low, [-reach, -reach, 0.0], atol=0.02) and np.allclose(high, [reach, reach, 0.02], atol=0.02)
    low, high = Animation("-tx $5 * sin(45 * t)$", 4.0).swept_box(np.zeros((1, 3)), np.eye(4), "a door")
    assert np.allclose(low, 0.0, atol=1e-9) and np.allclose(high, [5, 0, 0], atol=1e-9)
    for_ever = Animation("-rz $90 * t$").swept_box(FAN, np.eye(4), "a fan")
    assert np.abs(for_ever).max() < reach + 1e-9


REFUSED = {
    "": "found none",
    "   ": "found none",
    "-rz": "found '-rz'",
    "-rw 3": "found '-rw 3'",
    "rz 3": "found 'rz 3'",
    "-rz $t": "found '-rz $t'",
    "-rz 3x": "found '-rz 3x'",
    "-rz 3 and more": "found 'and more'",
    "-rz $x$": "a term in t",
    "-rz $t ** 2$": "a term in t",
    "-rz $$": "a term in t",
    "-rz $sin(t, t)$": "a term in t",
    "-rz $min(t)$": "a term in t",
    "-rz $open('x')$": "a term in t",
    "-rz $t.real$": "a term in t",
    "-rz $'t'$": "a term in t",
    "-rz $True$": "a term in t",
    "-rz $1e999$": "a term in t",
    "-rz $" + "(" * 600 + "t" + ")" * 600 + "$": "a term in t",
    "-rz 1 " * 500: "at most 2000 characters",
}


@pytest.mark.parametrize("text", REFUSED)
def test_refused(text):
    with pytest.raises(InputError, match="animation: expected") as error:
        Animation(text)
    assert REFUSED[text].replace("$", "") in str(error.value).replace("$", "") and "\n" not in str(error.value)


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan")])
def test_refused_periods(period):
    with pytest.raises(InputError, match="a period above 0"):
        Animation("-rz 1", period)


@pytest.mark.parametrize("text", ["-tx $t$", "-sa $1 + t$", "-tx $1 / sin(t)$"])
def test_motions_without_bounds(text):
    with pytest.raises(InputError, match="object 3: expected a motion that stays within bounds"):
        Animation(text).swept_box(FAN, np.eye(4), "object 3")
    if "/" not in text:
        Animation(text, 10.0).swept_box(FAN, np.eye(4), "object 3")


def test_no_division_by_zero():
    with pytest.raises(InputError, match=r"no division by 0, found one at 1\.0 s"):
        Animation("-tx $1 / (t - 1)$").matrix(1.0)
