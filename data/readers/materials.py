"""Material libraries (.mtl): colour, and whether sight passes."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from .lines import lines_of, unquoted
from .pieces import beside, rgba
from .roles import OPAQUE_ALPHA

# Kinds of illumination without transparency, and those that refract, where a filter of 1 is one of glass: elsewhere
# some exporters write a filter of 1 with every opaque material.
SOLID_KINDS, REFRACTING_KINDS = (0, 1, 2, 3), (6, 7, 9)
MAPS = ("map_d", "map_tr", "map_opacity")


@dataclass
class Material:
    """What a library says of a material; None where it says nothing.

    Attributes:
        dissolve, through: `d` and `Tr`, from 0 to 1.
        filtered: `Tf`, red, green and blue.
        kind: `illum`.
        cut_out: the picture of its opacity; empty where it has none.
        diffuse: `Kd`, red, green and blue.
    """

    dissolve: float | None = None
    through: float | None = None
    filtered: tuple[float, ...] | None = None
    kind: int | None = None
    cut_out: str = ""
    diffuse: tuple[float, ...] | None = None

    @property
    def alpha(self) -> float:
        """Opacity from 0 to 1."""
        if self.dissolve is not None:
            return self.dissolve
        return 1.0 if self.through is None else 1.0 - self.through

    @property
    def colour(self) -> tuple[int, int, int, int] | None:
        """8 bits a channel."""
        return None if self.diffuse is None else rgba(*self.diffuse, self.alpha)

    def clear(self, name: str) -> str:
        """By what sight passes, in words; empty if it does not."""
        if not self.alpha >= OPAQUE_ALPHA:
            return f"opacity {self.alpha:g} of {name!r}"
        if self.cut_out:
            return f"opacity by the picture {self.cut_out!r} of {name!r}"
        return f"filter Tf of {name!r}" if self._passes_filter() else ""

    def _passes_filter(self) -> bool:
        if self.filtered is None or max(self.filtered) <= 0:
            return False
        if self.kind in SOLID_KINDS and (self.dissolve is not None or self.through is not None):
            return False
        return min(self.filtered) < 1 or self.kind in REFRACTING_KINDS


def libraries(path: Path, line: str) -> Iterator[tuple[str, Path | None]]:
    """Name and file of each library in what follows `mtllib`: names may hold spaces, be quoted, or be several."""
    if found := beside(path, line):
        yield line, found
        return
    words = re.findall(r'"[^"]*"|\S+', line)
    at = 0
    while at < len(words):
        # The longest run of words that is a file.
        for end in range(len(words), at, -1):
            name = " ".join(words[at:end])
            if found := beside(path, name):
                yield name, found
                at = end
                break
        else:
            yield words[at].strip('"'), None
            at += 1


def read_library(path: Path) -> dict[str, Material]:
    """The materials of a library by name; lines that say nothing understandable are passed over."""
    found: dict[str, Material] = {}
    here = Material()
    for _, words in lines_of(path):
        key, values = words[0].lower(), words[1:]
        if key == "newmtl":
            here = found[unquoted(values)] = Material()
        elif key in MAPS:
            here.cut_out = values[-1] if values else ""
        else:
            try:
                _set(here, key, values)
            except (ValueError, IndexError):
                continue
    return found


def _set(here: Material, key: str, values: list[str]) -> None:
    if key == "d":
        here.dissolve = float(values[-1])
    elif key == "tr":
        here.through = float(values[-1])
    elif key == "illum":
        here.kind = int(float(values[0]))
    elif key in ("tf", "kd"):
        channels = tuple(float(value) for value in values[:3])
        channels = channels * 3 if len(channels) == 1 else channels
        if len(channels) != 3:
            raise ValueError(key)
        if key == "tf":
            here.filtered = channels
        else:
            here.diffuse = channels
