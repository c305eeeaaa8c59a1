"""Case files: hard stabbing and umbra cases, one per line, and replayable accounts of a wrong verdict."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ...data.errors import InputError

EXPECTED = ("open", "graze", "parallel", "none")


@dataclass(frozen=True)
class StabCase:
    """One hard stabbing question.

    Attributes:
        name: unique.
        expected: "open" (a line through all insides), "graze" (only touching, all direction components nonzero),
            "parallel" (only touching, with a zero component) or "none".
        signs: direction octant, three of +-1.
        boxes: (low, high corner) [grid steps], shape (n, 2, 3), int64.
        origin: where the case came from.
    """

    name: str
    expected: str
    signs: tuple[int, int, int]
    boxes: np.ndarray
    origin: str


def load_cases(path: str | Path) -> list[StabCase]:
    """Cases of a text file: `name; expected; signs; boxes; origin` a line, # starts a comment.

    Signs are like `+-+`; a box is `x y z, x y z` (low, high corner), boxes are separated by `|`.

    Raises:
        InputError: a line has another form.
    """
    cases = []
    for number, line in enumerate(Path(path).read_text(encoding="utf-8").splitlines(), 1):
        line = line.partition("#")[0].strip()
        if not line:
            continue
        try:
            name, expected, signs, boxes, origin = (part.strip() for part in line.split(";"))
            corners = [[[int(c) for c in corner.split()] for corner in box.split(",")] for box in boxes.split("|")]
            table = np.array(corners, np.int64).reshape(len(corners), 2, 3)
            octant = tuple({"+": 1, "-": -1}[s] for s in signs)
            if expected not in EXPECTED or len(octant) != 3:
                raise ValueError
        except (ValueError, KeyError):
            where = f"{path}, line {number}"
            raise InputError(f"{where}: expected 'name; expected; signs; boxes; origin', found {line!r}") from None
        cases.append(StabCase(name, expected, octant, table, origin))
    return cases


@dataclass(frozen=True)
class ShadowCase:
    """One hard umbra question.

    Attributes:
        name: unique.
        expected: "hidden" (the box is in the umbra), "touch" (it is, and touches its border) or "not".
        cell: (low, high) [grid steps].
        outline: corners [grid steps].
        box: (low, high) [grid steps].
        rho: of two opposite edges, the first and the third, rounded to 4 digits; None where the cell straddles.
        origin: where the case came from.
    """

    name: str
    expected: str
    cell: list[list[int]]
    outline: list[list[int]]
    box: list[list[int]]
    rho: tuple[float, float] | None
    origin: str


def load_shadow_cases(path: str | Path) -> list[ShadowCase]:
    """Cases of a text file: `name; expected; cell; outline; box; rho; origin` a line, # starts a comment.

    A point is `x y z`; points are separated by commas; rho is two numbers or `-`.

    Raises:
        InputError: a line has another form.
    """
    cases = []
    for number, line in enumerate(Path(path).read_text(encoding="utf-8").splitlines(), 1):
        line = line.partition("#")[0].strip()
        if not line:
            continue
        try:
            name, expected, *points, rho, origin = (part.strip() for part in line.split(";"))
            cell, outline, box = ([[int(c) for c in point.split()] for point in part.split(",")] for part in points)
            pair = None if rho == "-" else tuple(float(r) for r in rho.split())
            if expected not in ("hidden", "touch", "not") or {len(p) for p in cell + outline + box} != {3}:
                raise ValueError
            if len(cell) != 2 or len(box) != 2 or len(outline) < 3 or (pair is not None and len(pair) != 2):
                raise ValueError
        except ValueError:
            form = "name; expected; cell; outline; box; rho; origin"
            raise InputError(f"{path}, line {number}: expected '{form}', found {line!r}") from None
        cases.append(ShadowCase(name, expected, cell, outline, box, pair, origin))
    return cases


@dataclass(frozen=True)
class WrongHidden:
    """A visible pair that a bake calls hidden, with the sightline that shows it.

    Attributes:
        bake: path of the bake folder.
        model: path of the model as the manifest gives it.
        cell: source cell_id.
        kind: "cell" or "object".
        target: cell_id or object_id of what was hidden.
        origin: start of the sightline [grid steps], 3 float64.
        direction: origin + direction is its end [grid steps], 3 float64.
        model_line: both ends in the model's own coordinates [m], for people.
    """

    bake: str
    model: str
    cell: int
    kind: str
    target: int
    origin: tuple[float, float, float]
    direction: tuple[float, float, float]
    model_line: tuple[tuple[float, ...], ...] = ()


def write_case(case: WrongHidden) -> Path:
    """Write the case beside its bake as <bake name>-case-<n>.json, n the first free number."""
    bake = Path(case.bake).resolve()
    number = 1
    while (path := bake.parent / f"{bake.name}-case-{number}.json").exists():
        number += 1
    # Python prints the shortest digits (at most 17) that give the same float back.
    path.write_text(json.dumps({"format": "viewcell-case-1", **asdict(case)}, indent=1) + "\n", encoding="utf-8")
    return path


def read_case(path: str | Path) -> WrongHidden:
    """The case that `write_case` wrote.

    Raises:
        InputError: there is no such file, or it is not a case file.
    """
    try:
        fields = json.loads(Path(path).read_text(encoding="utf-8"))
        if fields.pop("format", None) != "viewcell-case-1":
            raise ValueError
        vectors = {name: tuple(float(c) for c in fields.pop(name)) for name in ("origin", "direction")}
        line = tuple(tuple(float(c) for c in end) for end in fields.pop("model_line", ()))
        case = WrongHidden(**fields, **vectors, model_line=line)
        numbers = np.array([case.origin, case.direction])
        if case.kind not in ("cell", "object") or numbers.shape != (2, 3) or not np.isfinite(numbers).all():
            raise ValueError
    except OSError:
        raise InputError(f"{path}: expected a case file of `viewcell verify`, found nothing readable there") from None
    except (ValueError, TypeError, KeyError, AttributeError):
        raise InputError(f"{path}: expected a case file of `viewcell verify`, found something else") from None
    return case
