"""What a sweep finds: settings of the knob of each method with time and error, and the file that holds them."""

import json
from dataclasses import asdict, dataclass
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
    def front(self) -> list[Point]:
        """Points of the safe ones that no other beats in both time and error, fastest first."""
        points = (point for one in self.safe if not one.apart for point in one.points)
        return pareto_front(points, lambda point: (point.seconds, point.error))


def read_curves(path: str | Path) -> Curves:
    """Curves that `write_curves` has written.

    Raises:
        InputError: the file is unreadable or holds something else.
    """
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
        series = [
            Series(
                one["method"],
                one["knob"],
                [Point(**{name: _number(value) for name, value in point.items()}) for point in one["points"]],
                bool(one["apart"]),
            )
            for one in found["series"]
        ]
        return Curves(str(found["scene"]), series, int(found["pairs"]))
    except OSError as error:
        raise InputError(f"{path}: expected curves, found {error.strerror}") from None
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: expected curves that report has written, found {type(error).__name__}") from None


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def content(curves: Curves) -> dict:
    """What curves.json says."""
    content = {"scene": curves.scene, "pairs": curves.pairs, "series": [asdict(one) for one in curves.series]}
    for one in content["series"]:
        for point in one["points"]:
            for name in ("seconds", "unknown"):
                # NaN is no JSON.
                point[name] = None if np.isnan(point[name]) else point[name]
    return content
