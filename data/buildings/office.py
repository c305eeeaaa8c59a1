"""Synthetic office buildings of any size, and one with the statistics of Soda Hall."""

import numpy as np

from ..errors import InputError
from ..scene import GRID_M, Instance, Scene
from .furnish import Room, Slots, free_slots
from .furniture import FURNITURE, PIECES
from .plans import office_plan, soda_hall_plan
from .shell import Shell
from .statistics import level_statistics

MODELS = (None, "soda-hall")
# Area in m2 for each piece of furniture, hosts before what stands on them.
AREA_M2 = {
    "desk": 12.0,
    "shelf": 16.0,
    "table": 30.0,
    "plant": 40.0,
    "sofa": 60.0,
    "chair": 8.0,
    "terminal": 18.0,
    "lamp": 20.0,
    "telephone": 24.0,
    "tumbler": 12.0,
    "pencil": 8.0,
    "book": 2.0,
}
# Funkhouser et al. 1996, Table 1: objects that have at least 1, 2, ... 5 levels, and polygons of the coarsest.
SODA_OBJECTS = (14478, 3954, 2497, 949, 437)
SODA_COARSEST_POLYGONS = 240149


def make_office(
    *,
    floors: int = 3,
    rooms_per_side: int = 8,
    seed: int = 0,
    like: str | None = None,
    furnished: bool = True,
    grid_m: float = GRID_M,
) -> Scene:
    """An office building whose walls are axial and exact on the grid.

    Every floor, north up (o: office, d: door, =: window, the stair and the open-plan area half way along):

        +==+==+==+==+-----+==+==+==+==+==+
        | o| o| o| o|stair|m | o| o| o| o|      m: meeting room
        +d-+d-+d-+d-+--d--+d-+d-+d-+d-+d-+
        d             corridor           =      d: ground floor only
        +d-+d-+d-+d-+--   --+d-+d-+d-+d-+
        | o| o| o| o|  open | o| o| o| o|
        +==+==+==+==+==d====+==+==+==+==+

    Walls, slabs, stairs and the roof are occluders; furniture is detail, with up to five levels of detail; door leaves
    and panes are transparent. Rooms are spaces; doors, windows and voids are openings. About half of the doors have a
    window beside them, and some rooms a door to the next one.

    Args:
        floors: number of storeys, 1 to 100.
        rooms_per_side: offices on each side of the corridor, 1 to 500.
        seed: decides inner windows and doors, and where furniture stands.
        like: "soda-hall" for 7 floors of 32 offices around laboratories, class rooms and an atrium, with 14,478 objects
            and the polygons of each level of detail as in Table 1 of Funkhouser et al. 1996, within 5 %; `floors`,
            `rooms_per_side` and `furnished` then have no effect.
        furnished: whether furniture stands in the rooms.
        grid_m: grid step [m].

    Returns:
        The same scene for the same arguments, on every machine.

    Raises:
        InputError: a number is out of range or `like` is unknown.
    """
    if like not in MODELS:
        raise InputError(f"like: expected soda-hall or nothing, found {like!r}")
    if seed < 0:
        raise InputError(f"seed: expected 0 or more, found {seed}")
    rng = np.random.default_rng(seed)
    shell = Shell(office_plan(floors, rooms_per_side) if like is None else soda_hall_plan(), rng)
    shell.build()
    source = f"make_office(floors={floors}, rooms_per_side={rooms_per_side}, seed={seed}, furnished={furnished})"
    scene = Scene(
        definitions=shell.definitions,
        objects=shell.objects,
        spaces=shell.spaces(),
        openings=np.array(shell.openings).reshape(-1, 2, 3),
        grid_m=grid_m,
        source=source if like is None else f"make_office(like={like!r}, seed={seed})",
    )
    if furnished or like:
        slots = free_slots(shell.rooms(), shell.door_faces, rng)
        wanted = _soda_numbers(scene, slots) if like else _numbers(shell.rooms(), slots)
        _furnish(scene, slots, wanted)
    return scene


def _furnish(scene: Scene, slots: Slots, wanted: dict[str, int]) -> None:
    """Place so many of each piece, in the order given."""
    first = len(scene.definitions)
    scene.definitions.extend(piece.definition() for piece in FURNITURE)
    ids = {piece.name: first + i for i, piece in enumerate(FURNITURE)}
    placed: list[Instance] = []
    for name, count in wanted.items():
        if name == "terminal":  # all hosts stand: what follows is spread over them
            slots.mix_tops()
        placed += slots.place(name, count, ids[name])
    scene.objects.extend(placed)


def _numbers(rooms: list[Room], slots: Slots) -> dict[str, int]:
    """Furniture for a building of this area."""
    area = sum(room.area for room in rooms if room.furnished)
    wanted = {name: max(1, round(area / each)) for name, each in AREA_M2.items()}
    return wanted | _fixed(slots)


def _fixed(slots: Slots) -> dict[str, int]:
    """A handle on each face of a door, and a lamp at each place for one."""
    return {name: len(slots.free[PIECES[name].place]) for name in ("door handle", "ceiling lamp")}


def _soda_numbers(scene: Scene, slots: Slots) -> dict[str, int]:
    """Furniture that brings the building to Soda Hall's objects at each level, and its polygons at the coarsest."""
    fixed = _fixed(slots)
    fifth = SODA_OBJECTS[4]
    fourth, third, second = (SODA_OBJECTS[i] - SODA_OBJECTS[i + 1] for i in (3, 2, 1))
    second -= fixed["door handle"]
    wanted = {"desk": round(0.52 * second), "shelf": round(0.3 * second)}
    wanted["table"] = second - wanted["desk"] - wanted["shelf"]
    wanted |= {"plant": fifth // 2, "sofa": fifth - fifth // 2, "chair": round(0.7 * third)}
    wanted |= {"terminal": fourth // 2, "lamp": fourth - fourth // 2, "telephone": third - wanted["chair"]}
    wanted |= fixed
    # Books and pencils make up the rest: so many that objects and coarsest polygons both come out.
    coarsest = {piece.name: len(piece.definition().lods[-1].faces) for piece in FURNITURE}
    polygons = SODA_COARSEST_POLYGONS - level_statistics(scene)[0].polygons
    polygons -= sum(coarsest[name] * count for name, count in wanted.items())
    small = SODA_OBJECTS[0] - len(scene.objects) - sum(wanted.values())
    pencils = round((polygons - coarsest["book"] * small) / (coarsest["pencil"] - coarsest["book"]))
    pencils = min(max(pencils, 0), small)
    return wanted | {"pencil": pencils, "book": small - pencils}
