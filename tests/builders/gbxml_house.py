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

# What the file says with `told`: a room above without a body, two storeys after the rooms that are on them, and layers.
STOREYS = (
    '<Space id="s2" buildingStoreyIdRef="u"><Name>loft</Name></Space>'
    '<BuildingStorey id="g"><Name>Ground</Name><Level>-1.5</Level></BuildingStorey>'
    '<BuildingStorey id="u"><Level>low</Level></BuildingStorey>'
)
MADE = {"south": "wall", "north": "wall", "shade": "sheet"}
LAYERS = (
    '<Construction id="wall"><LayerId layerIdRef="l1"/><LayerId layerIdRef="l2"/></Construction>'
    '<Construction id="sheet"><LayerId layerIdRef="l2"/></Construction>'
    '<Layer id="l1"><MaterialId materialIdRef="m1"/><MaterialId materialIdRef="m2"/></Layer>'
    '<Layer id="l2"><MaterialId materialIdRef="m1"/></Layer>'
    '<Material id="m1"><Name>brick &amp; clay</Name></Material><Material id="m2"/>'
)


def loop(ring: list) -> str:
    points = ("".join(f"<Coordinate>{x}</Coordinate>" for x in point) for point in ring)
    return "<PolyLoop>" + "".join(f"<CartesianPoint>{point}</CartesianPoint>" for point in points) + "</PolyLoop>"


def gbxml(
    sides: dict = SIDES,
    openings: dict = OPENINGS,
    unit: str = 'lengthUnit="Meters"',
    shell: bool = True,
    head: str = "",
    told: bool = False,
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
        # As some tools mend files; the roof bounds a room of another storey, too.
        room = room.replace("/>", ' xmlns=""/>') if told and key == "west" else room
        room += '<AdjacentSpaceId spaceIdRef="s2"/>' if told and key == "roof" else ""
        made = f' constructionIdRef="{MADE[key]}"' if told and key in MADE else ""
        surfaces += (
            f'<Surface id="{key}" surfaceType="{kind}"{made}>{room}<PlanarGeometry>{loop(ring)}</PlanarGeometry>'
        )
        surfaces += f"{inside}<Name>the {key}</Name></Surface>"
    loops = "".join(loop(ring) for kind, ring in sides.values() if kind != "Shade")
    volume = f"<ShellGeometry><ClosedShell>{loops}</ClosedShell></ShellGeometry>" if shell else ""
    on = ' buildingStoreyIdRef="g"' if told else ""
    space = f'<Space id="s1"{on}><Name>kitchen</Name>{volume}</Space>'
    space = f'<Building id="b">{space}{STOREYS if told else ""}</Building>'
    root = f'<gbXML xmlns="http://www.gbxml.org/schema" {unit} version="6.01">'
    return f'<?xml version="1.0"?>{head}{root}<Campus id="c">{space}{surfaces}</Campus>{LAYERS if told else ""}</gbXML>'
