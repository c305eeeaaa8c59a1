"""Small IFC files written by hand."""

from pathlib import Path

import numpy as np


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


GROUND, UPPER = ("Sockel \u00e4", -0.12), ("upper", None)
# Storey (name and elevation) and materials of the things of `told_house`, by their names.
TOLD = {
    "wall": (GROUND, ("brick", "it's plaster")),
    "door": (GROUND, ()),
    "slab": (UPPER, ("concrete", "steel")),
    "chair": (GROUND, ("oak",)),
    "lamp": (None, ()),
}
TOLD_IFC4 = TOLD | {"door": (GROUND, ("oak", "felt")), "lamp": (None, ("steel",))}


def told_house(schema: str = "IFC2X3") -> Step:
    """The house on two storeys: contained, in a room, as part of a roof, filling a hole, and not at all; of materials.

    Layers, one of them air and one twice, a list, of the type, of the type too though the own ones go before; in IFC4
    constituents and profiles. Names have signs that STEP writes in its own ways.
    """
    step = house(schema)
    of = {}
    for line in step.lines:
        number, _, text = line.partition("=")
        parts = text.split("(", 1)[-1].split(",")
        if len(parts) > 2 and parts[2].startswith("'"):
            of[parts[2].strip("'")] = number
    lamp = step.box("IfcFurnishingElement", "lamp", (500_001_000.0, 3000.0, 0.0), (300, 300, 1500))
    # A room has its long name where other products have nothing: the eighth value.
    place = next(i for i, line in enumerate(step.lines) if line.startswith(of["room"] + "="))
    head, tail = step.lines[place].rsplit(",$,.ELEMENT.", 1)
    step.lines[place] = f"{head},'Stube \\S\\d \\X\\DF \\X4\\0001F3E0\\X0\\',.ELEMENT.{tail}"
    ground, upper = (
        step.add(f"IFCBUILDINGSTOREY('{guid:022d}',$,'{name}',$,$,$,$,'no name',.ELEMENT.,{height})")
        for guid, name, height in ((900, "Sockel \\X2\\00E4\\X0\\", -120.0), (901, "upper", "$"))
    )
    building = step.add(f"IFCBUILDING('{902:022d}',$,'b',$,$,$,$,$,.ELEMENT.,$,$,$)")
    roof = step.add(f"IFCROOF('{903:022d}',$,'roof',$,$,$,$,$,{'.FLAT_ROOF.' if schema == 'IFC2X3' else '$'})")
    step.relate("IfcRelAggregates", building, f"({ground},{upper})")
    step.relate("IfcRelAggregates", ground, f"({of['room']})")
    step.relate("IfcRelAggregates", roof, f"({of['slab']})")
    step.relate("IfcRelContainedInSpatialStructure", f"({of['wall']})", ground)
    step.relate("IfcRelContainedInSpatialStructure", f"({of['chair']})", of["room"])
    step.relate("IfcRelContainedInSpatialStructure", f"({roof})", upper)
    step.relate("IfcRelContainedInSpatialStructure", f"({lamp})", building)
    more = "" if schema == "IFC2X3" else ",$,$"
    brick, plaster, concrete, steel, oak, felt = (
        step.add(f"IFCMATERIAL('{name}'{more})")
        for name in ("brick", "it''s plaster", "concrete", "steel", "oak", "felt")
    )
    more = "" if schema == "IFC2X3" else ",$,$,$,$"
    layers = [step.add(f"IFCMATERIALLAYER({one},50.,$ {more})") for one in (brick, "$", plaster, brick)]
    layers = step.add(f"IFCMATERIALLAYERSET(({','.join(layers)}),$ {'' if schema == 'IFC2X3' else ',$'})")
    usage = step.add(f"IFCMATERIALLAYERSETUSAGE({layers},.AXIS2.,.POSITIVE.,0.{'' if schema == 'IFC2X3' else ',$'})")
    both = step.add(f"IFCMATERIALLIST(({concrete},{steel}))")
    kind = step.add(
        f"IFCFURNITURETYPE('{904:022d}',$,'t',$,$,$,$,$,$,{'.NOTDEFINED.' if schema == 'IFC2X3' else '.NOTDEFINED.,$'})"
    )
    step.relate("IfcRelDefinesByType", f"({of['chair']},{of['slab']})", kind)
    for things, material in ((of["wall"], usage), (of["slab"], both), (kind, oak)):
        step.relate("IfcRelAssociatesMaterial", f"({things})", material)
    if schema != "IFC2X3":
        parts = ",".join(step.add(f"IFCMATERIALCONSTITUENT('part',$,{one},$,$)") for one in (oak, felt))
        profile = step.add(f"IFCMATERIALPROFILE('profile',$,{steel},$,$,$)")
        profile = step.add(f"IFCMATERIALPROFILESET('profiles',$,({profile}),$)")
        for thing, material in (
            (of["door"], step.add(f"IFCMATERIALCONSTITUENTSET('set',$,({parts}))")),
            (lamp, step.add(f"IFCMATERIALPROFILESETUSAGE({profile},$,$)")),
        ):
            step.relate("IfcRelAssociatesMaterial", f"({thing})", material)
    return step
