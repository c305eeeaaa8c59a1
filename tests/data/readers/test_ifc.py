import os
import subprocess
import sys
from collections import Counter
from zipfile import ZipFile

import numpy as np
import pytest
from builders.awkward import assert_house, boxes, ifc_case
from builders.model_files import HOUSE
from builders.mutated import mutated
from builders.step_house import Step, house
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.readers.roles import RoleRules
from viewcell.data.scene import GRID_M, Role, Scene
from viewcell.data.store.scene_folder import read_scene, write_scene


def by_name(scene: Scene) -> dict[str, tuple[str, Role]]:
    return {placed.name: (placed.kind, placed.role) for placed in scene.objects}


def refused(path) -> str:
    with pytest.raises(InputError) as error:
        read(path)
    assert "\n" not in str(error.value)
    assert "expected" in str(error.value) and "found" in str(error.value)
    return str(error.value)


INHERITANCE = {
    "IfcWallStandardCase": Role.OCCLUDER,
    "IfcSlabStandardCase": Role.OCCLUDER,
    "IfcStairFlight": Role.OCCLUDER,
    "IfcFooting": Role.OCCLUDER,
    "IfcMember": Role.OCCLUDER,
    "IfcPlate": Role.OCCLUDER,
    "IfcBuildingElementProxy": Role.OCCLUDER,
    "IfcDoorStandardCase": Role.TRANSPARENT,
    "IfcWindowStandardCase": Role.TRANSPARENT,
    "IfcCurtainWall": Role.TRANSPARENT,
    "IfcFurniture": Role.DETAIL,
    "IfcAirTerminal": Role.DETAIL,
    "IfcSpaceHeater": Role.DETAIL,
}


@pytest.mark.parametrize("kind", INHERITANCE)
def test_roles_follow_inheritance_not_exact_names(kind):
    import ifcopenshell

    entity = ifcopenshell.file(schema="IFC4").create_entity(kind)
    assert RoleRules().of_product(entity.is_a, "", kind).role is INHERITANCE[kind]
    if kind != "IfcPlate":
        assert (named := RoleRules().of_mesh(f"1|{kind}|a", "")) and (named.role, named.kind) == (
            INHERITANCE[kind],
            kind,
        )


def test_role_needs_more_than_the_class():
    import ifcopenshell

    file = ifcopenshell.file(schema="IFC4")
    door, proxy, plate = (file.create_entity(kind) for kind in ("IfcDoor", "IfcBuildingElementProxy", "IfcPlate"))
    assert RoleRules("closed").of_product(door.is_a, "", "IfcDoor").role is Role.OCCLUDER
    assert RoleRules().of_product(proxy.is_a, "Office chair 12", "").role is Role.DETAIL
    assert RoleRules().of_product(plate.is_a, "", "", in_curtain_wall=True).role is Role.TRANSPARENT


PAINTS = {
    "none": ((), Role.OCCLUDER),
    "opaque": ((0.0,), Role.OCCLUDER),
    "nearly opaque": ((0.05,), Role.OCCLUDER),
    "a little": ((0.06,), Role.TRANSPARENT),
    "glass": ((0.8,), Role.TRANSPARENT),
    "all of it": ((1.0,), Role.TRANSPARENT),
    "first part": ((0.8, 0.0), Role.TRANSPARENT),
    "last part": ((0.0, 0.8), Role.TRANSPARENT),
    "beside what has none": ((None, 0.8), Role.TRANSPARENT),
    "no part": ((0.0, 0.03, None), Role.OCCLUDER),
}


@pytest.mark.parametrize("schema", ["IFC2X3", "IFC4"])
@pytest.mark.parametrize("paint", PAINTS)
def test_what_is_glass_in_part_hides_nothing(tmp_path, paint, schema):
    """By the colour of its surface, whatever its class: calling it opaque would hide what is seen through it."""
    step, (transparencies, role) = house(schema), PAINTS[paint]
    far = (500_000_000.0, 9000, 0)
    step.box("IfcColumn", "column", far, (600, 600, 3000), ",$" if schema == "IFC2X3" else ",$,$", transparencies)
    step.box("IfcFurnishingElement", "screen", (500_001_000.0, 9000, 0), (600, 60, 900), ",$", transparencies)
    roles = by_name(read(step.write(tmp_path / "a.ifc")))
    assert roles["column"] == ("IfcColumn", role)
    assert roles["screen"][1] is (Role.DETAIL if role is Role.OCCLUDER else role)
    assert roles["wall"][1] is Role.OCCLUDER


def test_panes_of_a_curtain_wall_are_glass(tmp_path):
    step = house()
    panes = [step.box("IfcPlate", f"plate {n}", (500_000_000.0, 9000 + 900 * n, 0), (60, 800, 900)) for n in range(2)]
    wall = step.add(f"IFCCURTAINWALL('{len(step.lines):022d}',$,'front',$,$,$,$,$)")
    step.add(f"IFCRELAGGREGATES('{len(step.lines):022d}',$,$,$,{wall},({panes[0]}))")
    roles = by_name(read(step.write(tmp_path / "a.ifc")))
    assert roles["plate 0"] == ("IfcPlate", Role.TRANSPARENT) and roles["plate 1"] == ("IfcPlate", Role.OCCLUDER)


def test_panes_that_say_they_are_panes_are_glass(tmp_path):
    step = house("IFC4")
    for number, kind in enumerate(("CURTAIN_PANEL", "SHEET")):
        step.box("IfcPlate", kind, (500_000_000.0, 9000 + 900 * number, 0), (60, 800, 900), f",$,.{kind}.")
    roles = by_name(read(step.write(tmp_path / "a.ifc")))
    assert roles["CURTAIN_PANEL"][1] is Role.TRANSPARENT and roles["SHEET"][1] is Role.OCCLUDER


def storey(schema="IFC2X3"):
    """A row of rooms with walls, doors, windows, stools that share a shape, and a member."""
    step = house(schema)
    for n in range(1, 6):
        at = np.array([500_000_000.0 + 6000 * n, 0, 0])
        bay, room = at + np.array([2100, 0, 0]), at + np.array([0, 2000, 0])
        wall = step.box("IfcWall", f"wall {n}", at, (4000, 200, 3000), ",$" if schema == "IFC2X3" else ",$,$")
        for kind, place in (("IfcDoor", (-900, 0, 0)), ("IfcWindow", (900, 0, 1000))):
            void = step.box("IfcOpeningElement", f"hole {n}", at + place, (900, 300, 1500))
            filler = step.box(kind, f"{kind} {n}", at + place, (850, 60, 1450), ",$,$,$")
            step.relate("IfcRelVoidsElement", wall, void)
            step.relate("IfcRelFillsElement", void, filler)
        step.box("IfcMember", f"post {n}", bay, (100, 100, 3000), ",$" if schema == "IFC2X3" else ",$,$")
        step.box("IfcSpace", f"room {n}", room, (4000, 3800, 3000), ",$,.ELEMENT.,.INTERNAL.,$")
    return step


@pytest.mark.parametrize("schema", ["IFC2X3", "IFC4"])
def test_a_storey_keeps_its_things_rooms_and_holes(schema, tmp_path, monkeypatch):
    """Written and read again, or read by more threads, it is the same to the last digit; the file is not touched."""
    path = storey(schema).write(tmp_path / "a.ifc")
    before = path.read_bytes()
    scene = read(path)
    assert (len(scene.objects), len(scene.spaces), len(scene.openings), scene.skipped) == (4 + 5 * 4, 6, 11, [])
    roles = {(placed.kind, placed.role.value) for placed in scene.objects}
    assert {("IfcWindow", "transparent"), ("IfcDoor", "transparent"), ("IfcMember", "occluder")} <= roles
    assert scene.max_snap_m() <= GRID_M / 2 and path.read_bytes() == before
    write_scene(scene, tmp_path / "a.scene")
    np.testing.assert_array_equal(read_scene(tmp_path / "a.scene").triangles()[0], scene.triangles()[0])
    for cores in (1, 4):
        monkeypatch.setattr("os.cpu_count", lambda cores=cores: cores)
        again = read(path)
        assert [placed.name for placed in again.objects] == [placed.name for placed in scene.objects]
        np.testing.assert_array_equal(again.triangles()[0], scene.triangles()[0])
    closed = {placed.kind: placed.role for placed in read(path, doors="closed").objects}
    assert closed["IfcDoor"] is Role.OCCLUDER and closed["IfcWindow"] is Role.TRANSPARENT


def test_an_unknown_schema_is_refused(tmp_path):
    assert "IFC9" in refused(house("IFC9").write(tmp_path / "new.ifc"))


def test_what_is_no_thing_is_no_object(tmp_path):
    """Voids, annotations and rooms would hide what is behind them."""
    names = by_name(read(house().write(tmp_path / "a.ifc")))
    assert names.keys() == {"wall", "door", "slab", "chair"}


def test_small_ifc_gives_everything(tmp_path):
    scene = read(house().write(tmp_path / "a.ifc"))
    assert by_name(scene) == {
        "wall": ("IfcWallStandardCase", Role.OCCLUDER),
        "door": ("IfcDoor", Role.TRANSPARENT),
        "slab": ("IfcSlab", Role.OCCLUDER),
        "chair": ("IfcFurnishingElement", Role.DETAIL),
    }
    assert scene.unit == "millimetre" and scene.skipped == []
    assert np.abs(scene.origin - [500_000, 2, 1]).max() <= 1
    names = [placed.name for placed in scene.objects]
    wall = scene.object_bounds()[names.index("wall")] * scene.grid_m
    np.testing.assert_allclose(wall[1] - wall[0], [4, 0.2, 3], atol=GRID_M)
    assert (scene.triangles()[1] == names.index("wall")).sum() > 12  # the hole is cut
    (opening,) = scene.openings  # the void, and not the door that fills it
    np.testing.assert_allclose(opening[1] - opening[0], [1, 0.3, 2], atol=1e-6)
    (room,) = scene.spaces
    np.testing.assert_allclose(np.ptp(room.vertices, axis=0), [4, 3.8, 3], atol=1e-6)
    assert room.name == "room"


@pytest.mark.parametrize("schema", ["IFC2X_FINAL", "IFC2X2_FINAL", "ifc2x_final"])
def test_old_headers_are_read_without_touching_the_file(tmp_path, schema):
    path = house(schema).write(tmp_path / "a.ifc")
    path.chmod(0o444)
    before = path.read_bytes()
    assert len(read(path).objects) == 4
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.ifc"]


def test_star_for_a_name_loses_the_name_only(tmp_path):
    scene = read(house(wall_name="*").write(tmp_path / "a.ifc"))
    assert len(scene.objects) == 4
    (note,) = scene.skipped
    assert note["what"] == "1 of the products" and "*" in note["why"]


def test_product_that_fails_is_listed(tmp_path):
    step = house()
    step.box("IfcColumn", "bad", (0, 0, 0), (0, 0, 3000))
    scene = read(step.write(tmp_path / "a.ifc"))
    assert len(scene.objects) == 4
    (lost,) = scene.skipped
    assert lost["what"].startswith("IfcColumn") and lost["why"]


def test_door_that_fills_nothing_is_an_opening(tmp_path):
    step = house()
    step.box("IfcDoor", "free", (500_001_000.0, 2000, 0), (900, 50, 1900), ",$,$,$")
    assert len(read(step.write(tmp_path / "a.ifc")).openings) == 2


def test_ifc_without_anything_opaque_is_one_clear_line(tmp_path):
    step = Step()
    assert "opaque" in refused(step.write(tmp_path / "empty.ifc"))
    step.box("IfcDoor", "door", (0, 0, 0), (900, 50, 1900), ",$,$,$")
    assert "opaque" in refused(step.write(tmp_path / "door.ifc"))


def test_shared_geometry_is_one_definition(tmp_path):
    step = house()
    origin = step.add("IFCREPRESENTATIONMAP(#4," + step.shape((500, 500, 900)) + ")")
    operator = step.add("IFCCARTESIANTRANSFORMATIONOPERATOR3D($,$,#3,$)")
    for x in (500_001_000.0, 500_001_700.0):
        mapped = step.add(f"IFCMAPPEDITEM({origin},{operator})")
        shape = step.add(f"IFCSHAPEREPRESENTATION(#5,'Body','MappedRepresentation',({mapped}))")
        shape = step.add(f"IFCPRODUCTDEFINITIONSHAPE($,$,({shape}))")
        point = step.add(f"IFCCARTESIANPOINT(({x},1000.,0.))")
        place = step.add(f"IFCLOCALPLACEMENT($,{step.add(f'IFCAXIS2PLACEMENT3D({point},$,$)')})")
        step.add(f"IFCFURNISHINGELEMENT('{len(step.lines):022d}',$,'stool {x:g}',$,$,{place},{shape},$)")
    scene = read(step.write(tmp_path / "a.ifc"))
    stools = [i for i, placed in enumerate(scene.objects) if placed.name.startswith("stool")]
    assert len({scene.objects[i].definition_id for i in stools}) == 1
    low = scene.object_bounds()[stools, 0, 0] * scene.grid_m
    assert abs(low[1] - low[0]) == pytest.approx(0.7, abs=GRID_M)
    assert low.min() + scene.origin[0] == pytest.approx(500_000.75, abs=GRID_M)


MIDDLE = ("mid low", "mid high", "mid lintel")
LIKE_BASE = ("base", "dup_guid", "mirrored", "maporigin", "norepitems", "stray_near", "space_box")


@pytest.mark.parametrize("name", LIKE_BASE)
def test_awkward_files_are_the_house(name):
    scene = read(ifc_case(name))
    assert_house(scene)
    assert len(scene.objects) == 12 + (name == "stray_near")
    assert sorted(space.name for space in scene.spaces) == ["east", "west"]
    roles = Counter(placed.role for placed in scene.objects)
    assert roles == {Role.OCCLUDER: 9 + (name == "stray_near"), Role.DETAIL: 3}


def test_scaled_copies_are_where_they_are_written():
    scene = read(ifc_case("nonuniform"))
    assert_house(scene)
    assert len(scene.objects) == 12


def test_two_bodies_are_one_wall():
    """The whole wall every time: the pieces came in any order, and the last to come was all of it."""
    scene = read(ifc_case("two_bodies"))
    assert_house(scene, but=("mid low", "mid high"))
    np.testing.assert_allclose(boxes(scene)["mid"], [(3.75, 0, 0), (4, 4, 3)], atol=GRID_M)
    assert scene.triangle_counts[[placed.name for placed in scene.objects].index("mid")] == 24


def test_two_bodies_of_a_room_are_one_room(tmp_path):
    step = house()
    pieces = [step.shape((1000, 1000, height)) for height in (1000, 2500)]
    shape = step.add(f"IFCPRODUCTDEFINITIONSHAPE($,$,({','.join(pieces)}))")
    step.add(f"IFCSPACE('{len(step.lines):022d}',$,'two',$,$,$,{shape},$,.ELEMENT.,.INTERNAL.,$)")
    (room,) = (space for space in read(step.write(tmp_path / "a.ifc")).spaces if space.name == "two")
    assert len(room.faces) == 24 and np.ptp(room.vertices, axis=0)[2] == pytest.approx(2.5)


def test_products_with_one_guid_are_told_apart_and_noted():
    scene = read(ifc_case("dup_guid"))
    assert len({placed.guid for placed in scene.objects}) == 11
    (note,) = scene.notes
    assert "mid low" in note["why"] and "mid high" in note["why"] and note["what"].startswith("GlobalId ")


def test_a_clearance_is_no_body():
    scene = read(ifc_case("clearance_only"))
    assert_house(scene, but=("box c",))
    (lost,) = scene.skipped
    assert len(scene.objects) == 11 and "Clearance" in lost["why"] and lost["what"].startswith("IfcFurniture")


NO_BODIES = {"Clearance": "SweptSolid", "Box": "BoundingBox", "Reference": "SweptSolid", "Axis": "Curve3D"}


@pytest.mark.parametrize("identifier", NO_BODIES)
@pytest.mark.parametrize("beside", [True, False])
def test_only_bodies_become_objects(tmp_path, identifier, beside):
    """Beside a body another representation adds nothing; without one the product is listed, and why."""
    step = house()
    solid = step.solid((500, 500, 4000))
    other = step.add(f"IFCSHAPEREPRESENTATION(#5,'{identifier}','{NO_BODIES[identifier]}',({solid}))")
    body = f"{step.shape((500, 500, 900))}," if beside else ""
    shape = step.add(f"IFCPRODUCTDEFINITIONSHAPE($,$,({body}{other}))")
    point = step.add("IFCCARTESIANPOINT((500001000.,1000.,0.))")
    place = step.add(f"IFCLOCALPLACEMENT($,{step.add(f'IFCAXIS2PLACEMENT3D({point},$,$)')})")
    step.add(f"IFCFURNISHINGELEMENT('{len(step.lines):022d}',$,'more',$,$,{place},{shape},$)")
    scene = read(step.write(tmp_path / "a.ifc"))
    if beside:
        assert scene.skipped == [] and np.ptp(boxes(scene)["more"], axis=0)[2] == pytest.approx(0.9, abs=2 * GRID_M)
    else:
        (lost,) = scene.skipped
        assert identifier in lost["why"] and "more" not in boxes(scene)


def test_what_has_no_items_is_listed_and_harms_nothing_else():
    (lost,) = read(ifc_case("norepitems")).skipped
    assert lost["what"].startswith("IfcSlab") and "no items" in lost["why"]


@pytest.mark.parametrize("beside", [True, False])
def test_a_copy_of_nothing_harms_nothing_else(tmp_path, beside):
    step = house()
    solid = f"{step.solid((500, 500, 900))}," if beside else ""
    empty = step.add("IFCSHAPEREPRESENTATION(#5,'Body','',$)")
    copied = step.add(f"IFCREPRESENTATIONMAP(#4,{empty})")
    item = step.add(f"IFCMAPPEDITEM({copied},{step.add('IFCCARTESIANTRANSFORMATIONOPERATOR3D($,$,#3,$,$)')})")
    body = step.add(f"IFCSHAPEREPRESENTATION(#5,'Body','MappedRepresentation',({solid}{item}))")
    shape = step.add(f"IFCPRODUCTDEFINITIONSHAPE($,$,({body}))")
    point = step.add("IFCCARTESIANPOINT((500001000.,1000.,0.))")
    place = step.add(f"IFCLOCALPLACEMENT($,{step.add(f'IFCAXIS2PLACEMENT3D({point},$,$)')})")
    step.add(f"IFCFURNISHINGELEMENT('{len(step.lines):022d}',$,'none',$,$,{place},{shape},$)")
    scene = read(step.write(tmp_path / "a.ifc"))
    assert len(scene.objects) == 4 + beside and len(scene.spaces) == 1
    assert [lost["why"] for lost in scene.skipped] == ([] if beside else ["its body has no items"])


def test_a_file_that_ends_early_is_one_line():
    assert "cut.ifc" in refused(ifc_case("cut"))


def test_a_file_without_a_project_is_one_line():
    assert "IfcProject" in refused(ifc_case("noproject"))


@pytest.mark.parametrize("name", ["glass_style", "glass_material", "glass_layers", "glass_name"])
def test_glass_by_whatever_the_file_says(name):
    scene = read(ifc_case(name))
    (pane,) = (placed for placed in scene.objects if "artition" in placed.name)
    assert_house(scene)
    assert pane.role is Role.TRANSPARENT and pane.why.startswith("glass: ")
    assert sum(placed.role is Role.OCCLUDER for placed in scene.objects) == 9


def test_rooms_by_their_boxes_and_rooms_without_any():
    scene = read(ifc_case("space_box"))
    (lost,) = scene.skipped
    assert "'west'" in lost["what"] and "Box" in lost["why"] and scene.lost_rooms == [lost["what"]]
    (west,) = (space for space in scene.spaces if space.name == "west")
    np.testing.assert_allclose(np.ptp(west.vertices, axis=0), (3.75, 4, 3))
    np.testing.assert_allclose(west.vertices.min(axis=0) + scene.origin, (0, 0, 0))
    half, none = read(ifc_case("space_half")), read(ifc_case("space_nogeo"))
    assert [space.name for space in half.spaces] == ["west"] and none.spaces == []
    assert [len(scene.lost_rooms) for scene in (half, none)] == [1, 2]
    assert all("no representation" in lost["why"] for lost in half.skipped + none.skipped)


def test_a_stray_is_named_and_left_out_as_asked():
    message = refused(ifc_case("stray"))
    assert "survey point" in message and "--leave-out" in message and "wall" not in message
    scene = read(ifc_case("stray"), leave_out="survey point")
    assert_house(scene, shift=(2_600_000, 1_200_000, 400))
    assert [lost["what"] for lost in scene.skipped] == ["survey point"]
    (note,) = read(ifc_case("stray_near")).notes
    assert "survey point" in note["what"]


def test_far_is_the_house():
    assert_house(read(ifc_case("far")), shift=(2_600_000.25, 1_200_000.5, 400.125))


@pytest.mark.parametrize(("name", "angle_deg"), [("rotated", 30), ("far_rotated", 33)])
def test_turned_is_the_house_turned_and_noted(name, angle_deg):
    scene = read(ifc_case(name))
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    back = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    far = (2_600_000, 1_200_000, 400) if name == "far_rotated" else (0, 0, 0)
    for placed in scene.objects:
        mesh = scene.definitions[placed.definition_id].lods[0]
        points = (mesh.vertices @ placed.transform[:3, :3].T + placed.transform[:3, 3] + scene.origin - far) @ back.T
        found = [points.min(axis=0), points.max(axis=0)]
        np.testing.assert_allclose(found, HOUSE[placed.name], atol=1e-3, err_msg=placed.name)
    assert len(scene.objects) == 12 and len(scene.spaces) == 2
    # As a bake reads it, it stands along the axes.
    back = read(ifc_case(name), yaw="auto")
    assert back.yaw_deg == pytest.approx(angle_deg, abs=1e-5) and f"{angle_deg} degrees" in back.notes[-1]["why"]
    walls = {
        placed.name: np.ptp(box, axis=0) * GRID_M
        for placed, box in zip(back.objects, back.object_bounds(), strict=True)
    }
    for name, size in walls.items():
        np.testing.assert_allclose(size, np.ptp(HOUSE[name], axis=0), atol=2e-3, err_msg=name)


def test_parts_of_a_wall_are_wall():
    scene = read(ifc_case("parts_void"))
    assert_house(scene, but=MIDDLE)
    layers = [placed for placed in scene.objects if placed.name.startswith("layer")]
    assert [layer.role for layer in layers] == [Role.OCCLUDER] * 2
    assert all((scene.triangles()[1] == scene.objects.index(layer)).sum() > 12 for layer in layers)  # the hole is cut


def test_parts_of_furniture_are_detail(tmp_path):
    step = house("IFC4")
    part = step.box("IfcBuildingElementPart", "top", (500_001_000.0, 2000, 0), (500, 500, 900), ",$,$")
    desk = step.add(f"IFCFURNITURE('{len(step.lines):022d}',$,'desk',$,$,$,$,$,$)")
    step.relate("IfcRelAggregates", desk, f"({part})")
    assert by_name(read(step.write(tmp_path / "a.ifc")))["top"][1] is Role.DETAIL


def test_feet_are_feet(tmp_path):
    """By a unit that is converted, whose name means nothing to us."""
    step = house()
    factor = step.add("IFCMEASUREWITHUNIT(IFCLENGTHMEASURE(0.3048),#1)")
    size = step.add("IFCDIMENSIONALEXPONENTS(1,0,0,0,0,0,0)")
    step.lines[0] = "#1=IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.);"
    foot = step.add(f"IFCCONVERSIONBASEDUNIT({size},.LENGTHUNIT.,'FOOT',{factor})")
    step.lines[1] = f"#2=IFCUNITASSIGNMENT(({foot}));"
    text = step.write(tmp_path / "a.ifc").read_text().replace("50000", "")
    (tmp_path / "a.ifc").write_text(text)
    scene = read(tmp_path / "a.ifc", grid_m=1.0)
    assert scene.unit == "foot"
    np.testing.assert_allclose(np.ptp(boxes(scene)["wall"], axis=0), np.array([4000, 200, 3000]) * 0.3048, atol=2)


def test_faces_have_the_colour_of_their_style(tmp_path):
    step = house()
    far = (500_000_000.0, 9000, 0)
    step.box("IfcColumn", "half", far, (600, 600, 3000), ",$", (0.8, None))
    scene = read(step.write(tmp_path / "a.ifc"))
    colours = {placed.name: scene.definitions[placed.definition_id].lods[0].colours for placed in scene.objects}
    assert colours["wall"] is None
    assert colours["half"].dtype == np.uint8 and colours["half"].shape == (24, 4)
    assert {tuple(row) for row in colours["half"].tolist()} == {(128, 153, 178, 51), (179, 179, 179, 255)}


SAME = """
import os, sys
os.cpu_count = lambda: int(sys.argv[1])
from viewcell.data.readers import read
for path in sys.argv[2:]:
    scene = read(path)
    print(scene.sha256, [(o.name, o.guid, o.kind, o.role.value, o.definition_id) for o in scene.objects])
    print(scene.object_bounds().tolist(), scene.triangles()[0].sum(axis=(1, 2)).tolist(), scene.skipped, scene.notes)
    print([(s.name, s.vertices.tolist()) for s in scene.spaces], scene.openings.tolist())
"""


def test_two_processes_read_the_same():
    """Whatever the seed of hashes and the number of threads."""
    paths = [str(ifc_case(name)) for name in ("two_bodies", "dup_guid", "parts_void", "norepitems", "space_half")]
    read_by = [
        subprocess.run(
            [sys.executable, "-c", SAME, threads, *paths],
            env=os.environ | {"PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed, threads in (("1", "1"), ("2", "4"))
    ]
    assert read_by[0] == read_by[1] and read_by[0].count("\n") == 3 * len(paths)


def test_what_is_no_thing_is_counted(tmp_path):
    step = house("IFC4")
    step.box("IfcSpatialZone", "zone", (500_000_000.0, 2000, 0), (500, 500, 900), ",$,$")
    scene = read(step.write(tmp_path / "a.ifc"))
    assert [lost["what"] for lost in scene.skipped] == ["1 IfcSpatialZone"] and "zone" not in boxes(scene)


def test_an_archive_with_one_file_is_read(tmp_path):
    path = tmp_path / "a.ifczip"
    with ZipFile(path, "w") as archive:
        archive.write(house().write(tmp_path / "a.ifc"), "inside/a.IFC")
        archive.writestr("readme.txt", "not this")
    assert by_name(read(path)) == by_name(read(tmp_path / "a.ifc"))


SEEDS = [*range(25), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(25, 500))]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_damaged_file_is_a_scene_or_one_line(tmp_path, seed):
    """Of two files: of the house most accidents are refused, of a file of few words many are not."""
    for number, path in enumerate((ifc_case("base"), house().write(tmp_path / "sound.ifc"))):
        damaged = tmp_path / f"{number}.ifc"
        damaged.write_bytes(mutated(path.read_bytes(), seed))
        try:
            scene = read(damaged)
        except InputError as error:
            assert "\n" not in str(error)
        else:
            assert scene.objects
