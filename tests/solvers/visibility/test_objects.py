"""Cell-to-object rows: objects of reached cells, hidden only where no line reaches them, witnesses that end on them."""

import numpy as np
import pytest
from builders import small_house
from viewcell.data.incidence import populate
from viewcell.data.prepared import PreparedModel
from viewcell.data.scene import OPAQUE
from viewcell.kernels.launch import CPU
from viewcell.solvers.visibility.aim import Sights
from viewcell.solvers.visibility.cells import CellModel, cell_rows
from viewcell.solvers.visibility.objects import object_rows
from viewcell.verify.exact.sightline import Sight, Sightlines


@pytest.fixture(scope="module")
def house():
    scene, graph = small_house.small_scene(), small_house.small_graph()
    model = PreparedModel(scene)
    cell_model = CellModel(graph, model.blockers(graph), Sights.of(model, graph.cells, 0, CPU))
    return cell_model, scene, populate(scene, graph.cells)


@pytest.fixture(scope="module")
def reached(house):
    return cell_rows(house[0], np.flatnonzero(house[0].graph.inhabitable))


def pairs_of(rows):
    return set(zip(rows.source.tolist(), rows.target.tolist(), strict=True))


def test_hidden_is_at_most_what_the_exact_search_hides(house, reached, tmp_path):
    """The exact sets clip objects to cells by their boxes; ours by their triangles, so they may be smaller."""
    model, _, incidence = house
    rows = object_rows(model, incidence, reached)
    exact = small_house.small_house(tmp_path).potential_objects
    found = np.zeros_like(exact)
    found[rows.source, rows.target] = True
    assert not (found & ~exact).any() and found.sum() > 0.8 * exact.sum()
    seen = np.zeros_like(exact)
    seen[rows.source[rows.seen], rows.target[rows.seen]] = True
    assert seen.sum() > 0.9 * found.sum()


def test_witnesses_start_in_the_cell_and_meet_the_object_first(house, reached):
    model, scene, incidence = house
    rows = object_rows(model, incidence, reached)
    rows = rows.take(rows.seen)
    cells = model.graph.cells[rows.source]
    assert ((rows.origin > cells[:, 0]) & (rows.origin < cells[:, 1])).all()
    triangles, owners = scene.triangles(*OPAQUE)
    for target in np.unique(rows.target):
        mine = np.flatnonzero(rows.target == target)
        others = Sightlines(triangles[owners != target], owners[owners != target])
        assert (others.check(rows.origin[mine], rows.end[mine]) == Sight.CLEAR).all()
        low, high = scene.object_bounds()[target]
        assert ((rows.end[mine] >= low - 1e-3) & (rows.end[mine] <= high + 1e-3)).all()


def test_only_what_is_in_reached_cells_is_asked_about(house, reached):
    model, _, incidence = house
    for source in np.unique(reached.source):
        one = reached.take(reached.source == source)
        held = {
            int(o)
            for cell in one.target
            for o in incidence.object_id[incidence.starts[cell] : incidence.starts[cell + 1]]
        }
        assert {target for _, target in pairs_of(object_rows(model, incidence, one))} <= held
        own = one.take(one.target == source)
        assert {target for _, target in pairs_of(object_rows(model, incidence, own))} == {
            int(o) for o in incidence.object_id[incidence.cell == source]
        }, "nothing hides a cell's own objects from it"


def test_without_aim_the_same_is_potential(house, reached):
    model, _, incidence = house
    aimed, quick = object_rows(model, incidence, reached), object_rows(model, incidence, reached, ())
    assert pairs_of(aimed) == pairs_of(quick)
    assert quick.seen.sum() <= aimed.seen.sum()


def test_sources_do_not_depend_on_their_company(house, reached):
    model, _, incidence = house
    together = object_rows(model, incidence, reached)
    for source in np.unique(reached.source):
        alone = object_rows(model, incidence, reached.take(reached.source == source))
        mine = together.take(together.source == source)
        for name in ("source", "target", "verdict", "origin", "end"):
            np.testing.assert_array_equal(getattr(alone, name), getattr(mine, name), err_msg=name)


def test_the_longest_round_is_left_to_who_goes_on(house, reached):
    """With all cells handed on it is not shot, with none it is; the rows say what was seen till then."""
    model, _, incidence = house
    rounds, told = (2, 0, 900), []

    def handed_on(rows, answer):
        told.append(rows)
        return np.full(model.graph.cell_count, answer)

    left, kept = (
        object_rows(model, incidence, reached, rounds, lambda rows, answer=answer: handed_on(rows, answer))
        for answer in (True, False)
    )
    short, full = object_rows(model, incidence, reached, rounds[:2]), object_rows(model, incidence, reached, rounds)
    assert np.array_equal(left.seen, short.seen) and np.array_equal(kept.seen, full.seen)
    assert pairs_of(left) == pairs_of(full) and full.seen.sum() > short.seen.sum()
    assert len(told) == 2 and all(np.array_equal(rows.seen, short.seen) for rows in told)
