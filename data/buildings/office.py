"""Synthetic office buildings of any size, and one with the statistics of Soda Hall."""

import numpy as np

from ..errors import InputError
from ..scene import GRID_M, Scene
from .furnish import Slots, fixed_pieces, free_slots, furniture_shapes, placed_pieces, turned, wanted_pieces
from .furniture import FURNITURE
from .plans import Plan, office_plan, soda_hall_plan
from .shell import OUTER_WALL_M, Shell
from .statistics import level_statistics
from .wings import LETTERS, build_foyer, join_wings
from .works import Works

MODELS = (None, "soda-hall")
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
    yaw_deg: float = 0.0,
    wings: int = 1,
    wing_angle_deg: float = 30.0,
    grid_m: float = GRID_M,
) -> Scene:
    """An office building; its walls are axial and exact on the grid, unless it is turned or has wings.

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
        yaw_deg: the building is turned by this, counter-clockwise about its south-west corner [degrees].
        wings: offices that are joined by foyers at the ends of their corridors, 1 to 12; not beside `like`.
        wing_angle_deg: by which each is turned relative to the one before, -120 to 120 [degrees].
        grid_m: grid step [m].

    Returns:
        The same scene for the same arguments, on every machine.

    Raises:
        InputError: a number is out of range, `like` is unknown, or wings would overlap.
    """
    if like not in MODELS:
        raise InputError(f"like: expected soda-hall or nothing, found {like!r}")
    if seed < 0:
        raise InputError(f"seed: expected 0 or more, found {seed}")
    if not abs(yaw_deg) <= 360.0:
        raise InputError(f"yaw_deg: expected degrees up to 360, found {yaw_deg:g}")
    if like and wings != 1:
        raise InputError(f"wings: expected 1 beside like {like!r}, found {wings}")
    rng = np.random.default_rng(seed)
    plan = office_plan(floors, rooms_per_side) if like is None else soda_hall_plan()
    size = Shell(plan, rng).footprint()
    frames, joints = join_wings(size, wings, wing_angle_deg, turned(np.zeros(3), np.radians(yaw_deg)))
    source = f"make_office(floors={floors}, rooms_per_side={rooms_per_side}, seed={seed}, furnished={furnished})"
    source = source if like is None else f"make_office(like={like!r}, seed={seed})"
    if wings == 1 and yaw_deg == 0.0:
        return _wing(plan, rng, (False, False), furnished, like, grid_m, source)
    works = Works()
    for number, frame in enumerate(frames):
        joined = number > 0, number < wings - 1
        name = f"{LETTERS[number]} " if wings > 1 else ""
        works.take(_wing(plan, rng, joined, furnished, like, grid_m, ""), frame, name)
    for number, joint in enumerate(joints):
        name = f"{LETTERS[number]}-{LETTERS[number + 1]} foyer"
        build_foyer(works, joint, name, Shell(plan, rng).levels(), OUTER_WALL_M)
    turn = f", yaw_deg={yaw_deg:g}, wings={wings}, wing_angle_deg={wing_angle_deg:g})"
    return works.scene(source.removesuffix(")") + turn, grid_m)


def _wing(
    plan: Plan,
    rng: np.random.Generator,
    joined: tuple[bool, bool],
    furnished: bool,
    like: str | None,
    grid_m: float,
    source: str,
) -> Scene:
    """One office on the axes, `joined` to others at its west and its east end."""
    shell = Shell(plan, rng, joined)
    shell.build()
    scene = Scene(
        definitions=shell.definitions,
        objects=shell.objects,
        spaces=shell.spaces(),
        openings=np.array(shell.openings).reshape(-1, 2, 3),
        grid_m=grid_m,
        source=source,
    )
    if furnished or like:
        slots = free_slots(shell.rooms(), shell.door_faces, rng)
        wanted = _soda_numbers(scene, slots) if like else wanted_pieces(shell.rooms(), slots)
        first = len(scene.definitions)
        scene.definitions.extend(furniture_shapes())
        scene.objects.extend(placed_pieces(slots, wanted, first))
    return scene


def _soda_numbers(scene: Scene, slots: Slots) -> dict[str, int]:
    """Furniture that brings the building to Soda Hall's objects at each level, and its polygons at the coarsest."""
    fixed = fixed_pieces(slots)
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
