import ifcopenshell
import pytest
from builders.step_house import house
from viewcell.data.readers import read
from viewcell.data.readers.ifc_materials import glass_material
from viewcell.data.readers.roles import RoleRules
from viewcell.data.scene import Role


class Made:
    """A wall of IFC4 and what it is made of."""

    def __init__(self):
        self.file = ifcopenshell.file(schema="IFC4")
        self.wall = self.file.create_entity("IfcWall", GlobalId="0" * 22)

    def material(self, name: str, transparency: float | None = None, style: str = "paint"):
        material = self.file.create_entity("IfcMaterial", Name=name)
        if transparency is not None:
            colour = self.file.create_entity("IfcColourRgb", None, 0.5, 0.5, 0.5)
            shading = self.file.create_entity("IfcSurfaceStyleShading", colour, transparency)
            styled = self.file.create_entity("IfcSurfaceStyle", style, "BOTH", (shading,))
            item = self.file.create_entity("IfcStyledItem", None, (styled,))
            drawn = self.file.create_entity("IfcStyledRepresentation", Items=(item,))
            self.file.create_entity(
                "IfcMaterialDefinitionRepresentation", Representations=(drawn,), RepresentedMaterial=material
            )
        return material

    def layers(self, *layers):
        made = [self.file.create_entity("IfcMaterialLayer", Material=m, LayerThickness=t) for m, t in layers]
        return self.file.create_entity("IfcMaterialLayerSet", MaterialLayers=made)

    def why(self, material, owner=None) -> str:
        link = {"GlobalId": "1" * 22, "RelatedObjects": (owner or self.wall,), "RelatingMaterial": material}
        self.file.create_entity("IfcRelAssociatesMaterial", **link)
        return glass_material(self.wall, RoleRules(), 1.0)


GLASS = ["Glass", "Glas", "Verre", "Vetro", "Vidrio", "Verglasung", "Glas_klar", "Plexiglas", "Double glazing"]
NO_GLASS = [
    "Brick",
    "Glass wool",
    "Glaswolle",
    "Laine de verre",
    "Lana di vetro",
    "Schaumglas",
    "Glass fibre",
    "Glasgow",
]


@pytest.mark.parametrize("name", GLASS + NO_GLASS)
def test_materials_by_their_names(name):
    made = Made()
    assert bool(made.why(made.material(name))) is (name in GLASS)


@pytest.mark.parametrize(("transparency", "style", "glass"), [(0.5, "a", True), (0.0, "a", False), (0.0, "Glas", True)])
def test_materials_by_their_styles(transparency, style, glass):
    made = Made()
    assert bool(made.why(made.material("a 1", transparency, style))) is glass


LAYERS = {
    "a pane": ((("Glass", 0.01),), True),
    "two panes": ((("Glass", 0.006), ("Luft", 0.012), ("Glass", 0.006)), True),
    "two panes and nothing": ((("Glass", 0.006), (None, 0.012), ("Glass", 0.006)), True),
    "a foil between": ((("Glass", 0.006), ("PVB", 0.0015), ("Glass", 0.006)), True),
    "a wall behind": ((("Glass", 0.006), ("Air", 0.03), ("Concrete", 0.2)), False),
    "no glass": ((("Air", 0.03), ("Concrete", 0.2)), False),
}


@pytest.mark.parametrize("what", LAYERS)
@pytest.mark.parametrize("usage", [True, False])
def test_light_passes_what_has_no_opaque_layer(what, usage):
    made, (layers, glass) = Made(), LAYERS[what]
    layers = made.layers(*((name and made.material(name), thickness) for name, thickness in layers))
    if usage:
        layers = made.file.create_entity("IfcMaterialLayerSetUsage", layers, "AXIS2", "POSITIVE", 0.0)
    assert bool(made.why(layers)) is glass


@pytest.mark.parametrize("kind", ["list", "constituents", "profiles"])
def test_one_of_glass_is_enough_where_nobody_knows_which_faces_are_its(kind):
    made = Made()
    both = [made.material(name) for name in ("Steel", "Glass")]
    if kind == "list":
        whole = made.file.create_entity("IfcMaterialList", both)
    elif kind == "constituents":
        parts = [made.file.create_entity("IfcMaterialConstituent", Material=one) for one in both]
        whole = made.file.create_entity("IfcMaterialConstituentSet", MaterialConstituents=parts)
    else:
        outline = made.file.create_entity("IfcProfileDef", "AREA")
        parts = [made.file.create_entity("IfcMaterialProfile", Material=one, Profile=outline) for one in both]
        whole = made.file.create_entity("IfcMaterialProfileSet", MaterialProfiles=parts)
    assert "'Glass'" in made.why(whole)


def test_a_type_has_materials_for_its_products_and_these_come_first():
    made = Made()
    kind = made.file.create_entity("IfcWallType", GlobalId="2" * 22, PredefinedType="STANDARD")
    link = {"GlobalId": "3" * 22, "RelatedObjects": (made.wall,), "RelatingType": kind}
    made.file.create_entity("IfcRelDefinesByType", **link)
    assert made.why(made.material("Glass"), kind)
    assert not made.why(made.material("Brick"))


def test_the_types_name_counts(tmp_path):
    step = house()
    wall = step.box("IfcWall", "W-12", (500_000_000.0, 9000, 0), (4000, 100, 3000))
    kind = step.add(f"IFCWALLTYPE('{len(step.lines):022d}',$,'Glass partition 100',$,$,$,$,$,$,.STANDARD.)")
    step.relate("IfcRelDefinesByType", f"({wall})", kind)
    (made,) = (placed for placed in read(step.write(tmp_path / "a.ifc")).objects if placed.name == "W-12")
    assert made.role is Role.TRANSPARENT and "Glass partition" in made.why
