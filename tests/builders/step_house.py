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
