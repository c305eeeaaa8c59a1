"""A setting that hides what is visible is found, by the sightlines of others and by rays."""

from dataclasses import replace

import numpy as np
import pytest
from builders.furnished_rooms import furnished_rooms
from viewcell.kernels.launch import Device
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.tune.safety import hidden_by_rays, hidden_of, holders
from viewcell.workbench.tune.trial import run_trial


@pytest.fixture(scope="module")
def answers():
    scene, where = furnished_rooms(), Device(threads=1)
    return [run_trial(scene, settings, where).answer for settings in (Settings(), Settings(largest_cell=1.0))]


def without(answer, row):
    """The answer that hides one more pair."""
    return replace(answer, objects=answer.objects.take(np.arange(len(answer.objects)) != row))


def test_honest_answers_stand(answers):
    assert [hidden_of(answer, answers) for answer in answers] == [0, 0]
    assert [hidden_by_rays(answer, 2_000, 0) for answer in answers] == [0, 0]


def test_a_hidden_pair_is_found_by_sightlines_whatever_the_cells(answers):
    whole, cut = answers
    row = np.flatnonzero(whole.objects.seen)[7]
    assert hidden_of(without(whole, row), [whole]) == 1
    # A sightline from any part of the cell shows it, too; one of the cell shows what the part that it starts in hides.
    assert hidden_of(without(whole, row), [cut]) == 1
    seen = whole.objects.take(whole.objects.seen)
    place, cell = holders(cut.graph, seen.origin[7:8])
    hit = np.flatnonzero((cut.objects.source == cell[0]) & (cut.objects.target == seen.target[7]))
    assert place.tolist() == [0] and hidden_of(without(cut, hit[0]), [whole]) == 1


def test_a_hidden_pair_is_found_by_rays(answers):
    whole = answers[0]
    nothing = replace(whole, objects=whole.objects.take(np.zeros(0, int)))
    assert hidden_by_rays(nothing, 2_000, 0) > 10


def test_points_on_a_border_are_in_no_cell(answers):
    graph = answers[0].graph
    cell = np.flatnonzero(graph.inhabitable)[0]
    low, high = graph.cells[cell].astype(float)
    points = np.array([(low + high) / 2, low, [low[0], *((low + high) / 2)[1:]]])
    assert [pair.tolist() for pair in holders(graph, points)] == [[0], [cell]]
