"""What lies where on each floor: rows of bays with a corridor between each two rows."""

from dataclasses import dataclass

from ..errors import InputError

# Lengths in metres, all multiples of 1/32.
BAY_M = 4.0
ROOM_DEPTH_M = 4.75
CORE_DEPTH_M = 7.75
CORRIDOR_M = 2.25


@dataclass(frozen=True)
class Bay:
    """One room of a row, some units of `BAY_M` wide."""

    kind: str
    units: int = 1


Row = tuple[Bay, ...]


@dataclass(frozen=True)
class Plan:
    """A building.

    Attributes:
        depths: clear depth of each row [m].
        floors: rows of each floor, from the south; rows and units agree on all floors.
    """

    depths: tuple[float, ...]
    floors: tuple[tuple[Row, ...], ...]

    @property
    def units(self) -> int:
        """Length of the building in units of `BAY_M`."""
        return sum(bay.units for bay in self.floors[0][0])


def office_plan(floors: int, rooms_per_side: int) -> Plan:
    """Two rows of offices on one corridor; a stair and a meeting room face an open-plan area half way.

    Raises:
        InputError: fewer than 1 or more than 100 floors, or fewer than 1 or more than 500 rooms per side.
    """
    for what, count, most in (("floors", floors, 100), ("rooms_per_side", rooms_per_side, 500)):
        if not 1 <= count <= most:
            raise InputError(f"{what}: expected 1 to {most}, found {count}")
    half = rooms_per_side // 2
    before, after = (Bay("office"),) * half, (Bay("office"),) * (rooms_per_side - half)
    south = (*before, Bay("open", 2), *after)
    north = (*before, Bay("stair"), Bay("meeting"), *after)
    return Plan((ROOM_DEPTH_M, ROOM_DEPTH_M), ((south, north),) * floors)


def soda_hall_plan() -> Plan:
    """Seven floors in the manner of Soda Hall: offices around a core of laboratories, class rooms and an atrium."""
    offices = (Bay("office"),) * 16
    class_rooms, large, small = (Bay("classroom", 2),) * 2, (Bay("lab", 4),), (Bay("lab", 2),) * 2
    blocks = [(class_rooms, large)] * 3 + [(small, large)] + [(large, large)] * 3
    floors = []
    for west, east in blocks:
        core = (Bay("hall"), Bay("stair"), *west, Bay("atrium", 4), *east, Bay("stair"), Bay("hall"))
        floors.append((offices, core, offices))
    return Plan((ROOM_DEPTH_M, CORE_DEPTH_M, ROOM_DEPTH_M), tuple(floors))
