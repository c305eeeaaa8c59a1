"""Sets as JSON, asked as a reader of the guide would ask them."""

import json

import numpy as np
import pytest
from shapely import Point, Polygon
from viewcell import InputError
from viewcell.workbench.baked import load
from viewcell.workbench.export.json_sets import sets_as_json


@pytest.fixture(scope="module")
def told(house):
    return json.loads(sets_as_json(house))


def test_sets_are_those_of_the_bake(house, told):
    bake = load(house.folder)
    cells = {cell["id"]: cell for cell in told["cells"]}
    assert sorted(cells) == np.flatnonzero(bake.graph.inhabitable).tolist()
    some = False
    for number, cell in cells.items():
        assert cell["potential"] == bake.potential(number).tolist()
        assert cell["unknown"] == bake.unknown(number).tolist()
        some |= len(cell["potential"]) < len(told["objects"])
    assert some


def test_the_first_view_cell_that_holds_an_eye_is_the_bakes(house, told):
    """Prisms by another library, with points inside and outside of the house."""
    bake = load(house.folder)
    plans = [Polygon(cell["plan"]) for cell in told["cells"]]
    corners = np.concatenate([cell["plan"] for cell in told["cells"]])
    random = np.random.default_rng(5)
    low, high = [*(corners.min(axis=0) - 1), 29.5], [*(corners.max(axis=0) + 1), 33.5]
    held = 0
    for point in random.uniform(low, high, (400, 3)):
        found = [
            cell["id"]
            for cell, plan in zip(told["cells"], plans, strict=True)
            if cell["bottom"] <= point[2] <= cell["top"] and plan.contains(Point(point[:2]))
        ]
        if found:
            held += 1
            assert found[0] == bake.cell_at(point)
        else:
            with pytest.raises(InputError):
                bake.cell_at(point)
    assert 50 < held < 350
    # Counter-clockwise, as a reader with half-planes needs it.
    assert all(plan.exterior.is_ccw for plan in plans)


def test_objects_and_rooms_have_their_names(house, told):
    objects = house.scene.objects
    for number, (row, placed) in enumerate(zip(told["objects"], objects, strict=True)):
        guid = {"guid": placed.guid} if placed.guid else {}
        assert row == {"id": number, "name": placed.name, "kind": placed.kind, "role": placed.role.value} | guid
    rooms = {room["name"]: room["cells"] for room in told["rooms"]}
    assert rooms == {row["name"]: row["cells"] for row in house.rooms.to_pylist()}
    assert set(rooms) == {"room 0", "room 1"}
