"""Laws that any potentially visible set obeys, on our own bakes; and each broken by a kernel broken on purpose.

`seen` has witnesses and `potential` leaves out only what is proved hidden, so between two bakes of which one can see no
less than the other, seen(less) is in potential(more); where every verdict is exact, as in bare graphs, sets are equal.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import viewcell
from hypothesis import HealthCheck, Phase, assume, given, settings
from viewcell.data import frame
from viewcell.data.errors import InputError
from viewcell.data.graph import OTHER_AXES
from viewcell.data.scene import GRID_M, Definition, Instance, Mesh, Role, Scene
from viewcell.data.store.bake_folder import cells_table, portals_table
from viewcell.data.verdict import Verdict
from viewcell.kernels.launch import CPU
from viewcell.kernels.select import launch_select
from viewcell.kernels.stab_batch import launch_stab
from viewcell.solvers.visibility import graph_engine, occluders
from viewcell.solvers.visibility.cells import join_cell_rows
from viewcell.verify.exact.region import region_visible
from viewcell.verify.exact.select import best_by_table
from viewcell.verify.exact.stab import stab
from viewcell.verify.strategies import MODULE, buildings, knapsacks, occluded_pairs, portal_sequences
from viewcell.workbench.bake import cells as baked_cells
from viewcell.workbench.bake.settings import Settings

# Up to a quarter turn: further, another side of the building lies along each axis.
YAWS_DEG = (17.0, 5.0, -30.0, 45.0, 0.5)
BAKES = settings(max_examples=6, deadline=None, suppress_health_check=list(HealthCheck))
# A law is broken on the same examples every time, and it is enough to see that it is.
BROKEN = settings(
    max_examples=200,
    database=None,
    derandomize=True,
    deadline=None,
    report_multiple_bugs=False,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)


def baked(model, **options):
    """A bake in a folder of its own, with its tables read."""
    with tempfile.TemporaryDirectory() as folder:
        if not isinstance(model, Scene):
            path = Path(folder) / "graph"
            path.mkdir()
            pq.write_table(cells_table(model, GRID_M), path / "cells.parquet")
            pq.write_table(portals_table(model, GRID_M), path / "portals.parquet")
            model = path
        if "cells" in options:
            path = Path(folder) / "cells.parquet"
            pq.write_table(pa.table(options["cells"]), path)
            options["cells"] = str(path)
        made = viewcell.bake(model, Path(folder) / "made.bake", settings=Settings(**options), threads=1)
        _ = made.potential_objects, made.potential_cells, made.cell_to_object, made.cell_to_cell
    return made


def seen(made, kind="object"):
    """Pairs with a witness, shape (cells, targets), bool."""
    table, target = (made.cell_to_object, "object_id") if kind == "object" else (made.cell_to_cell, "reached_cell_id")
    matrix = np.zeros_like(made.potential_objects if kind == "object" else made.potential_cells)
    rows = np.array([verdict == "visible" for verdict in table["verdict"].to_pylist()], bool)
    matrix[table["cell_id"].to_numpy()[rows], table[target].to_numpy()[rows]] = True
    return matrix


def by_occluders(building):
    return baked(building.scene, method="occluders", cells=building.view_cells)


def moved_graph(graph, turn):
    """A graph whose boxes are moved by a function of corners, shape (n, 3); sides are put in order again."""

    def boxes(corners):
        ends = np.stack([turn(corners[:, 0]), turn(corners[:, 1])], axis=1)
        return np.sort(ends, axis=1).astype(np.int32)

    cells, portals = boxes(graph.cells), boxes(graph.portals)
    axis = (portals[:, 0] == portals[:, 1]).argmax(axis=1).astype(np.int8)
    row = np.arange(len(axis))
    forward = cells[graph.portal_cells[:, 0], 1, axis] == portals[row, 0, axis]
    ends = np.where(forward[:, None], graph.portal_cells, graph.portal_cells[:, ::-1])
    return replace(graph, cells=cells, portals=portals, portal_axis=axis, portal_cells=ends)


MOVES = {
    "shift": lambda points: points + np.array([64, -320, 17]),
    "mirror": lambda points: points * [-1, 1, 1],
    "quarter turn": lambda points: points[:, [1, 0, 2]] * [-1, 1, 1],
    "permutation": lambda points: points[:, [2, 0, 1]],
}


def stabs_exactly(sequence, launch):
    """The kernel is right or withholds."""
    truth = stab(sequence.array(), sequence.signs).verdict
    found = launch(sequence.array()[None].astype(np.int32), np.array([sequence.signs])).verdict[0]
    assert found != Verdict.HIDDEN or truth is Verdict.HIDDEN
    assert found != Verdict.VISIBLE or truth is Verdict.VISIBLE


def law_stabbing_is_exact(sequence):
    """The kernel against its twin."""
    stabs_exactly(sequence, launch_stab)


def law_motion_changes_nothing(building):
    """Shift, mirror, quarter turn and permutation of axes, on bare graphs, where what is hidden is decided exactly.

    A sightline is found by aiming at random, so that of what is seen through slits of 1 grid unit each bake may
    withhold another part; but what one of them sees is potential in all.
    """
    graph = building.graph()
    assume(graph.portal_count)
    truth = baked(graph)
    for name, turn in MOVES.items():
        moved = baked(moved_graph(graph, turn))
        assert np.array_equal(moved.potential_cells, truth.potential_cells), name
        assert not (seen(moved, "cell") & ~truth.potential_cells).any(), name


def law_a_shift_changes_nothing(building):
    """Of a model: the same sets to the last pair."""
    objects = [replace(o, transform=o.transform.copy()) for o in building.scene.objects]
    for placed in objects:
        placed.transform[:3, 3] += np.array([64, -320, 17]) * GRID_M
    cells = {name: list(values) for name, values in building.view_cells.items()}
    for axis, step in zip("xyz", (64, -320, 17), strict=True):
        for side in ("min", "max"):
            cells[f"{side}_{axis}"] = [value + step * GRID_M for value in cells[f"{side}_{axis}"]]
    scene = replace(building.scene, objects=objects, spaces=[])
    truth, moved = by_occluders(building), baked(scene, method="occluders", cells=cells)
    assert np.array_equal(truth.potential_objects, moved.potential_objects)


def law_a_turn_changes_nothing(building):
    """Of a model: it is turned back before it is snapped, and is then the same model, witnesses included."""
    truth, turned = baked(replace(building, yaw_deg=0.0).scene), baked(building.scene)
    assert turned.manifest["yaw_deg"] == building.yaw_deg and truth.manifest["yaw_deg"] == 0.0
    assert turned.cell_to_object.equals(truth.cell_to_object)
    assert turned.cell_to_cell.equals(truth.cell_to_cell)


def law_a_wing_sees_itself_as_if_it_were_alone(building):
    """What the first of several wings sees of itself is the same, whether it ends in the open or in a foyer.

    It is convex and the others lie outside, so that no line between two points of it meets them. Through an end without
    a passage nothing of the others shows.
    """
    assume(building.wings > 1)
    scene, rooms = building.scene, int(np.prod(building.rooms))
    own = [number for number, placed in enumerate(scene.objects) if placed.name.startswith("A ")]
    cells = {name: values[:rooms] for name, values in building.view_cells.items()}
    alone = replace(scene, objects=[scene.objects[number] for number in own], spaces=[])
    joined, single = (baked(model, method="occluders", cells=cells) for model in (scene, alone))
    assert not (seen(joined)[:, own] & ~single.potential_objects).any()
    assert not (seen(single) & ~joined.potential_objects[:, own]).any()
    if not any(door.axis == 0 and door.room[0] == building.rooms[0] - 1 for door in building.doors):
        assert not np.delete(seen(joined), own, axis=1).any()


def law_a_mirror_reveals_nothing(building):
    """Of a model: what is seen in one is potential in the other."""
    mirrored = [replace(o, transform=np.diag([-1.0, 1, 1, 1]) @ o.transform) for o in building.scene.objects]
    shapes = [
        Definition(d.name, tuple(Mesh(m.vertices, m.faces[:, ::-1], m.error_m) for m in d.lods))
        for d in building.scene.definitions
    ]
    scene = replace(building.scene, objects=mirrored, definitions=shapes, spaces=[])
    cells = building.view_cells | {
        "min_x": [-value for value in building.view_cells["max_x"]],
        "max_x": [-value for value in building.view_cells["min_x"]],
    }
    truth, moved = by_occluders(building), baked(scene, method="occluders", cells=cells)
    assert not (seen(truth) & ~moved.potential_objects).any()
    assert not (seen(moved) & ~truth.potential_objects).any()


def law_sight_is_mutual(building):
    """A sees B exactly when B sees A."""
    graph = building.graph()
    assume(graph.portal_count)
    made = baked(graph)
    assert np.array_equal(made.potential_cells, made.potential_cells.T)
    assert np.array_equal(seen(made, "cell"), seen(made, "cell").T)


def law_an_occluder_reveals_nothing(building):
    """With a piece of furniture less, or a door less, nothing that was seen is hidden."""
    assume(building.furniture or building.doors)
    if building.furniture:
        fewer = replace(building, furniture=building.furniture[:-1])
        more, less = by_occluders(fewer), by_occluders(building)
        kept = len(fewer.scene.objects)
        assert not (seen(less)[:, :kept] & ~more.potential_objects).any()
    if building.doors:
        whole, walled = building.graph(), replace(building, doors=building.doors[:-1]).graph()
        rooms = int(np.prod(building.rooms))
        more, less = baked(whole).potential_cells, baked(walled).potential_cells
        assert not (less[:rooms, :rooms] & ~more[:rooms, :rooms]).any()


def law_cells_and_their_parts_agree(building):
    """A smaller cell sees no more; the parts of a cell see together what the cell sees."""
    cells = building.view_cells
    count = len(cells["cell_id"])
    middle = [(low + high) / 2 for low, high in zip(cells["min_x"], cells["max_x"], strict=True)]
    parts = {name: list(values) * 2 for name, values in cells.items()} | {
        "cell_id": list(range(2 * count)),
        "min_x": cells["min_x"] + middle,
        "max_x": middle + cells["max_x"],
    }
    whole, halves = by_occluders(building), baked(building.scene, method="occluders", cells=parts)
    together = halves.potential_objects[:count] | halves.potential_objects[count:]
    witnessed = seen(halves)[:count] | seen(halves)[count:]
    assert not (seen(whole) & ~together).any()
    assert not (witnessed & ~whole.potential_objects).any()


def law_levels_of_detail_change_nothing(building):
    """Coarser levels beside the finest one, however wrong, leave every verdict as it was."""
    shapes = [
        Definition(d.name, (*d.lods, Mesh(d.lods[0].vertices * 1.5, d.lods[0].faces[::3], 0.5)))
        for d in building.scene.definitions
    ]
    truth, made = (
        baked(scene, method="occluders", cells=building.view_cells)
        for scene in (building.scene, replace(building.scene, definitions=shapes))
    )
    assert made.cell_to_object.equals(truth.cell_to_object)


def law_polygons_hide_only_what_is_hidden(pair):
    """A bake of polygons against the exact answer."""
    parts = [pair.target, *pair.occluders]
    shapes, objects = [], []
    for number, corners in enumerate(parts):
        mesh = Mesh(np.array(corners) * GRID_M, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
        shapes.append(Definition(f"polygon {number}", (mesh,)))
        objects.append(Instance(f"polygon {number}", "polygon", number, np.eye(4), Role.OCCLUDER))
    names = [f"{side}_{axis}" for side in ("min", "max") for axis in "xyz"]
    cells = dict(zip(names, ([c * GRID_M] for corner in pair.cell for c in corner), strict=True))
    made = baked(Scene(shapes, objects), method="occluders", cells=cells)
    truth = region_visible(pair.cell, pair.target, pair.occluders).verdict
    assert made.potential_objects[0, 0] or truth is not Verdict.VISIBLE
    assert not seen(made)[0, 0] or truth is not Verdict.HIDDEN


def spends_well(sack, launch=launch_select):
    """A selection keeps to its budget, gains at least half of what the table's gains, and its bound is none too low."""
    starts = np.cumsum([0, *map(len, sack.costs)])
    rows = np.array([[b for group in sack.benefits for b in group]], float), np.concatenate(sack.costs).astype(int)
    best = best_by_table(sack.benefits, sack.costs, sack.budget)
    cheapest = sum(
        max((-c, b) for b, c in zip(*group, strict=True))[1] for group in zip(sack.benefits, sack.costs, strict=True)
    )
    for improve in (True, False):
        found = launch(*rows, starts, sack.budget, improve=improve)
        assert found.feasible[0] == (best is not None)
        if best is not None:
            chosen = found.choice[0].tolist()
            assert found.cost[0] == sum(group[k] for group, k in zip(sack.costs, chosen, strict=True)) <= sack.budget
            value = sum(group[k] for group, k in zip(sack.benefits, chosen, strict=True))
            assert found.value[0] == value <= best.value <= found.bound[0]
            assert 2 * (value - cheapest) >= best.value - cheapest


def law_a_budget_is_spent_well(sack):
    """The kernel against the table."""
    spends_well(sack)


LAWS = {
    law_stabbing_is_exact: portal_sequences(),
    law_motion_changes_nothing: buildings(columns=3, rows=2, furniture=0),
    law_a_shift_changes_nothing: buildings(columns=2, rows=2),
    law_a_turn_changes_nothing: buildings(columns=2, rows=2, yaw=YAWS_DEG),
    law_a_wing_sees_itself_as_if_it_were_alone: buildings(columns=2, rows=1, wings=3),
    law_a_mirror_reveals_nothing: buildings(columns=2, rows=2),
    law_sight_is_mutual: buildings(columns=3, rows=2, storeys=2, furniture=0),
    law_an_occluder_reveals_nothing: buildings(columns=3, rows=1),
    law_cells_and_their_parts_agree: buildings(columns=2, rows=2),
    law_levels_of_detail_change_nothing: buildings(columns=2, rows=1),
    law_polygons_hide_only_what_is_hidden: occluded_pairs(size=7_900),
    law_a_budget_is_spent_well: knapsacks(),
}
QUICK = {
    law_stabbing_is_exact: 300,
    law_a_budget_is_spent_well: 60,
    law_polygons_hide_only_what_is_hidden: 25,
    # Of the largest buildings.
    law_a_turn_changes_nothing: 4,
    law_a_wing_sees_itself_as_if_it_were_alone: 2,
}


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_law(law):
    settings(BAKES, max_examples=QUICK.get(law, BAKES.max_examples))(given(LAWS[law])(law))()


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_law_on_many_examples(law):
    settings(BAKES, max_examples=10 * max(6, QUICK.get(law, 6)))(given(LAWS[law])(law))()


def epsilon_stab(boxes, signs):
    """Boxes a step smaller on each side: an epsilon, as many bakers have one."""
    size = boxes[:, :, 1] - boxes[:, :, 0]
    inset = np.where(size > 2, 1, 0)
    return launch_stab(np.stack([boxes[:, :, 0] + inset, boxes[:, :, 1] - inset], axis=2).astype(np.int32), signs)


def forward_join(model, parts, original=join_cell_rows):
    """Keeps the lines that lead forward only: a line was not thought of as one that can be followed back."""
    rows = original(model, parts)
    return rows.take(rows.end[:, 0] >= rows.origin[:, 0])


def grown_tree(blockers, device=CPU, original=occluders.blocker_tree, by=40):
    """Blockers that reach further than their surface: a "conservative" rasterisation on the wrong side."""
    boxes = blockers.boxes.copy()
    for axis in range(3):
        part = blockers.axis != axis
        boxes[part, 0, axis] -= by
        boxes[part, 1, axis] += by
    return original(replace(blockers, boxes=boxes), device)


def one_sided_tree(blockers, device=CPU, original=occluders.blocker_tree):
    """Blockers that reach too far towards larger x alone, by half a module."""
    boxes = blockers.boxes.copy()
    boxes[blockers.axis != 0, 1, 0] += MODULE // 2
    return original(replace(blockers, boxes=boxes), device)


def anchored_tree(blockers, device=CPU, original=occluders.blocker_tree):
    """Blockers on even planes only: an answer that depends on where the model lies."""
    keep = blockers.boxes[np.arange(len(blockers.axis)), 0, blockers.axis] % 128 == 64
    boxes = np.where(keep[:, None, None], blockers.boxes, 0)
    return original(replace(blockers, boxes=boxes), device)


def askew(points, yaw_deg, original=frame.turned):
    """A turn that is short by a thousandth."""
    return original(points, yaw_deg * 0.999)


def lost_remainder(tree, boxes, rows, original=occluders.launch_target_search, **options):
    """The last batch of eight, if it is not full, is never looked at."""
    answers = original(tree, boxes, rows, **options)
    verdict = answers.verdict.copy()
    verdict[len(rows) // 8 * 8 :] = Verdict.HIDDEN
    return replace(answers, verdict=verdict)


def half_portals(folder, original=baked_cells.read_graph, **options):
    """Portals of half their width: the same portal is another one in a mirror."""
    graph, moved = original(folder, **options)
    portals, row = graph.portals.copy(), np.arange(graph.portal_count)
    across = OTHER_AXES[graph.portal_axis][:, 0]
    portals[row, 1, across] -= (portals[row, 1, across] - portals[row, 0, across]) // 2
    return replace(graph, portals=portals), moved


def from_the_middle(tree, boxes, rows, original=occluders.launch_target_search, **options):
    """Looks from the middle of each view cell, as from a point."""
    boxes = boxes.copy()
    cells = np.unique(rows[:, 0])
    size = boxes[cells, 1] - boxes[cells, 0]
    boxes[cells, 0] += size * 9 // 20
    boxes[cells, 1] -= size * 9 // 20
    return original(tree, boxes, rows, **options)


def coarsest_triangles(self, *roles, original=Scene.triangles):
    """Triangles of the last level instead of the first."""
    shapes = [replace(shape, lods=shape.lods[::-1]) for shape in self.definitions]
    return original(replace(self, definitions=shapes), *roles)


def miserly(benefits, costs, starts, budget, **options):
    """A third of the budget is kept back."""
    return launch_select(benefits, costs, starts, budget - budget // 3, **options)


def generous(benefits, costs, starts, budget, **options):
    """One more than the budget is spent."""
    return launch_select(benefits, costs, starts, budget + 1, **options)


def sure(*arguments, **options):
    """What was found is called the best."""
    found = launch_select(*arguments, **options)
    return replace(found, bound=found.value)


BREAKS = {
    law_motion_changes_nothing: (baked_cells, "read_graph", half_portals),
    law_a_shift_changes_nothing: (occluders, "blocker_tree", anchored_tree),
    law_a_turn_changes_nothing: (frame, "turned", askew),
    law_a_wing_sees_itself_as_if_it_were_alone: (occluders, "launch_target_search", lost_remainder),
    law_a_mirror_reveals_nothing: (occluders, "blocker_tree", one_sided_tree),
    law_sight_is_mutual: (graph_engine, "join_cell_rows", forward_join),
    law_an_occluder_reveals_nothing: (occluders, "launch_target_search", lost_remainder),
    law_cells_and_their_parts_agree: (occluders, "launch_target_search", from_the_middle),
    law_levels_of_detail_change_nothing: (Scene, "triangles", coarsest_triangles),
    law_polygons_hide_only_what_is_hidden: (occluders, "blocker_tree", grown_tree),
}


# It takes many buildings until a mirror shows what is wrong.
SELDOM_BROKEN = {law_a_mirror_reveals_nothing}


@pytest.mark.parametrize(
    "law",
    [pytest.param(law, marks=[pytest.mark.slow] if law in SELDOM_BROKEN else []) for law in BREAKS],
    ids=lambda law: law.__name__,
)
def test_law_is_broken_by_a_broken_kernel(law, monkeypatch):
    where, name, broken = BREAKS[law]
    monkeypatch.setattr(where, name, broken)
    # What is broken may also come to numbers that are refused.
    with pytest.raises((AssertionError, InputError)):
        BROKEN(given(LAWS[law])(law))()


def test_stabbing_with_an_epsilon_is_not_exact():
    with pytest.raises(AssertionError):
        BROKEN(given(portal_sequences())(lambda sequence: stabs_exactly(sequence, epsilon_stab)))()


@pytest.mark.parametrize("launch", [miserly, generous, sure])
def test_a_budget_spent_badly_is_noticed(launch):
    with pytest.raises(AssertionError):
        BROKEN(given(knapsacks())(lambda sack: spends_well(sack, launch)))()
