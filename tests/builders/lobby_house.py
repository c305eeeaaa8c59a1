"""An IFC of four rooms in a row, whose doorways zigzag: the last and the first do not see each other."""

from builders.step_house import Step

WALL, HEIGHT = 200, 3000
# x of the walls across, and y of the gap in those between rooms [mm].
ACROSS = {0: None, 4200: (100, 900), 8400: (3000, 3800), 12600: (100, 900), 16800: None}
ROOMS = {"Lobby": 200, "Office": 4400, "Vault": 8600, "Cellar": 12800}


def lobby_house(path):
    """Write it; lengths in mm, rooms of 4 x 4 x 3 m. Each room has a chest beside its wall to the left."""
    step = Step()

    def box(kind, name, low, high, more=""):
        middle = ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2])
        step.box(kind, name, middle, tuple(b - a for a, b in zip(low, high, strict=True)), more)

    for n, (x, gap) in enumerate(ACROSS.items()):
        for m, (y, end) in enumerate([(0, 4000)] if gap is None else [(0, gap[0]), (gap[1], 4000)]):
            box("IfcWallStandardCase", f"wall {n}{m}", (x, y, 0), (x + WALL, end, HEIGHT))
    for n, y in enumerate((-WALL, 4000)):
        box("IfcWallStandardCase", f"side {n}", (0, y, 0), (17000, y + WALL, HEIGHT))
    for name, z in (("floor", -200), ("ceiling", HEIGHT)):
        box("IfcSlab", name, (0, -WALL, z), (17000, 4200, z + 200), ",$,.FLOOR.")
    for name, x in ROOMS.items():
        box("IfcSpace", name, (x, 0, 0), (x + 4000, 4000, HEIGHT), ",$,.ELEMENT.,.INTERNAL.,$")
        box("IfcFurnishingElement", f"chest of {name}", (x + 50, 1500, 0), (x + 550, 2200, 700))
    return step.write(path)
