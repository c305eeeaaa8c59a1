"""A small gbXML file written by hand: one room of 4 x 3 x 2.5, a window, a door, and a shade before it."""

SIDES = {
    "floor": ("SlabOnGrade", [(0, 0, 0), (0, 3, 0), (4, 3, 0), (4, 0, 0)]),
    "roof": ("Roof", [(0, 0, 2.5), (4, 0, 2.5), (4, 3, 2.5), (0, 3, 2.5)]),
    "south": ("ExteriorWall", [(0, 0, 0), (4, 0, 0), (4, 0, 2.5), (0, 0, 2.5)]),
    "north": ("ExteriorWall", [(4, 3, 0), (0, 3, 0), (0, 3, 2.5), (4, 3, 2.5)]),
    "west": ("ExteriorWall", [(0, 3, 0), (0, 0, 0), (0, 0, 2.5), (0, 3, 2.5)]),
    "east": ("ExteriorWall", [(4, 0, 0), (4, 3, 0), (4, 3, 2.5), (4, 0, 2.5)]),
    "shade": ("Shade", [(0, -2, 2.5), (4, -2, 2.5), (4, -1, 2.5), (0, -1, 2.5)]),
}
OPENINGS = {
    "window": ("south", "FixedWindow", [(1, 0, 1), (2, 0, 1), (2, 0, 2), (1, 0, 2)]),
    "door": ("south", "NonSlidingDoor", [(3, 0, 0), (3.9, 0, 0), (3.9, 0, 2), (3, 0, 2)]),
    "hatch": ("north", "Air", [(2, 3, 0), (1, 3, 0), (1, 3, 2), (2, 3, 2)]),
}


def loop(ring: list) -> str:
    points = ("".join(f"<Coordinate>{x}</Coordinate>" for x in point) for point in ring)
    return "<PolyLoop>" + "".join(f"<CartesianPoint>{point}</CartesianPoint>" for point in points) + "</PolyLoop>"


def gbxml(
    sides: dict = SIDES,
    openings: dict = OPENINGS,
    unit: str = 'lengthUnit="Meters"',
    shell: bool = True,
    head: str = "",
) -> str:
    """The file's text."""
    surfaces = ""
    for key, (kind, ring) in sides.items():
        inside = "".join(
            f'<Opening id="{name}" openingType="{what}"><PlanarGeometry>{loop(hole)}</PlanarGeometry>'
            f"<Name>the {name}</Name></Opening>"
            for name, (of, what, hole) in openings.items()
            if of == key
        )
        room = "" if kind == "Shade" else '<AdjacentSpaceId spaceIdRef="s1"/>'
        surfaces += f'<Surface id="{key}" surfaceType="{kind}">{room}<PlanarGeometry>{loop(ring)}</PlanarGeometry>'
        surfaces += f"{inside}<Name>the {key}</Name></Surface>"
    loops = "".join(loop(ring) for kind, ring in sides.values() if kind != "Shade")
    volume = f"<ShellGeometry><ClosedShell>{loops}</ClosedShell></ShellGeometry>" if shell else ""
    space = f'<Building id="b"><Space id="s1"><Name>kitchen</Name>{volume}</Space></Building>'
    root = f'<gbXML xmlns="http://www.gbxml.org/schema" {unit} version="6.01">'
    return f'<?xml version="1.0"?>{head}{root}<Campus id="c">{space}{surfaces}</Campus></gbXML>'
