"""Judges of a walk's frames see what is wrong."""

import numpy as np
from viewcell.workbench.bench.rows import frames as rows


def test_judges_see_what_is_wrong():
    (case,) = rows.eye_cases(4, rows.CPU)
    found = case.work()
    right = case.judge(found)
    assert right.wrong_hidden == 0 and right.overestimate >= 1
    found.objects[: found.starts[1]] = rows.OBJECTS
    assert case.judge(found).wrong_hidden > 0
    (case,) = rows.lookahead_cases(4, rows.CPU)
    found = case.work()
    assert case.judge(found).error == 0
    found[0] = (found[0][0], found[0][1] + 0.5)
    assert case.judge(found).error == 0.5
    found[0] = (found[0][0][1:], found[0][1][1:])
    assert case.judge(found).error == np.inf
    (case,) = rows.reads_cases(4, rows.CPU)
    found = case.work()
    assert case.judge(found).error == 0
    found[0] = found[0][::-1]
    assert case.judge(found).error == 0.25
