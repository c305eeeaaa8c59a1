"""Storeys, long names and materials of IFC files, as they were written."""

from types import SimpleNamespace

import pytest
from builders.step_house import GROUND, TOLD, TOLD_IFC4, told_house
from viewcell.data.readers import read
from viewcell.data.readers.ifc_places import Places
from viewcell.data.scene import NamedStorey


@pytest.mark.parametrize(("schema", "told"), [("IFC2X3", TOLD), ("IFC4", TOLD_IFC4)])
def test_storeys_and_materials_are_those_of_the_file(schema, told, tmp_path):
    scene = read(told_house(schema).write(tmp_path / "a.ifc"))
    found = {placed.name: (placed.storey, placed.materials) for placed in scene.objects}
    assert found == {name: (one and NamedStorey(*one), made) for name, (one, made) in told.items()}
    (room,) = scene.spaces
    assert (room.name, room.long_name) == ("room", "Stube \u00e4 \u00df \U0001f3e0")
    assert room.storey == NamedStorey(*GROUND) and len(room.guid) == 22


def test_a_nearer_storey_goes_before(tmp_path):
    """A storey in a storey, and one without a name, which is called by its GlobalId."""
    step = told_house()
    inner, outer = (
        step.add(f"IFCBUILDINGSTOREY('{guid:022d}',$,$,$,$,$,$,$,.PARTIAL.,{height})")
        for guid, height in ((910, 1500.0), (911, 1000.0))
    )
    step.relate("IfcRelAggregates", outer, f"({inner})")
    low = step.box("IfcFurnishingElement", "low", (500_000_000.0, 1000.0, 0.0), (100, 100, 100))
    step.relate("IfcRelContainedInSpatialStructure", f"({low})", inner)
    found = {placed.name: placed.storey for placed in read(step.write(tmp_path / "a.ifc")).objects}
    assert found["low"] == NamedStorey(f"{910:022d}", 1.5)


def thing(number, *above, **values):
    """An entity that is part of others; of those that are storeys, with a Name and an Elevation."""
    links = [SimpleNamespace(RelatingObject=one) for one in above]
    return SimpleNamespace(id=lambda: number, is_a=lambda kind: bool(values), Decomposes=links, GlobalId="", **values)


def test_circles_end():
    a, b = thing(1), thing(2)
    a.Decomposes, b.Decomposes = ([SimpleNamespace(RelatingObject=one)] for one in (b, a))
    assert Places(1.0).storey_of(thing(3, a)) is None
    assert Places(0.5).storey_of(thing(4, a, thing(5, Name="S", Elevation=3))) == NamedStorey("S", 1.5)
