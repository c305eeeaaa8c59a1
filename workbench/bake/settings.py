"""What a bake's answer depends on, in groups by what they speak of."""

from dataclasses import dataclass, fields, replace
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

import numpy as np

from ...data.camera import Screen
from ...data.errors import InputError
from ...solvers.levels.pixel_error import PixelLimit

if TYPE_CHECKING:
    from ...solvers.visibility.projection import VlodSettings

DOORS = ("open", "closed")
METHODS = ("auto", "portals", "occluders", "both", "vlod")
KINDS = {bool: "True or False", int: "a whole number", float: "a number", str: "a text"}
DEEPEST = 12
# Cells are not cut into smaller parts than this [m].
SMALLEST_PART_M = 0.5


@dataclass(frozen=True)
class ModelSettings:
    """How the model is taken.

    Attributes:
        doors: "open", or "closed" if doors occlude.
        glass: as for `read`: regular expression in place of the words for glass and windows in names.
        doors_by: in place of the words for doors.
        leave_out: parts whose name, GUID or kind it finds are not read.
        yaw: what the model is turned back by about the vertical [degrees], or "auto" for the angle at which most of its
            walls stand. Boxes of a table then stand at an angle, as prisms.
        seal: cracks narrower than this are closed [m]; 0 closes none. What is seen through them alone is then hidden
            though visible, and listed in leaks.parquet.
        split: connected components become objects of their own.
    """

    doors: str = "open"
    glass: str = ""
    doors_by: str = ""
    leave_out: str = ""
    yaw: str = "auto"
    seal: float = 0.0
    split: bool = False

    @property
    def reading(self) -> dict[str, str]:
        """What `read` is told that it would not assume."""
        asked = {"doors": self.doors, "glass": self.glass, "doors_by": self.doors_by, "leave_out": self.leave_out}
        return {name: value for name, value in asked.items() if value not in ("", "open")}


@dataclass(frozen=True)
class CellSettings:
    """Where one looks from.

    Attributes:
        cells: view cells: "portals" for those of the cell-and-portal graph, "octree", "walkways" for small ones around
            the eyes of all who walk, or a table of boxes. By default the method's own.
        threshold_m2: opaque area below which a plane does not cut cells; larger is faster and looser.
        cell_size_m: of the octree's roots.
        depth: times that a cell of the octree may be refined.
        refine_triangles: a cell that may see more triangles is refined.
        refine_gap: a cell is refined if a larger share of what it may see is unknown.
        largest_cell: inhabitable cells of portals are cut into parts no longer or wider than this [m]; 0 for any size.
            A view cell larger than a room keeps what can be seen from its far end, too.
        refine_kept: cells of portals are halved, before they are baked, where eyes in them see together more than so
            many times as much as one of them does; 0 halves none.
    """

    cells: str = ""
    threshold_m2: float = 0.0
    cell_size_m: float = 4.0
    depth: int = 2
    refine_triangles: int = 100_000
    refine_gap: float = 0.25
    largest_cell: float = 0.0
    refine_kept: float = 0.0

    @property
    def table(self) -> Path | None:
        """The table of boxes that `cells` names, if it names one."""
        return None if self.cells in ("", "portals", "octree", "walkways") else Path(self.cells)


@dataclass(frozen=True)
class MethodSettings:
    """What proves things hidden.

    Attributes:
        method: "portals" (stabbing lines through a cell-and-portal graph), "occluders" (shadows of walls, furniture and
            oblique surfaces), "both", "vlod" (the method of Chhugani et al. 2005: projection points and shrunk
            occluders), or "auto": portals, and occluders for cells where portals leave much unknown, and for models too
            large to be cut into cells.
        certify: store a certificate of everything that is hidden, and call nothing else hidden.
        seed: of the random sightlines.
        clusters: of occluders by direction, for "vlod"; see `viewcell.solvers.visibility.projection.VlodSettings`.
        objective: of projection points, for "vlod".
        resolution: pixels on the side of a cube map's face, for "vlod".
    """

    method: str = "auto"
    certify: bool = False
    seed: int = 0
    clusters: int = 14
    objective: str = "socp"
    resolution: int = 512

    @property
    def vlod(self) -> "VlodSettings":
        """How the method "vlod" treats view cells.

        Raises:
            InputError: clusters, objective or resolution.
        """
        from ...solvers.visibility.projection import VlodSettings

        return VlodSettings(self.clusters, self.objective, self.resolution, seed=self.seed)


@dataclass(frozen=True)
class LevelSettings:
    """Levels of detail.

    Attributes:
        lods: simplify definitions that have a single level, and store which levels are good enough from which cells.
        pixels: a level may deviate on the image by no more.
        image: width x height of the image that `pixels` are counted on.
        fov_deg: its vertical field of view.
    """

    lods: bool = False
    pixels: float = 1.0
    image: str = "1920x1080"
    fov_deg: float = 60.0

    @property
    def pixel_limit(self) -> PixelLimit:
        """What levels are chosen for; raises InputError for a number out of range."""
        width, _, height = self.image.partition("x")
        if not (width.isdecimal() and height.isdecimal()):
            raise InputError(f"image: expected WIDTHxHEIGHT in pixels, found {self.image!r}")
        return PixelLimit(self.pixels, Screen(int(width), int(height), self.fov_deg))


@dataclass(frozen=True)
class Settings(LevelSettings, MethodSettings, CellSettings, ModelSettings):
    """What a bake's answer depends on; each group says what its values mean."""

    @property
    def frame(self) -> dict[str, str | float]:
        """The option `yaw` of `read`."""
        if self.yaw == "auto":
            return {"yaw": "auto"}
        try:
            return {"yaw": float(self.yaw)}
        except ValueError:
            raise InputError(f"yaw: expected auto or degrees, found {self.yaw!r}") from None

    def check(self) -> None:
        """Raise InputError for a value of another kind, or out of range."""
        for field in fields(self):
            _check_kind(field.name, getattr(self, field.name), type(field.default))
        if self.doors not in DOORS:
            raise InputError(f"doors: expected {' or '.join(DOORS)}, found {self.doors!r}")
        for name, value, least in (
            ("threshold", self.threshold_m2, 0.0),
            ("seal", self.seal, 0.0),
            ("cell size", self.cell_size_m, 1e-3),
            ("largest-cell", self.largest_cell or 1.0, SMALLEST_PART_M),
            ("refine-triangles", self.refine_triangles, 1),
            ("refine-gap", self.refine_gap, 0.0),
        ):
            check_number(name, value, least)
        if self.seal and (self.certify or self.method in ("occluders", "vlod") or self.cells not in ("", "portals")):
            raise InputError("seal: expected cells of portals, by a method that goes through them, and no certificates")
        if self.method not in METHODS:
            raise InputError(f"method: expected {', '.join(METHODS)}, found {self.method!r}")
        if not 0 <= self.depth <= DEEPEST:
            raise InputError(f"depth: expected a whole number from 0 to {DEEPEST}, found {self.depth}")
        check_number("refine-kept", self.refine_kept, 0.0)
        if 0.0 < self.refine_kept < 1.0:
            raise InputError(f"refine-kept: expected 0 or a ratio from 1, found {self.refine_kept:g}")
        _ = self.frame, self.pixel_limit
        # Their module takes half a second to import; the default ones are right.
        if any(getattr(self, name) != getattr(Settings, name) for name in ("clusters", "objective", "resolution")):
            _ = self.vlod


class SettingsWords(TypedDict, total=False):
    """Settings as keywords, each as in its group."""

    doors: str
    glass: str
    doors_by: str
    leave_out: str
    yaw: str | float
    seal: float
    split: bool
    cells: str | Path
    threshold_m2: float
    cell_size_m: float
    depth: int
    refine_triangles: int
    refine_gap: float
    largest_cell: float
    refine_kept: float
    method: str
    certify: bool
    seed: int
    clusters: int
    objective: str
    resolution: int
    lods: bool
    pixels: float
    image: str
    fov_deg: float


def with_words(settings: Settings | None, words: SettingsWords) -> Settings:
    """Settings, the default ones unless some are given, changed by keywords.

    Raises:
        InputError: a keyword is no setting.
    """
    known = [field.name for field in fields(Settings)]
    for name in words:
        if name not in known:
            close = get_close_matches(name, known, 1)
            hint = f": {close[0]} is one" if close else f" ({', '.join(known)})"
            raise InputError(f"settings: expected the name of a setting, found {name!r}{hint}")
    # Paths and degrees are written as on the command line.
    told = {name: str(value) if name in ("cells", "yaw") else value for name, value in words.items()}
    return replace(settings or Settings(), **told)


def _check_kind(name: str, value: object, kind: type) -> None:
    """Refuse a value that is not of its default's kind: in Python nothing else would, and a text is true."""
    fits = isinstance(value, int | float if kind is float else kind) and isinstance(value, bool) == (kind is bool)
    if not fits:
        raise InputError(f"{name}: expected {KINDS[kind]}, found {value!r}")


def check_number(name: str, value: float, least: float) -> None:
    """Refuse a number below the least with an InputError."""
    if not (np.isfinite(value) and value >= least):
        raise InputError(f"{name}: expected a number {'above 0' if least else 'from 0'}, found {value}")
