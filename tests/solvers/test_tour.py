import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.ragged import starts_of
from viewcell.solvers.tour import CURVE_BITS, count_runs, curve_places, distinct_columns, tour_order
from viewcell.verify.exact.tour import runs

# Rows and columns, as the note on storage has them: 11 runs as made, 5 at best over all 5,040 orders.
ROWS = ["1010100", "0101010", "1000101", "1110001"]


def sets_of(rows):
    members = [[k for k, c in enumerate(row) if c == "1"] for row in rows]
    return starts_of([len(row) for row in members]), np.array([k for row in members for k in row], int)


def test_the_best_order_of_the_note():
    starts, members = sets_of(ROWS)
    assert count_runs(starts, members, np.arange(7)) == 11
    assert count_runs(starts, members, tour_order(starts, members, np.zeros((7, 3)))) == 5


@st.composite
def sets(draw):
    width = draw(st.integers(0, 12))
    return draw(st.lists(st.text("01", min_size=width, max_size=width), max_size=6))


@given(sets(), st.sampled_from([1, 20_000]))
def test_each_object_once_and_runs_are_counted_as_they_are(rows, most):
    starts, members = sets_of(rows)
    count = len(rows[0]) if rows else 4
    order = tour_order(starts, members, np.random.default_rng(0).random((count, 3)), most=most)
    assert sorted(order.tolist()) == list(range(count))
    assert count_runs(starts, members, order) == (runs(rows, order) if rows else 0)
    # Objects in the same sets stand together, in order; those in none come last.
    city = distinct_columns(starts, members, count)[0][order]
    assert (np.diff(order)[np.diff(city) == 0] > 0).all()
    assert len(np.unique(city)) == (len(city) > 0) + np.count_nonzero(np.diff(city))
    assert not (np.diff((city == 0).astype(int)) < 0).any()


def test_objects_come_in_any_order_with_the_same_runs():
    """The question does not depend on how objects are numbered."""
    rng = np.random.default_rng(5)
    rows = ["".join(rng.choice(["0", "1"], 30, p=[0.8, 0.2])) for _ in range(12)]
    found = []
    for _ in range(4):
        shuffled = rng.permutation(30)
        starts, members = sets_of(["".join(row[k] for k in shuffled) for row in rows])
        found.append(count_runs(starts, members, tour_order(starts, members, np.zeros((30, 3)))))
    assert max(found) <= 1.1 * min(found)


def test_columns_are_those_of_the_objects():
    starts, members = sets_of(ROWS)
    city, columns = distinct_columns(starts, members, 7)
    assert not columns[:, 0].any() and len({tuple(c) for c in columns.T.tolist()}) == columns.shape[1]
    for k in range(7):
        assert columns[:, city[k]].tolist() == [row[k] == "1" for row in ROWS]


def test_many_objects_go_along_the_curve():
    """Sets by place: where all pairs are too many to look at, the curve leads on, and costs a few runs."""
    rng = np.random.default_rng(6)
    places = rng.random((900, 3))
    eyes = rng.random((40, 3))
    near = np.linalg.norm(places[None] - eyes[:, None], axis=2) < 0.25
    starts, members = starts_of(near.sum(axis=1)), np.nonzero(near)[1]
    all_pairs, curve = (count_runs(starts, members, tour_order(starts, members, places, most=n)) for n in (2000, 10))
    shuffled = count_runs(starts, members, rng.permutation(900))
    assert all_pairs <= curve * 1.02 and curve <= 1.1 * all_pairs and curve < 0.6 * shuffled


def test_the_curve_visits_neighbour_after_neighbour():
    side = 8
    step = 2**CURVE_BITS // side
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    # The corners of the whole box fix the scale: the middles of cells, then.
    points = np.concatenate([grid * step + step // 2, [[0, 0, 0], [2**CURVE_BITS - 1] * 3]])
    along = curve_places(points.astype(float))[:-2]
    assert len(np.unique(along)) == side**3
    steps = np.abs(np.diff(grid[np.argsort(along)], axis=0)).sum(axis=1)
    assert (steps == 1).all()


@pytest.mark.parametrize("flat", [0, 3])
def test_points_on_a_line_or_in_one_place(flat):
    points = np.zeros((5, 3))
    points[:, 0] = 0 if flat == 3 else [3, 1, 4, 1, 5]
    assert np.argsort(curve_places(points), kind="stable").tolist() == (
        [0, 1, 2, 3, 4] if flat == 3 else [1, 3, 0, 2, 4]
    )
