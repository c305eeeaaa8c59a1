from pathlib import Path

import numpy as np
import pytest
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


class Step:
    """A small IFC2x3 file in millimetres: boxes extruded from rectangles."""

    def __init__(self, schema: str = "IFC2X3"):
        self.schema = schema
        self.lines = [
            "#1=IFCSIUNIT(*,.LENGTHUNIT.,.MILLI.,.METRE.);",
            "#2=IFCUNITASSIGNMENT((#1));",
            "#3=IFCCARTESIANPOINT((0.,0.,0.));",
            "#4=IFCAXIS2PLACEMENT3D(#3,$,$);",
            "#5=IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-5,#4,$);",
            "#6=IFCPROJECT('0000000000000000000000',$,'p',$,$,$,$,(#5),#2);",
            "#7=IFCCARTESIANPOINT((0.,0.));",
            "#8=IFCAXIS2PLACEMENT2D(#7,$);",
            "#9=IFCDIRECTION((0.,0.,1.));",
        ]

    def add(self, text: str) -> str:
        self.lines.append(f"#{len(self.lines) + 1}={text};")
        return f"#{len(self.lines)}"

    def solid(self, size: tuple, transparency: float | None = None) -> str:
        """A box, in a colour that lets so much light pass."""
        x, y, z = (float(length) for length in size)
        profile = self.add(f"IFCRECTANGLEPROFILEDEF(.AREA.,$,#8,{x},{y})")
        solid = self.add(f"IFCEXTRUDEDAREASOLID({profile},#4,#9,{z})")
        if transparency is not None:
            colour = self.add("IFCCOLOURRGB($,0.5,0.6,0.7)")
            through = f"{colour},{transparency:.4f},$,$,$,$,$,$,.NOTDEFINED."
            style = self.add(f"IFCSURFACESTYLERENDERING({through})")
            style = self.add(f"IFCSURFACESTYLE('paint',.BOTH.,({style}))")
            if self.schema.upper().startswith("IFC2"):
                style = self.add(f"IFCPRESENTATIONSTYLEASSIGNMENT(({style}))")
            self.add(f"IFCSTYLEDITEM({solid},({style}),$)")
        return solid

    def shape(self, size: tuple, *transparencies: float | None) -> str:
        """A representation of boxes side by side, one for each transparency, or a single one without a colour."""
        solids = ",".join(self.solid(size, transparency) for transparency in transparencies or (None,))
        return self.add(f"IFCSHAPEREPRESENTATION(#5,'Body','SweptSolid',({solids}))")

    def box(self, kind: str, name: str, middle: tuple, size: tuple, more: str = ",$", paint: tuple = ()) -> str:
        """A product whose box stands on `middle`."""
        shape = self.add(f"IFCPRODUCTDEFINITIONSHAPE($,$,({self.shape(size, *paint)}))")
        point = self.add("IFCCARTESIANPOINT((" + ",".join(str(float(x)) for x in middle) + "))")
        place = self.add(f"IFCLOCALPLACEMENT($,{self.add(f'IFCAXIS2PLACEMENT3D({point},$,$)')})")
        name = name if name == "*" else f"'{name}'"
        return self.add(f"{kind.upper()}('{len(self.lines):022d}',$,{name},$,$,{place},{shape}{more})")

    def relate(self, kind: str, one: str, other: str) -> None:
        self.add(f"{kind.upper()}('{len(self.lines):022d}',$,$,$,{one},{other})")

    def write(self, path: Path) -> Path:
        head = "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n"
        head += f"FILE_SCHEMA(('{self.schema}'));\nENDSEC;\nDATA;\n"
        path.write_text(head + "\n".join(self.lines) + "\nENDSEC;\nEND-ISO-10303-21;\n")
        return path


def house(schema: str = "IFC2X3", wall_name: str = "wall") -> Step:
    """A wall of 4 x 0.2 x 3 m with a door, a room, a slab and two chairs, 500 km from the origin."""
    far = np.array([500_000_000.0, 0.0, 0.0])
    step = Step(schema)
    wall = step.box("IfcWallStandardCase", wall_name, far, (4000, 200, 3000))
    void = step.box("IfcOpeningElement", "void", far, (1000, 300, 2000))
    door = step.box("IfcDoor", "door", far, (900, 50, 1900), ",$,$,$")
    step.relate("IfcRelVoidsElement", wall, void)
    step.relate("IfcRelFillsElement", void, door)
    step.box("IfcSpace", "room", far + np.array([0, 2000, 0]), (4000, 3800, 3000), ",$,.ELEMENT.,.INTERNAL.,$")
    step.box("IfcSlab", "slab", far + np.array([0, 2000, -300]), (4000, 4200, 300), ",$,.FLOOR.")
    step.box("IfcFurnishingElement", "chair", far + np.array([1000, 2000, 0]), (500, 500, 900))
    return step


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
