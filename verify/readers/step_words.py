"""Storeys, long names and materials of an IFC file, from its text alone, by the places of values in the standard.

No library that knows IFC takes part: statements are read one by one, as ISO 10303-21 writes them.
"""

import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cached_property

from .words import Told

STATEMENT = re.compile(r"(?:'[^']*'|/\*.*?\*/|[^';/]|/)*;", re.DOTALL)
ENTITY = re.compile(r"\s*#(\d+)\s*=\s*(\w+)\s*\((.*)\)\s*;", re.DOTALL)
ASIDE = re.compile(r"/\*.*?\*/|('(?:[^']|'')*')", re.DOTALL)
TOKEN = re.compile(r"'(?:[^']|'')*'|[(),]|[^\s(),']+")
# How a string writes what is no ASCII: UTF-16 and UTF-32 in hexadecimals, a byte of Latin-1, the upper half of a page.
CODED = re.compile(
    r"\\X2\\([0-9A-F]*)\\X0\\|\\X4\\([0-9A-F]*)\\X0\\|\\X\\([0-9A-F]{2})|\\P([A-I])\\|\\S\\(.)|\\\\", re.I
)
# Places, from 0, of who is above and who is below in relations that lead upwards, the first kind before the others.
UPWARDS = {
    "IFCRELCONTAINEDINSPATIALSTRUCTURE": (5, 4),
    "IFCRELAGGREGATES": (4, 5),
    "IFCRELNESTS": (4, 5),
    "IFCRELFILLSELEMENT": (4, 5),
    "IFCRELVOIDSELEMENT": (4, 5),
}
# Places of what a material is made of, for every class that is made of others.
PARTS = {
    "IFCMATERIALLAYER": (0,),
    "IFCMATERIALLAYERWITHOFFSETS": (0,),
    "IFCMATERIALLAYERSET": (0,),
    "IFCMATERIALLAYERSETUSAGE": (0,),
    "IFCMATERIALLIST": (0,),
    "IFCMATERIALCONSTITUENT": (2,),
    "IFCMATERIALCONSTITUENTSET": (2,),
    "IFCMATERIALPROFILE": (2,),
    "IFCMATERIALPROFILEWITHOFFSETS": (2,),
    "IFCMATERIALPROFILESET": (2,),
    "IFCMATERIALPROFILESETUSAGE": (0,),
    "IFCMATERIALPROFILESETUSAGETAPERING": (0, 3),
}
PREFIXES = {"EXA": 18, "PETA": 15, "TERA": 12, "GIGA": 9, "MEGA": 6, "KILO": 3, "HECTO": 2, "DECA": 1, "DECI": -1}
PREFIXES |= {"CENTI": -2, "MILLI": -3, "MICRO": -6, "NANO": -9, "PICO": -12, "FEMTO": -15, "ATTO": -18}


class StepWords:
    """The statements of a file by number, and what follows from them."""

    def __init__(self, content: bytes) -> None:
        """Take the bytes of a file."""
        try:
            text = content.decode("utf-8")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
        self.kinds: dict[int, str] = {}
        self._inside: dict[int, str] = {}
        self._of_kind: dict[str, list[int]] = defaultdict(list)
        for statement in STATEMENT.finditer(text):
            found = ENTITY.fullmatch(ASIDE.sub(lambda aside: aside[1] or "", statement[0]))
            if found:
                number, kind = int(found[1]), found[2].upper()
                self.kinds[number], self._inside[number] = kind, found[3]
                self._of_kind[kind].append(number)

    def objects(self) -> Iterator[Told]:
        """All that has a GlobalId, with its storey and materials."""
        for number in self.kinds:
            if self._inside[number].lstrip().startswith("'") and not self.kinds[number].startswith("IFCREL"):
                guid = _words(self.values(number)[0])
                if len(guid) == 22:
                    yield Told(guid, storey=self.storey(number), materials=self.materials(number))

    def rooms(self) -> Iterator[Told]:
        """All IfcSpaces."""
        for number in self._of_kind["IFCSPACE"]:
            values = self.values(number)
            guid, name, long_name = (_words(values[place]) for place in (0, 2, 7))
            yield Told(guid, name or guid, long_name, self.storey(number))

    def values(self, number: int) -> list:
        """Values of a statement: text as written, lists as lists; $ and * are None."""
        stack: list[list] = [[]]
        after_word = False
        for token in TOKEN.findall(self._inside[number]):
            if token == "(":
                if after_word:
                    stack[-1].pop()  # the name of a value's type
                stack.append([])
            elif token == ")":
                inner = stack.pop()
                stack[-1].append(inner)
            elif token != ",":
                stack[-1].append(None if token in ("$", "*") else token)
            after_word = token not in ("(", ")", ",") and token[0] not in "'#$*.-+0123456789"
        return stack[0]

    def storey(self, number: int) -> tuple[str, float | None] | None:
        """Name and elevation [m] of the nearest storey above."""
        rank, seen = [number], {number}
        while rank:
            rank = [up for below in rank for up in self._above[below]]
            for one in rank:
                if self.kinds[one] == "IFCBUILDINGSTOREY":
                    values = self.values(one)
                    stated = values[9]
                    name = _words(values[2]) or _words(values[0])
                    return name, None if stated is None else float(_alone(stated)) * self.metres
            rank = [one for one in dict.fromkeys(rank) if one not in seen]
            seen.update(rank)
        return None

    @cached_property
    def _above(self) -> dict[int, list[int]]:
        found: dict[int, list[int]] = defaultdict(list)
        for kind, (above, below) in UPWARDS.items():
            for number in sorted(self._of_kind[kind]):
                values = self.values(number)
                for one in _numbers(values[below]):
                    found[one] += _numbers(values[above])
        return found

    @cached_property
    def metres(self) -> float:
        """Length of the file's unit [m]; 1 where it states none."""
        for project in self._of_kind["IFCPROJECT"]:
            for assignment in _numbers(self.values(project)[8]):
                for unit in _numbers(self.values(assignment)[0]):
                    if "UNIT" in self.kinds[unit] and self.values(unit)[1] == ".LENGTHUNIT.":
                        return self._length(unit)
        return 1.0

    def _length(self, unit: int) -> float:
        values = self.values(unit)
        if self.kinds[unit] == "IFCSIUNIT":
            return 10.0 ** PREFIXES[values[2].strip(".")] if values[2] else 1.0
        if self.kinds[unit].startswith("IFCCONVERSIONBASEDUNIT"):
            times, of = self.values(_numbers(values[3])[0])
            return float(_alone(times)) * self._length(_numbers(of)[0])
        return 1.0

    def materials(self, number: int) -> tuple[str, ...]:
        """Names of its own materials, else of its type's."""
        for owner in (number, *self._types[number][:1]):
            if self._made[owner]:
                names = [name for material in self._made[owner] for name in self._names(material)]
                return tuple(dict.fromkeys(names))
        return ()

    @cached_property
    def _types(self) -> dict[int, list[int]]:
        return self._related("IFCRELDEFINESBYTYPE")

    @cached_property
    def _made(self) -> dict[int, list[int]]:
        return self._related("IFCRELASSOCIATESMATERIAL")

    def _related(self, kind: str) -> dict[int, list[int]]:
        """What a relation, whose fifth value are things and whose sixth is what they get, gives to each."""
        found: dict[int, list[int]] = defaultdict(list)
        for number in sorted(self._of_kind[kind]):
            values = self.values(number)
            for one in _numbers(values[4]):
                found[one] += _numbers(values[5])
        return found

    def _names(self, material: int) -> list[str]:
        values = self.values(material)
        if self.kinds[material] == "IFCMATERIAL":
            return [_words(values[0])] if _words(values[0]) else []
        places = PARTS.get(self.kinds[material], ())
        return [name for place in places for part in _numbers(values[place]) for name in self._names(part)]


def _numbers(value: object) -> list[int]:
    """References in a value, which may be one, a list, or missing."""
    if isinstance(value, list):
        return [number for one in value for number in _numbers(one)]
    return [int(value[1:])] if isinstance(value, str) and value.startswith("#") else []


def _alone(value: object) -> object:
    """A value that may stand in the brackets of its type."""
    return value[0] if isinstance(value, list) else value


def _words(value: object) -> str:
    """A string as it is meant; empty for none."""
    value = _alone(value)
    if not isinstance(value, str):
        return ""
    page = ["iso8859-1"]

    def decoded(found: re.Match) -> str:
        wide, wider, byte, turn, upper = found.groups()
        if wide is not None:
            return bytes.fromhex(wide).decode("utf-16-be")
        if wider is not None:
            return bytes.fromhex(wider).decode("utf-32-be")
        if byte:
            return bytes.fromhex(byte).decode("latin-1")
        if turn:
            page[0] = f"iso8859-{'ABCDEFGHI'.index(turn.upper()) + 1}"
            return ""
        return bytes([ord(upper) + 128]).decode(page[0]) if upper else "\\"

    return CODED.sub(decoded, value[1:-1].replace("''", "'"))
