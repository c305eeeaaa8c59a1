"""A bake as a user asks it: by cell, room, name or point, in the model's own metres, whatever frame it was baked in."""

import numpy as np
import pytest
import viewcell
from viewcell import InputError

YAW_DEG = 17.0


@pytest.fixture(scope="module")
def office(tmp_path_factory):
    """An office that stands at an angle: the bake's frame is not the model's."""
    scene = viewcell.make_office(floors=1, rooms_per_side=2, yaw_deg=YAW_DEG)
    return viewcell.bake(scene, tmp_path_factory.mktemp("baked") / "office.bake", threads=2), scene


@pytest.fixture
def bake(office):
    return office[0]


def pairs(bake):
    """(cell, object): verdict, row by row."""
    table = bake.cell_to_object
    return {(row["cell_id"], row["object_id"]): row for row in table.to_pylist()}


def middle_of(bake, cell):
    """The middle of a cell in the model's own metres, turned by hand."""
    x, y, z = bake.graph.cells[cell].mean(axis=0) * bake.grid_m
    turn = complex(x, y) * np.exp(1j * np.radians(bake.yaw_deg))
    return np.array([turn.real, turn.imag, z]) + bake.origin


def test_a_point_is_in_its_cell(bake):
    assert bake.yaw_deg == pytest.approx(YAW_DEG)
    for cell in np.flatnonzero(bake.graph.inhabitable).tolist():
        point = middle_of(bake, cell)
        assert bake.cell_at(point) == cell and bake.cells_of(tuple(point)).tolist() == [cell]


def test_sets_of_a_cell_are_its_rows(bake):
    rows = pairs(bake)
    for cell in np.flatnonzero(bake.graph.inhabitable).tolist():
        own = {target: row["verdict"] for (source, target), row in rows.items() if source == cell}
        assert bake.potential(cell).tolist() == sorted(own)
        assert bake.seen(cell).tolist() == sorted(t for t, verdict in own.items() if verdict == "visible")
        assert bake.unknown(middle_of(bake, cell)).tolist() == sorted(t for t, v in own.items() if v == "unknown")


def test_a_room_has_what_its_cells_have(bake):
    room = bake.rooms.to_pylist()[0]
    assert bake.cells_of(room["name"]).tolist() == sorted(room["cells"])
    union = set().union(*(bake.potential(cell).tolist() for cell in room["cells"]))
    assert bake.potential(room["name"]).tolist() == sorted(union)
    seen = set().union(*(bake.seen(cell).tolist() for cell in room["cells"]))
    assert bake.seen(room["name"]).tolist() == sorted(seen)
    assert bake.unknown(room["name"]).tolist() == sorted(union - seen)


def test_long_names_and_guids_name_rooms(bake, monkeypatch):
    row = bake.rooms.to_pylist()[1] | {"long_name": "The Hall", "guid": "2O2Fr$t4X7Zf8NOew3FKau"}
    monkeypatch.setitem(bake.__dict__, "rooms", bake.rooms.from_pylist([row], schema=bake.rooms.schema))
    for name in (row["name"], "The Hall", "2O2Fr$t4X7Zf8NOew3FKau"):
        assert bake.cells_of(name).tolist() == sorted(row["cells"])


def test_a_witness_is_in_the_models_metres(office):
    bake, scene = office
    rows = pairs(bake)
    (cell, target), row = next(item for item in rows.items() if item[1]["verdict"] == "visible")
    for wanted in (target, np.int64(target)):
        found = bake.witness(cell, wanted)
        assert found.cell == cell and found.object_id == target
        assert bake.cell_at(found.origin) == cell
    x, y, z = (row[f"origin_{axis}"] + row[f"direction_{axis}"] for axis in "xyz")
    turn = complex(x, y) * np.exp(1j * np.radians(bake.yaw_deg))
    assert found.end == pytest.approx(np.array([turn.real, turn.imag, z]) + bake.origin)
    # The model's own box around the object, before it was turned back, holds the end.
    placed = scene.objects[target]
    corners = (
        scene.definitions[placed.definition_id].lods[0].vertices @ placed.transform[:3, :3].T + placed.transform[:3, 3]
    )
    low, high = scene.in_model(corners).min(axis=0), scene.in_model(corners).max(axis=0)
    assert (found.end >= low - 0.01).all() and (found.end <= high + 0.01).all()
    unknown = next((pair for pair, row in rows.items() if row["verdict"] == "unknown"), None)
    assert unknown is None or bake.witness(*unknown) is None
    hidden = next(t for t in range(len(scene.objects)) if (cell, t) not in rows)
    assert bake.witness(cell, hidden) is None


def test_objects_are_asked_for_by_name(bake):
    names = [placed.name for placed in bake.scene.objects]
    target = next(k for k in bake.seen(int(pairs(bake).__iter__().__next__()[0])) if names.count(names[k]) == 1)
    cell = next(c for c, t in pairs(bake) if t == target)
    assert bake.witness(cell, names[target]) is None or bake.witness(cell, names[target]).object_id == target


def test_objects_in_the_models_metres(office):
    bake, scene = office
    table = bake.objects
    assert table["object_id"].to_pylist() == list(range(len(scene.objects)))
    assert {"name", "kind", "role", "guid", "storey", "materials"} <= set(table.column_names)
    for k in (0, 5, len(scene.objects) - 1):
        low = np.array([table[f"min_{axis}"][k].as_py() for axis in "xyz"])
        high = np.array([table[f"max_{axis}"][k].as_py() for axis in "xyz"])
        placed = scene.objects[k]
        mesh = scene.definitions[placed.definition_id].lods[0]
        own = scene.in_model(mesh.vertices[mesh.faces.ravel()] @ placed.transform[:3, :3].T + placed.transform[:3, 3])
        assert (own >= low - 0.01).all() and (own <= high + 0.01).all()


def test_what_is_printed_fits_on_a_line(office):
    bake, scene = office
    text = repr(bake)
    assert "\n" not in text and len(text) < 200
    assert f"{len(scene.objects):,} objects" in text and "% kept" in text and str(bake.folder) in text
    assert "\n" not in repr(scene) and len(repr(scene)) < 200 and f"{len(scene.objects):,} objects" in repr(scene)


REFUSED = {
    "no cell": (-1, "expected the id of an inhabitable cell, found -1"),
    "too many": (10**6, "expected the id of an inhabitable cell, found 1000000"),
    "a bool": (True, "point: expected x, y and z in metres, found True"),
    "no room": ("the moon", "expected the name of a room with view cells"),
    "two numbers": ((1.0, 2.0), "expected x, y and z in metres, found (1.0, 2.0)"),
    "no number": ((1.0, 2.0, float("nan")), "expected x, y and z in metres"),
    "a scene": (None, "expected x, y and z in metres, found"),
    "far away": ((1e4, 0.0, 0.0), "found (10000, 0, 0); the nearest is cell"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_other_places_are_refused_in_a_line(bake, case):
    place, said = REFUSED[case]
    with pytest.raises(InputError) as error:
        bake.potential(bake.scene if case == "a scene" else place)
    assert said in str(error.value) and "\n" not in str(error.value) and len(str(error.value)) < 300


@pytest.mark.parametrize("wanted", [-1, 10**6, True, "no such thing", None])
def test_other_objects_are_refused_in_a_line(bake, wanted):
    with pytest.raises(InputError, match="object: expected") as error:
        bake.witness(int(np.flatnonzero(bake.graph.inhabitable)[0]), wanted)
    assert "\n" not in str(error.value) and len(str(error.value)) < 300


def test_names_that_several_bear_are_no_answer(bake):
    names = [placed.name for placed in bake.scene.objects]
    double = next((name for name in names if names.count(name) > 1), None)
    if double is None:
        bake.scene.objects.append(bake.scene.objects[0])
        double = names[0]
    with pytest.raises(InputError, match="of one object, found 2 of them"):
        bake.witness(int(np.flatnonzero(bake.graph.inhabitable)[0]), double)
