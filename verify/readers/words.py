"""What is said of objects and rooms in words, as a second reader finds it, against a scene: storeys and materials."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from ...data.scene import NamedStorey, Scene

# Two ways from a file's unit to metres round differently by no more than this share.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Told:
    """What a file says of one object or room.

    Attributes:
        key: its GUID, or what the format has in its place.
        name: of a room; of objects it is not compared.
        long_name: likewise.
        storey: name and elevation [m], which may be None; None where it says none.
        materials: names, of objects.
    """

    key: str
    name: str = ""
    long_name: str = ""
    storey: tuple[str, float | None] | None = None
    materials: tuple[str, ...] = ()


def word_differences(scene: Scene, objects: Iterable[Told], rooms: Iterable[Told]) -> list[str]:
    """What a scene says otherwise than a second reader found, one line each.

    Args:
        scene: as read.
        objects: of all things in the file that have a key, whether or not they have a shape.
        rooms: likewise.
    """
    ours = [Told(one.guid, storey=_pair(one.storey), materials=one.materials) for one in scene.objects]
    own_rooms = [Told(one.guid, one.name, one.long_name, _pair(one.storey)) for one in scene.spaces]
    return [*_compare("", ours, objects), *_compare("room ", own_rooms, rooms)]


def _pair(storey: NamedStorey | None) -> tuple[str, float | None] | None:
    return None if storey is None else (storey.name, storey.elevation_m)


def _compare(what: str, ours: list[Told], theirs: Iterable[Told]) -> list[str]:
    known, lines = defaultdict(list), []
    for one in theirs:
        known[one.key].append(one)
    for one in ours:
        # Without a key nobody knows which it is; several may share one.
        if not one.key or any(_same(one, other) for other in known[one.key]):
            continue
        wanted = _text(known[one.key][0]) if known[one.key] else "nothing of that name"
        lines.append(f"{what}{one.key!r}: expected {wanted} as a second reader finds, found {_text(one)}")
    return lines


def _same(one: Told, other: Told) -> bool:
    if (one.name, one.long_name, one.materials) != (other.name, other.long_name, other.materials):
        return False
    if one.storey is None or other.storey is None:
        return one.storey == other.storey
    (name, a), (other_name, b) = one.storey, other.storey
    if name != other_name or a is None or b is None:
        return one.storey == other.storey
    return abs(a - b) <= ROUNDING * max(abs(a), abs(b))


def _text(told: Told) -> str:
    storey = "no storey" if told.storey is None else f"the storey {told.storey[0]!r} at {told.storey[1]} m"
    names = f"the names {told.name!r} and {told.long_name!r}, " if told.name or told.long_name else ""
    return f"{names}{storey}{', of ' + ', '.join(map(repr, told.materials)) if told.materials else ''}"
