import numpy as np
import pytest
from builders.awkward import ifc_case
from viewcell.data.inhabit import find_inhabitable
from viewcell.data.prepared import PreparedModel
from viewcell.data.readers import read
from viewcell.data.room_cells import room_covers
from viewcell.workbench.bake.cells import build_graph, model_sources
from viewcell.workbench.bake.manifest import Clock
from viewcell.workbench.bake.settings import Settings


def names(case: str) -> list[str]:
    """Names of the inhabitable cells of a case, in order."""
    graph, _ = build_graph(PreparedModel(read(ifc_case(case))), Settings(), Clock())
    return sorted(map(str, np.asarray(graph.cell_names)[graph.inhabitable]))


@pytest.mark.parametrize("case", ["base", "space_box", "parts_void", "two_bodies", "norepitems", "far", "maporigin"])
def test_rooms_name_their_cells(case):
    assert names(case) == ["east", "west"]


@pytest.mark.parametrize("case", ["rotated", "far_rotated"])
def test_rooms_oblique_to_the_cells_have_cells_of_their_own(case):
    model = PreparedModel(read(ifc_case(case)))
    graph = model_sources(model, Settings(), Clock()).graph
    named = graph.inhabitable & (graph.cell_names != "")
    assert {room for name in graph.cell_names[named] for room in name.split(", ")} == {"east", "west"}
    assert all(room.covered for room in room_covers(model.scene, graph, model.room_points))


def test_rooms_without_a_body_are_found_by_flooding():
    assert names("space_half") == ["", "west"] and names("space_nogeo") == ["", ""]


def test_flooding_adds_nothing_where_every_room_has_a_body():
    scene = read(ifc_case("space_half"))
    graph, _ = build_graph(PreparedModel(scene), Settings(), Clock())
    scene.skipped.clear()
    assert find_inhabitable(scene, graph).mask.sum() == 1
