"""What a sweep finds: settings of the knob of each method with time and error, and the file that holds them."""

import json
import math
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from ...data.errors import InputError
from ..pages import pareto_front

SAMPLING, LEVELS = "sampling alone", "levels of detail"


@dataclass(frozen=True)
class Point:
    """One setting of one knob.

    Attributes:
        value: of the knob.
        seconds: of visibility, for all view cells, preparation apart (of sampling: all in all); NaN where time is not
            what it trades.
        error: potential / seen; of the knob pixels the share of triangles that is drawn.
        unknown: share of the potential pairs without a witness, or NaN.
        wrong_hidden: pairs hidden although seen.
    """

    value: float
    seconds: float
    error: float
    unknown: float
    wrong_hidden: int


@dataclass(frozen=True)
class Series:
    """A method whose knob is swept; see `Point`.

    Attributes:
        method: in words.
        knob: with its unit.
        points: in the order they were run.
        apart: of other view cells than the rest, and so not to be compared with it point by point.
    """

    method: str
    knob: str
    points: list[Point]
    apart: bool = False


@dataclass(frozen=True)
class Curves:
    """All series of a scene.

    Attributes:
        scene: its name and size.
        series: of the methods.
        pairs: seen pairs that errors are relative to.
    """

    scene: str
    series: list[Series]
    pairs: int

    @property
    def safe(self) -> list[Series]:
        """Those of methods that hide nothing visible, unless they are broken."""
        return [one for one in self.series if one.method not in (SAMPLING, LEVELS)]

    @property
    def compared(self) -> list[Series]:
        """Those among them that are of the same view cells: time and error may be compared point by point."""
        return [one for one in self.safe if not one.apart]

    @property
    def front(self) -> list[Point]:
        """Points that no other of the same view cells beats in both time and error, fastest first.

        Those of other view cells take no part. Nor do those of a method that hides something visible at any setting: it
        is not safe at the others either.
        """
        safe = (one for one in self.series if not one.apart and not any(p.wrong_hidden > 0 for p in one.points))
        points = (p for one in safe for p in one.points if p.seconds > 0 and not np.isnan(p.error))
        return pareto_front(points, lambda p: (p.seconds, p.error))

    def content(self) -> dict:
        """As JSON holds it, points of the front marked; what is not known is null."""
        front, series = self.front, []
        for one in self.series:
            points = []
            for point in one.points:
                known = {name: None if np.isnan(value) else value for name, value in asdict(point).items()}
                points.append(known | {"front": any(point is other for other in front)})
            series.append({"method": one.method, "knob": one.knob, "points": points, "apart": one.apart})
        return {"scene": self.scene, "pairs": self.pairs, "series": series}

    @classmethod
    def of_content(cls, found: dict) -> "Curves":
        """Back from JSON.

        Raises:
            ValueError, KeyError, TypeError: it is something else.
        """
        names = [field.name for field in fields(Point)]
        series = [
            Series(
                str(one["method"]),
                str(one["knob"]),
                [Point(**{name: _number(point[name]) for name in names}) for point in one["points"]],
                bool(one.get("apart", False)),
            )
            for one in found["series"]
        ]
        return cls(str(found["scene"]), series, int(found.get("pairs", 0)))


def read_curves(path: str | Path) -> Curves:
    """Curves that `write_curves` has written.

    Raises:
        InputError: the file cannot be read, or holds no series of points.
    """
    try:
        return Curves.of_content(json.loads(Path(path).read_text(encoding="utf-8")))
    except OSError as error:
        raise InputError(f"{path}: expected curves, found {error.strerror}") from None
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: expected a scene and series of points, found {type(error).__name__}") from None


def _number(value: float | None) -> float:
    """NaN for what is not known or not finite, which JSON has no number for."""
    return value if value is not None and math.isfinite(value) else math.nan
