"""Exact axial stabbing: the published vectors, an LP referee, and laws."""

from dataclasses import replace
from fractions import Fraction
from itertools import combinations, product

import highspy
import numpy as np
import pytest
from builders.places import HARD_CASES
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.data.verdict import Verdict
from viewcell.verify.cases.case_file import load_cases
from viewcell.verify.exact.stab import stab, stab_closed
from viewcell.verify.proofs.stab import Certificate, check_certificate

CASES = load_cases(HARD_CASES / "stab.txt")
OCTANTS = list(product((1, -1), repeat=3))


def boxes_of(*corners):
    return np.array(corners, np.int64).reshape(-1, 2, 3)


def line_hits(boxes, point, direction, strict):
    """Slab test of the definition, in rationals, box by box."""
    for low, high in boxes.tolist():
        enter, leave = [], []
        for axis in range(3):
            if direction[axis] == 0:
                if not low[axis] <= point[axis] <= high[axis]:
                    return False
                continue
            ends = sorted((Fraction(c) - point[axis]) / direction[axis] for c in (low[axis], high[axis]))
            enter.append(ends[0])
            leave.append(ends[1])
        pairs = product(enumerate(enter), enumerate(leave))
        for (i, a), (j, b) in pairs:
            if i != j and (a >= b if strict else a > b):
                return False
    return True


def lp_margin(boxes, signs):
    """Largest t <= 1 with all slab conditions slack by t, w >= 1: an independent referee in floating point."""
    boxes = np.sort(boxes * np.array(signs), axis=1)
    rows, n = [], len(boxes)
    for k in range(n):
        for i, j in product(range(3), repeat=2):
            if i != j:
                row = np.zeros(7)
                row[i] += boxes[k, 0, i]
                row[j] -= boxes[k, 1, j]
                row[3 + i] -= 1
                row[3 + j] += 1
                row[6] = 1
                rows.append(row)
    highs = highspy.Highs()
    highs.setOptionValue("output_flag", False)
    inf = highspy.kHighsInf
    for v in range(7):
        low, high = (1, inf) if v < 3 else (-inf, inf) if v < 6 else (-inf, 1)
        highs.addVar(0 if v == 5 else low, 0 if v == 5 else high)
    highs.changeColCost(6, 1.0)
    highs.changeObjectiveSense(highspy.ObjSense.kMaximize)
    for row in rows:
        index = np.nonzero(row)[0].astype(np.int32)
        highs.addRow(-inf, 0.0, len(index), index, row[index])
    highs.run()
    return highs.getInfo().objective_function_value


def judge(boxes, signs):
    """The verdict of `stab`, after its proof has been checked."""
    answer = stab(boxes, signs)
    if answer.verdict is Verdict.VISIBLE:
        assert line_hits(boxes, answer.point, answer.direction, strict=True), (boxes.tolist(), signs)
        assert tuple(np.sign([float(d) for d in answer.direction]).astype(int)) == tuple(signs)
    else:
        assert check_certificate(boxes, signs, answer.certificate), (boxes.tolist(), signs)
        assert answer.certificate.graze == answer.graze
    return answer


@st.composite
def portal_sequences(draw, size=8):
    """Boxes whose edges and corners lie zero to two grid steps off one common line: the razor's edge.

    Yields (boxes, signs, steps): with steps all 0 the line at least touches every box.
    """
    signs = draw(st.sampled_from(OCTANTS))
    offset = draw(st.sampled_from([0, 10**6, 2**23]))
    speed = np.array([draw(st.integers(0, 7)) for _ in range(3)]) * np.array(signs)
    point = np.array([draw(st.integers(-20, 20)) for _ in range(3)]) + offset
    boxes = []
    for _ in range(draw(st.integers(2, size))):
        touch = point + draw(st.integers(0, 40)) * speed
        low = touch - [draw(st.sampled_from([0, 0, 1, 5, 40])) for _ in range(3)]
        high = touch + [draw(st.sampled_from([0, 0, 1, 5, 40])) for _ in range(3)]
        flat = draw(st.integers(-1, 2))
        if flat >= 0:
            low[flat] = high[flat] = touch[flat]
        nudge = np.array([draw(st.sampled_from([0, 0, 0, 1, -1, 2])) for _ in range(3)])
        boxes.append([low + nudge, high + nudge])
    return np.array(boxes, np.int64), signs


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_hard_cases(case):
    answer = judge(case.boxes, case.signs)
    closed = stab_closed(case.boxes, case.signs)
    found = "open" if answer.verdict is Verdict.VISIBLE else "graze" if answer.graze else "parallel"
    if closed.verdict is Verdict.HIDDEN:
        found = "none"
    assert found == case.expected, f"{case.name}: expected {case.expected}, found {found}"


def test_there_are_many_hard_cases():
    assert len(CASES) >= 60
    assert {case.expected for case in CASES} == {"open", "graze", "parallel", "none"}
    assert len({case.name for case in CASES}) == len(CASES)


def test_published_certificate():
    """The vector on which two-dimensional projections pass and the common direction fails."""
    boxes = boxes_of((2, -1, 1), (4, 1, 1), (4, 3, 1), (5, 3, 2), (5, 4, 3), (5, 6, 4), (6, 3, 2), (6, 5, 4))
    certificate = judge(boxes, (1, 1, 1)).certificate
    assert not certificate.graze and len(certificate.cuts) == 2


def test_agrees_with_linear_programme():
    rng = np.random.default_rng(7)
    seen = {Verdict.VISIBLE: 0, Verdict.HIDDEN: 0}
    for _ in range(75):
        n = rng.integers(2, 6)
        low = np.arange(n)[:, None] + rng.integers(0, 4, (n, 3))
        boxes = np.stack([low, low + rng.integers(0, 5, (n, 3))], axis=1)
        flat = rng.integers(0, 3, n)
        boxes[np.arange(n), 1, flat] = boxes[np.arange(n), 0, flat]
        for signs in OCTANTS[:4]:
            answer, margin = judge(boxes, signs), lp_margin(boxes, signs)
            seen[answer.verdict] += 1
            expected = 1 if answer.verdict is Verdict.VISIBLE else 0 if answer.graze else -1
            assert (margin > 1e-7) - (margin < -1e-7) == expected, (boxes.tolist(), signs, margin)
    assert min(seen.values()) > 30


@given(portal_sequences())
def test_every_answer_carries_its_proof(sequence):
    boxes, signs = sequence
    answer, closed = judge(boxes, signs), stab_closed(boxes, signs)
    if closed.verdict is Verdict.VISIBLE:
        assert line_hits(boxes, closed.point, closed.direction, strict=False)
    else:
        assert answer.verdict is Verdict.HIDDEN and not answer.graze


@given(portal_sequences(5), st.permutations(range(3)), st.integers(-(2**24), 2**24))
def test_moving_and_mirroring_change_nothing(sequence, order, shift):
    boxes, signs = sequence
    order = list(order)
    verdict = stab(boxes, signs).verdict
    assert stab(boxes + shift, signs).verdict is verdict
    assert stab(boxes[:, :, order], tuple(signs[o] for o in order)).verdict is verdict
    assert stab(boxes[::-1], tuple(-s for s in signs)).verdict is verdict
    assert stab(np.sort(-boxes, axis=1), tuple(-s for s in signs)).verdict is verdict


@given(portal_sequences(6))
def test_growing_never_hides(sequence):
    boxes, signs = sequence
    if stab_closed(boxes, signs).verdict is Verdict.VISIBLE:
        grown = boxes + np.array([[[-1]], [[1]]]).reshape(1, 2, 1)
        assert stab(grown, signs).verdict is Verdict.VISIBLE


def test_checker_rejects_forged_certificates():
    boxes = boxes_of((0, 0, 0), (0, 1, 1), (2, 0, 0), (2, 1, 1))
    blocked = boxes_of((0, 0, 0), (0, 1, 1), (1, 3, 0), (1, 4, 1), (2, 0, 0), (2, 1, 1))
    signs = (1, 1, 1)
    good = stab(blocked, signs).certificate
    assert check_certificate(blocked, signs, good)
    (i, j, k, m), *rest = good.cuts[0]
    assert not check_certificate(
        blocked, signs, replace(good, cuts=(((i, j, k, 1 - min(m, 1)), *rest), *good.cuts[1:]))
    )
    negative = Certificate(good.cuts, tuple(-weight for weight in good.lambdas))
    open_cycle = Certificate((good.cuts[0][:1],), (1,))
    mixed = Certificate((((0, 1, 0, 1), (1, 0, 1, 0)),), (1,))
    for forged in (negative, open_cycle, mixed, Certificate((), ()), Certificate(good.cuts, (0,) * len(good.cuts))):
        assert not check_certificate(blocked, signs, forged)
    for i, j in ((0, 1), (1, 2), (0, 2)):
        for k, m in product(range(2), repeat=2):
            assert not check_certificate(boxes, signs, Certificate((((i, j, k, k), (j, i, m, m)),), (1,)))


def test_a_certificate_of_one_list_proves_nothing_of_another():
    """Of lists that a line passes, and of octants in which one does: each proof of a neighbour is refused there."""
    rng, refused, octants = np.random.default_rng(3), 0, 0
    for _ in range(150):
        n = int(rng.integers(2, 6))
        low = np.arange(n)[:, None] * rng.integers(0, 2, 3) + rng.integers(0, 4, (n, 3))
        boxes = np.stack([low, low + rng.integers(0, 4, (n, 3))], axis=1)
        proofs = [stab(boxes, signs).certificate for signs in OCTANTS]
        others = [boxes] + [boxes + rng.integers(0, 2, boxes.shape) * [[[-1], [1]]] for _ in range(4)]
        for other in others:
            seen = [signs for signs in OCTANTS if stab(other, signs).verdict is Verdict.VISIBLE]
            for signs, proof in product(seen, filter(None, proofs)):
                assert not check_certificate(other, signs, proof), (other.tolist(), signs, proof)
                refused += 1
                octants += other is boxes
    assert refused > 1000 and octants > 100


@pytest.mark.parametrize("signs", [(1, 1, 1), (1, -1, 1), (-1, -1, -1)])
def test_no_certificate_hides_what_a_line_passes(signs):
    """Every cycle of one or two arcs, many of three and many pairs of cycles, whether or not they close."""
    rng = np.random.default_rng(5)
    arcs = list(product(range(3), range(3), range(2), range(2)))
    cycles = [*((arc,) for arc in arcs), *product(arcs, arcs)]
    cycles += [tuple(arcs[n] for n in rng.integers(0, len(arcs), 3)) for _ in range(2000)]
    orders = [(0, 1), (0, 2), (1, 2), (0, 1, 2), (0, 2, 1)]
    closed = [
        tuple((order[n], order[(n + 1) % len(order)], k, k) for n, k in enumerate(held))
        for order in orders
        for held in product(range(2), repeat=len(order))
    ]
    for shift in product((-40, 40), repeat=3):
        # A cell and a portal beyond it; where they are decides what a cycle that is open says.
        boxes = boxes_of((0, 0, 0), (2, 2, 2), (5, 4, 3), (5, 6, 6)) + shift
        boxes = np.sort(boxes * np.array(signs), axis=1)
        assert stab(boxes, signs).verdict is Verdict.VISIBLE
        for cycle, weight in product(cycles, (1, -1)):
            assert not check_certificate(boxes, signs, Certificate((cycle,), (weight,)))
            assert not check_certificate(boxes, signs, Certificate((cycle,), (weight,), graze=True))
        for pair, weights in product(combinations(closed, 2), product((-1, 0, 1, 2), repeat=2)):
            assert not check_certificate(boxes, signs, Certificate(pair, weights, graze=not any(weights)))


@given(portal_sequences())
def test_a_certificate_does_not_confuse_grazing_with_missing(sequence):
    boxes, signs = sequence
    if proof := stab(boxes, signs).certificate:
        assert not check_certificate(boxes, signs, replace(proof, graze=not proof.graze))


@pytest.mark.parametrize(
    ("boxes", "signs"),
    [
        (np.zeros((2, 3, 2), int), (1, 1, 1)),
        (np.zeros((0, 2, 3), int), (1, 1, 1)),
        (np.zeros((1, 2, 3)), (1, 1, 1)),
        (np.zeros((1, 2, 3), int), (1, 0, 1)),
        (np.array([[[1, 0, 0], [0, 0, 0]]]), (1, 1, 1)),
    ],
)
def test_bad_input_is_one_line(boxes, signs):
    with pytest.raises(InputError, match=r"expected .* found [^\n]*$"):
        stab(boxes, signs)
