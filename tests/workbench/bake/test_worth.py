"""What a bake says of its own worth: a bake that culls nothing looks like one, and a good one does not."""

import json
from dataclasses import replace

import numpy as np
import pytest
import viewcell
from builders import corridors, random_solids
from builders.clocks import Clock
from builders.random_buildings import box_triangles as box
from builders.random_buildings import scene_of
from viewcell.data.progress import Phase
from viewcell.data.scene import Role, Space
from viewcell.data.view_cells import as_graph
from viewcell.solvers.visibility.view_cell_engine import ViewCellEngine
from viewcell.workbench.bake import worth as told
from viewcell.workbench.bake.budget import PROBE
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.bake.worth import told_worth, worth
from viewcell.workbench.summary import summary

NOTHING = (np.zeros(0, int), np.zeros(0, int))
M = 1024


@pytest.fixture(scope="module")
def office():
    return viewcell.make_office(floors=1, rooms_per_side=2)


@pytest.fixture(scope="module")
def shell():
    return viewcell.make_office(floors=1, rooms_per_side=2, furnished=False)


def over_everything(scene, folder):
    """A table with one view cell over the whole model."""
    low, high = scene.bounds() * scene.grid_m + scene.origin
    path = folder / "one.csv"
    path.write_text(f"min_x,min_y,min_z,max_x,max_y,max_z\n{','.join(map(str, [*low, *high]))}\n")
    return path


def test_one_cell_over_everything_warns(office, tmp_path):
    """It is never wrong, and nearly all of it is seen: potential / seen says nothing, the share kept all."""
    settings = Settings(method="occluders", cells=str(over_everything(office, tmp_path)))
    made = viewcell.bake(office, tmp_path / "one", settings=settings)
    kept, (warning,) = made.manifest["kept"], made.manifest["warnings"]
    assert len(made.potential(0)) < 1.3 * len(made.seen(0)) and kept["objects"] == len(made.potential(0)) / 232 > 0.9
    assert kept["eye"]["median"] == kept["eye"]["worst"] > 3
    assert warning.startswith("a view cell keeps ") and "smaller view cells keep less" in warning
    assert f"warning: {warning}" in summary(made).splitlines()
    viewcell.report(made, out=tmp_path / "report")
    assert warning in (tmp_path / "report" / "report.html").read_text()


def test_a_good_bake_does_not_warn(office, tmp_path):
    made = viewcell.bake(office, tmp_path / "office")
    kept, facts = made.manifest["kept"], made.manifest
    assert facts["warnings"] == [] and facts["uncovered_rooms"] == [] and "budget" not in facts
    objects, _ = made.kept()
    volumes = np.prod(np.diff(made.graph.cells[made.graph.inhabitable], axis=1)[:, 0].astype(float), axis=1)
    share = objects[made.graph.inhabitable]
    assert kept["objects"] == pytest.approx((share * volumes).sum() / volumes.sum(), abs=1e-6)
    assert 0.1 < kept["objects"] < 0.5 and 1 < kept["eye"]["median"] < kept["eye"]["worst"] < 10
    assert "warning" not in summary(made) and told_worth(made) == (kept, [])
    json.dumps(facts)


def test_a_budget_that_ends_early_is_told(office, tmp_path):
    """Nothing was measured of the first; the second knows how long cells take, and what it advises is enough."""
    facts = viewcell.bake(office, tmp_path / "a", budget_s=1e-6).manifest
    kept, budget = facts["warnings"]
    assert kept.startswith("a view cell keeps 100 % of the objects") and "the budget ended early" in kept
    pairs = facts["counts"]["cell_pairs"] + facts["counts"]["object_pairs"]
    assert f"while all that hides was prepared: {pairs:,} pairs of" in budget and "give it more" in budget
    assert facts["budget"] | {"pairs": 0} == {
        "budget_s": 1e-6, "phase": "preparing", "pairs": 0, "cells": facts["counts"]["inhabitable"], "needed_s": None,
        "minute": None,
    }  # fmt: skip


def test_a_budget_that_ends_in_the_middle_advises_one_that_is_enough(shell, tmp_path, monkeypatch):
    """Every cell takes a second, and with witnesses two: as guessed, and as measured of the first."""
    clock = Clock(monkeypatch, {False: 1.0, True: 2.0})
    facts = viewcell.bake(shell, tmp_path / "a", threads=1, budget_s=2.5).manifest
    count = facts["counts"]["inhabitable"]
    needed = 1.0 * PROBE + 2.0 * (PROBE + count)
    assert clock.calls == [False] * 2
    assert facts["budget"] | {"pairs": 0} == {
        "budget_s": 2.5, "phase": "hiding", "cells": count, "pairs": 0, "needed_s": needed,
        "minute": count,
    }  # fmt: skip
    facts = viewcell.bake(shell, tmp_path / "b", threads=1, budget_s=count + 6.5).manifest
    assert clock.calls[2:] == [False, True] + [False] * count + [True]
    assert facts["budget"]["phase"] == "witnesses" and facts["budget"]["cells"] == count - 1
    assert facts["budget"]["needed_s"] == needed - 2.0
    assert 0 < facts["budget"]["pairs"] < facts["counts"]["cell_pairs"] + facts["counts"]["object_pairs"]
    advised = float(facts["warnings"][-1].partition("--budget ")[2].partition(" ")[0])
    assert needed - 2.0 < advised < 1.4 * needed
    clock.calls.clear()
    assert viewcell.bake(shell, tmp_path / "c", threads=1, budget_s=advised).manifest["budget_spent"] is False
    assert clock.calls == [False, True] + [True] * count


def test_another_minute_is_told(shell, tmp_path, monkeypatch):
    """Twenty seconds a cell, and as guessed twice as many with witnesses."""
    Clock(monkeypatch, {False: 20.0, True: 40.0})
    facts = viewcell.bake(shell, tmp_path / "a", threads=1, budget_s=25.0).manifest
    assert facts["budget"]["minute"] == 1
    assert "left undecided, and kept; another minute finishes about 1 of those, --budget " in facts["warnings"][-1]


def test_progress_tells_what_is_kept(shell, tmp_path, monkeypatch):
    notes = []
    monkeypatch.setattr(Phase, "update", lambda phase, more=1: notes.append(phase.note))
    made = viewcell.bake(shell, tmp_path / "a")
    kept = made.potential_objects[made.graph.inhabitable]
    unknown = 1 - made.manifest["counts"]["object_pairs_seen"] / kept.sum()
    last = [note for note in notes if note][-1]
    assert last == f"{kept.mean():.0%} of the objects kept, {unknown:.1%} of that unknown"


def test_an_octree_that_is_not_refined_is_told(shell, tmp_path, monkeypatch):
    """The roots take a second each, and so do their children: time for two pieces, the roots, and two families."""
    settings = Settings(method="occluders", cell_size_m=8.0, depth=1, refine_triangles=1)
    roots = viewcell.bake(shell, tmp_path / "roots", settings=replace(settings, depth=0)).graph.cell_count
    Clock(monkeypatch, {False: 1.0, True: 1.0}, ViewCellEngine)
    facts = viewcell.bake(shell, tmp_path / "tree", settings=settings, threads=1, budget_s=roots + 4.5).manifest
    assert facts["budget"] | {"pairs": 0} == {
        "budget_s": roots + 4.5, "phase": "octree", "cells": roots - 2, "pairs": 0, "needed_s": 2.0 * roots + 2.0,
        "minute": roots - 2,
    }  # fmt: skip
    assert facts["budget"]["pairs"] <= facts["counts"]["object_pairs"]
    assert (
        f"while the octree was refined: {facts['budget']['pairs']:,} pairs of {roots - 2} view" in facts["warnings"][-1]
    )


def rooms_of(count, dead=0):
    """Rooms of 3 m in a row, walls between them; the last ones are filled by a solid."""
    parts = [(box((0, 0, -100), (count * 3 * M, 3 * M, 0)), "occluder")]
    for k in range(count + 1):
        parts.append((box((3 * M * k - 50, 0, 0), (3 * M * k + 50, 3 * M, 3 * M)), "occluder"))
    for k in range(count - dead, count):
        parts.append((box((3 * M * k - 40, -10, -10), (3 * M * (k + 1) + 40, 3 * M + 10, 3 * M + 10)), "occluder"))
    return scene_of(parts, [((3 * M * k + 50, 0, 0), (3 * M * (k + 1) - 50, 3 * M, 3 * M)) for k in range(count)])


def test_rooms_without_a_cell_are_named(tmp_path):
    """Five at most, and how many more."""
    facts = viewcell.bake(rooms_of(9, dead=7), tmp_path / "a").manifest
    assert facts["uncovered_rooms"] == [f"room {k}" for k in range(2, 9)]
    (warning,) = [text for text in facts["warnings"] if "rooms" in text and "not covered" in text]
    assert warning.startswith("7 of 9 rooms are not covered by view cells")
    assert (
        "'room 2' (0 %: solids fill it), 'room 3'" in warning and "'room 6' (0 %: solids fill it) and 2 more" in warning
    )
    assert viewcell.bake(rooms_of(3), tmp_path / "b").manifest["uncovered_rooms"] == []
    one = viewcell.bake(rooms_of(3, dead=1), tmp_path / "c").manifest["warnings"]
    assert any(text.startswith("1 of 3 rooms is not covered by view cells") and "more" not in text for text in one)


def test_boxes_that_were_given_are_not_said_to_miss_rooms(tmp_path):
    cells = tmp_path / "cells.csv"
    cells.write_text("min_x,min_y,min_z,max_x,max_y,max_z\n1,1,1,2,2,2\n")
    facts = viewcell.bake(rooms_of(3), tmp_path / "a", settings=Settings(method="occluders", cells=str(cells))).manifest
    assert facts["uncovered_rooms"] == [] and not any("room" in text for text in facts["warnings"])


def cracked_house(gap):
    """A closed room of 4 x 4 x 3 m whose end wall stops short of the ceiling."""
    solid = random_solids.box
    meshes = [
        solid([-1, -1, -1], [6, 5, 0]), solid([-1, -1, 3], [6, 5, 4]),
        solid([-1, -1, 0], [6, 0, 3]), solid([-1, 4, 0], [6, 5, 3]),
        solid([-1, 0, 0], [0, 4, 3]), solid([4, 0, 0], [5, 4, 3 - gap]),
    ]  # fmt: skip
    scene = random_solids.scene_of_meshes(meshes, [Role.OCCLUDER] * len(meshes))
    room = solid([0, 0, 0], [4, 4, 3])
    scene.spaces.append(Space("a", np.array(room.vertices), np.array(room.faces, np.int32)))
    return scene


def test_a_crack_to_the_outside_is_a_leak(tmp_path):
    facts = viewcell.bake(cracked_house(2.0**-6), tmp_path / "a").manifest
    (leak,) = [text for text in facts["warnings"] if "leaks" in text and "first" not in text]
    assert leak.startswith("through cracks alone the outside leaks into ") and "--seal 0.05 closes them" in leak
    assert not any("leaks" in text for text in viewcell.bake(cracked_house(0.0), tmp_path / "b").manifest["warnings"])
    sealed = viewcell.bake(cracked_house(2.0**-6), tmp_path / "c", settings=Settings(seal=0.05)).manifest
    assert not any("leaks" in text for text in sealed["warnings"])


def test_a_leak_path_is_told_with_what_to_do():
    """As flooding finds it; the first twelve cells of it."""
    facts = {"leak_cells": [3, 1, 2], "warnings": ["no solid"]}
    found = worth(None, as_graph(np.array([[[0, 0, 0], [1, 1, 1]]])), NOTHING, facts)
    assert list(found) == ["warnings"] and found["warnings"][0] == "no solid"
    assert "through cells 3, 1, 2; viewcell inspect MODEL --picture plan.png shows the way" in found["warnings"][1]
    assert ", 10, 11, ...; " in told._leak_words(list(range(13)), 0, 1)[0]


def test_a_bare_graph_keeps_no_objects(tmp_path):
    facts = viewcell.bake(corridors.graph_folder("office", tmp_path), tmp_path / "made").manifest
    assert "kept" not in facts and facts["warnings"] == []


@pytest.mark.parametrize(
    ("facts", "budget", "leak", "advice"),
    [
        ({}, True, True, "first give it more"),
        ({}, False, True, "first close that"),
        ({"inhabitable_because": "octree"}, False, False, "--cell-size"),
        ({"inhabitable_because": "walkways"}, False, False, "open hall"),
        ({"inhabitable_because": "inside the model's 3 rooms"}, False, False, "--yaw"),
    ],
)
def test_advice_begins_with_what_is_likeliest(facts, budget, leak, advice):
    assert advice in told._first_to_do(facts, budget, leak)


def test_half_of_the_triangles_is_enough_to_warn():
    assert told._kept_words({"objects": 0.5, "triangles": 0.5}, "do") == []
    assert told._kept_words({"objects": 0.2, "triangles": 0.51}, "do") == [
        "a view cell keeps 51 % of the triangles on average, so little is culled; do"
    ]
