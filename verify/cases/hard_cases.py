"""Hard cases as text: geometry that breaks visibility code, and the exact answer, one case per line.

The folder data/hard_cases holds one file per kind of question. Fields are separated by semicolons, # starts a comment,
a point is `x y z`, points are separated by commas and shapes by |. A shape is a polygon of three or more points, or two
points, low and high corner: a rectangle if they agree on one axis, a closed box if on none. Numbers are grid steps,
integers unless said otherwise. The files are the truth; tests hold every answer against an exact twin.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from ...data.errors import InputError
from .case_file import ShadowCase, StabCase, load_cases, load_shadow_cases

FOLDER = Path(__file__).resolve().parents[2] / "data" / "hard_cases"
# Corners of a box's faces, bit i of a corner for the high side of axis i; counter-clockwise seen from outside.
BOX_FACES = ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))
ROLES = ("occluder", "detail", "transparent")

Point = list[int] | list[float]
Shape = list[Point]
Case = TypeVar("Case")


@dataclass(frozen=True)
class RegionCase:
    """Does anything in a cell see anything of a target past occluders?

    Attributes:
        name: unique.
        expected: "visible" (along an open set of segments) or "hidden".
        cell: (low, high) of the open view cell.
        target: (low, high) of a box or rectangle, whose surface is to be seen.
        occluders: shapes; one in the plane of the target's face hides nothing of that face.
        origin: where the case came from.
    """

    name: str
    expected: str
    cell: Shape
    target: Shape
    occluders: list[Shape]
    origin: str


@dataclass(frozen=True)
class ObliqueCase:
    """As `RegionCase`, of ends that may be prisms.

    Attributes:
        name: unique.
        expected: "visible" or "hidden".
        cell: (low, high) of a box, or of an upright prism the four corners of its floor, counter-clockwise, and the
            first one at its top.
        target: likewise, whose surface is to be seen.
        occluders: upright rectangles at any angle and level polygons.
        origin: where the case came from, and what its answer is proved by.
    """

    name: str
    expected: str
    cell: Shape
    target: Shape
    occluders: list[Shape]
    origin: str


@dataclass(frozen=True)
class SightlineCase:
    """What does an open segment meet?

    Attributes:
        name: unique.
        expected: "clear", "graze" (at most edges, corners and coplanar triangles) or "blocked" (the inside of one).
        segment: its two ends, float64, 17 digits where not integers.
        excepted: the triangle that does not count, or -1.
        triangles: shapes of three points.
        origin: where the case came from.
    """

    name: str
    expected: str
    segment: Shape
    excepted: int
    triangles: list[Shape]
    origin: str


@dataclass(frozen=True)
class CoverageCase:
    """What do polygons cover in a cube map, and is a box behind them?

    Attributes:
        name: unique.
        expected: "hidden" (each pixel that the box touches is wholly covered by one nearer polygon) or "seen".
        viewpoint: float64, off the polygons' planes.
        size: pixels on a face's side, a power of two.
        polygons: planar and convex, shapes.
        box: (low, high).
        pixels: (face, row, pixel) of every pixel wholly covered by one polygon, numbered as in `coverage_exact`.
        origin: where the case came from.
    """

    name: str
    expected: str
    viewpoint: Point
    size: int
    polygons: list[Shape]
    box: Shape
    pixels: set[tuple[int, int, int]]
    origin: str


@dataclass(frozen=True)
class BackfaceCase:
    """How many triangles of one object turn their backs on all of a cell?

    Attributes:
        name: unique.
        expected: triangles of closed shells turned outwards that have the cell behind their plane or on it.
        cell: (low, high).
        surface: shapes, triangulated as fans; counter-clockwise seen from outside.
        origin: where the case came from.
    """

    name: str
    expected: int
    cell: Shape
    surface: list[Shape]
    origin: str


@dataclass(frozen=True)
class Trace:
    """The cell where a segment from a source cell ends; -1 if it meets a wall or a portal's edge."""

    source: int
    reached: int
    segment: Shape


@dataclass(frozen=True)
class GraphCase:
    """Which cells see each other through portals?

    Attributes:
        name: unique.
        cells: (low, high) each; they do not overlap, and their faces are walls but for the portals.
        portals: (cell on the low side, cell on the high side, rectangle) each.
        seen: pairs of different cells, the lower number first, that an open set of lines joins.
        traces: single segments, float64.
        origin: where the case came from.
    """

    name: str
    cells: list[Shape]
    portals: list[tuple[int, int, Shape]]
    seen: set[tuple[int, int]]
    traces: list[Trace]
    origin: str


@dataclass(frozen=True)
class ModelCase:
    """Which objects of a whole model are seen from view cells?

    Attributes:
        name: unique.
        objects: (role, shapes) each, in metres, float64.
        cells: view cells (low, high) outside all solids, in metres.
        seen: (cell, object) pairs that an open set of segments joins; all other pairs are hidden.
        origin: where the case came from.
    """

    name: str
    objects: list[tuple[str, list[Shape]]]
    cells: list[Shape]
    seen: set[tuple[int, int]]
    origin: str


@dataclass(frozen=True)
class KnapsackCase:
    """How much benefit fits into a budget of cost, with one level for each object?

    Attributes:
        name: unique.
        expected: the largest sum of benefits within the budget, or None if no selection fits.
        budget: integer >= 0.
        objects: (benefit, cost) of each level, integers.
        origin: where the case came from.
    """

    name: str
    expected: int | None
    budget: int
    objects: list[list[tuple[int, int]]]
    origin: str


@dataclass(frozen=True)
class TourCase:
    """How few runs of ones can rows have, over all orders of their columns?

    Attributes:
        name: unique.
        expected: the fewest.
        rows: of the characters 0 and 1, equally long.
        origin: where the case came from.
    """

    name: str
    expected: int
    rows: list[str]
    origin: str


@dataclass(frozen=True)
class HardCases:
    """All cases of a folder, by kind."""

    stab: list[StabCase]
    shadow: list[ShadowCase]
    region: list[RegionCase]
    oblique: list[ObliqueCase]
    sightline: list[SightlineCase]
    coverage: list[CoverageCase]
    backface: list[BackfaceCase]
    graph: list[GraphCase]
    model: list[ModelCase]
    knapsack: list[KnapsackCase]
    tour: list[TourCase]

    def count(self) -> int:
        """Number of cases."""
        return sum(len(cases) for cases in vars(self).values())


def load_hard_cases(folder: str | Path = FOLDER) -> HardCases:
    """Cases of a folder's files stab.txt, shadow.txt, ..., one per kind.

    Raises:
        InputError: a file is missing or not text, a line has another form than its kind, or a name comes twice.
    """
    found = {}
    for kind, load in LOADERS.items():
        path = Path(folder) / f"{kind}.txt"
        try:
            found[kind] = load(path)
        except (OSError, UnicodeDecodeError):
            raise InputError(f"{path}: expected a file of hard cases, found nothing readable there") from None
        names = set()
        for case in found[kind]:
            if case.name in names:
                raise InputError(f"{path}: expected every name once, found {case.name!r} twice")
            names.add(case.name)
    return HardCases(**found)


def faces(shape: Shape) -> list[Shape]:
    """Polygons of a shape: itself, the rectangle, or the six faces of the box, outwards.

    Raises:
        ValueError: two points that agree on two or three axes, or high below low.
    """
    if len(shape) > 2:
        return [shape]
    low, high = shape
    flat = [axis for axis in range(3) if low[axis] == high[axis]]
    if len(flat) > 1 or any(a > b for a, b in zip(low, high, strict=True)):
        raise ValueError(f"expected low and high corner of a rectangle or box, found {low}, {high}")
    corners = [[(low, high)[index >> axis & 1][axis] for axis in range(3)] for index in range(8)]
    chosen = BOX_FACES if not flat else BOX_FACES[2 * flat[0] + 1 :][:1]
    return [[corners[index] for index in face] for face in chosen]


def end_faces(shape: Shape) -> list[Shape]:
    """Faces of a box or of a prism of an `ObliqueCase`."""
    if len(shape) == 2:
        return faces(shape)
    floor, top = shape[:4], shape[4][2]
    above = [[*corner[:2], top] for corner in floor]
    sides = [[floor[k], floor[(k + 1) % 4], above[(k + 1) % 4], above[k]] for k in range(4)]
    return [floor[::-1], above, *sides]


def fan(polygon: Shape) -> list[Shape]:
    """Triangles of a polygon about its first corner."""
    return [[polygon[0], b, c] for b, c in itertools.pairwise(polygon[1:])]


def _lines(path: Path, form: str, build: Callable[..., Case]) -> list[Case]:
    """One case per line, built from its fields."""
    cases = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        line = line.partition("#")[0].strip()
        if not line:
            continue
        try:
            fields = [field.strip() for field in line.split(";")]
            if len(fields) != form.count(";") + 1 or not all(fields):
                raise ValueError
            cases.append(build(*fields))
        except ValueError:
            shown = line if len(line) <= 200 else f"{line[:200]} ..."
            raise InputError(f"{path}, line {number}: expected '{form}', found {shown!r}") from None
    return cases


def _one_of(text: str, *words: str) -> str:
    if text not in words:
        raise ValueError
    return text


def _point(text: str, number: Callable) -> Point:
    point = [number(c) for c in text.split()]
    if len(point) != 3 or not all(abs(c) < float("inf") for c in point):
        raise ValueError
    return point


def _shape(text: str, number: Callable = int) -> Shape:
    points = [_point(part, number) for part in text.split(",")]
    if len(points) < 2:
        raise ValueError
    return points


def _shapes(text: str, number: Callable = int) -> list[Shape]:
    shapes = [_shape(part, number) for part in text.split("|")]
    for shape in shapes:
        faces(shape)
    return shapes


def _box(text: str, number: Callable = int, flat: int = 0) -> Shape:
    """Low and high corner, equal on `flat` axes at most."""
    low, high = _shape(text, number)
    if any(a > b for a, b in zip(low, high, strict=True)) or sum(map(lambda a, b: a == b, low, high)) > flat:
        raise ValueError
    return [low, high]


def _pairs(text: str, rows: int, columns: int) -> set[tuple[int, int]]:
    """Pairs of numbers below the limits; `-` for none."""
    pairs = set()
    for part in text.split(",") if text != "-" else []:
        a, b = (int(c) for c in part.split())
        if not (0 <= a < rows and 0 <= b < columns):
            raise ValueError
        pairs.add((a, b))
    return pairs


def _region(name: str, expected: str, cell: str, target: str, occluders: str, origin: str) -> RegionCase:
    _one_of(expected, "visible", "hidden")
    return RegionCase(name, expected, _box(cell), _box(target, flat=1), _shapes(occluders), origin)


def _end(text: str) -> Shape:
    """A box, or a prism with a convex floor."""
    shape = _shape(text)
    if len(shape) == 2:
        return _box(text)
    if len(shape) != 5 or shape[4][:2] != shape[0][:2] or len({z for _, _, z in shape[:4]}) > 1:
        raise ValueError
    turns = [
        (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
        for a, b, c in ([shape[(k + step) % 4] for step in range(3)] for k in range(4))
    ]
    if min(turns) <= 0 or shape[4][2] <= shape[0][2]:
        raise ValueError
    return shape


def _oblique(name: str, expected: str, cell: str, target: str, occluders: str, origin: str) -> ObliqueCase:
    _one_of(expected, "visible", "hidden")
    return ObliqueCase(name, expected, _end(cell), _end(target), _shapes(occluders), origin)


def _sightline(name: str, expected: str, segment: str, excepted: str, triangles: str, origin: str) -> SightlineCase:
    ends, shapes = _shape(segment, float), _shapes(triangles)
    number = -1 if excepted == "-" else int(excepted)
    if len(ends) != 2 or any(len(shape) != 3 for shape in shapes) or not -1 <= number < len(shapes):
        raise ValueError
    return SightlineCase(name, _one_of(expected, "clear", "graze", "blocked"), ends, number, shapes, origin)


def _coverage(
    name: str, expected: str, viewpoint: str, size: str, polygons: str, box: str, pixels: str, origin: str
) -> CoverageCase:
    side, covered = int(size), set()
    if side < 2 or side & (side - 1):
        raise ValueError
    for run in pixels.split(",") if pixels != "-" else []:
        face, row, ends = run.split()
        first, last = (int(end) for end in ends.split("-"))
        if not (0 <= int(face) < 6 and 0 <= int(row) < side and 0 <= first <= last < side):
            raise ValueError
        covered |= {(int(face), int(row), pixel) for pixel in range(first, last + 1)}
    eye, shapes = _point(viewpoint, float), _shapes(polygons)
    word = _one_of(expected, "hidden", "seen")
    return CoverageCase(name, word, eye, side, shapes, _box(box, flat=3), covered, origin)


def _backface(name: str, expected: str, cell: str, surface: str, origin: str) -> BackfaceCase:
    if int(expected) < 0:
        raise ValueError
    return BackfaceCase(name, int(expected), _box(cell), _shapes(surface), origin)


def _graph(name: str, cells: str, portals: str, seen: str, traces: str, origin: str) -> GraphCase:
    boxes, openings, segments = [_box(cell) for cell in cells.split("|")], [], []
    for part in portals.split("|"):
        ends, rectangle = part.split(":")
        a, b = (int(end) for end in ends.split())
        if not (0 <= a < len(boxes) and 0 <= b < len(boxes) and a != b):
            raise ValueError
        opening = _box(rectangle, flat=1)
        if len(faces(opening)) > 1:
            raise ValueError
        openings.append((a, b, opening))
    for part in traces.split("|") if traces != "-" else []:
        ends, segment = part.split(":")
        source, reached = ends.split()
        trace = Trace(int(source), -1 if reached == "-" else int(reached), _shape(segment, float))
        if not (0 <= trace.source < len(boxes) and -1 <= trace.reached < len(boxes) and len(trace.segment) == 2):
            raise ValueError
        segments.append(trace)
    pairs = _pairs(seen, len(boxes), len(boxes))
    if any(a >= b for a, b in pairs):
        raise ValueError
    return GraphCase(name, boxes, openings, pairs, segments, origin)


def _model(name: str, objects: str, cells: str, seen: str, origin: str) -> ModelCase:
    parts = []
    for part in objects.split("/"):
        role, surface = part.split(":")
        parts.append((_one_of(role.strip(), *ROLES), _shapes(surface, float)))
    boxes = [_box(cell, float) for cell in cells.split("|")]
    return ModelCase(name, parts, boxes, _pairs(seen, len(boxes), len(parts)), origin)


def _knapsack(name: str, expected: str, budget: str, objects: str, origin: str) -> KnapsackCase:
    levels = []
    for part in objects.split("|"):
        pairs = [tuple(int(c) for c in level.split()) for level in part.split(",")]
        if any(len(pair) != 2 or pair[1] < 0 for pair in pairs):
            raise ValueError
        levels.append(pairs)
    if int(budget) < 0:
        raise ValueError
    return KnapsackCase(name, None if expected == "-" else int(expected), int(budget), levels, origin)


def _tour(name: str, expected: str, rows: str, origin: str) -> TourCase:
    lines = [row.strip() for row in rows.split("|")]
    if int(expected) < 0 or len(set(map(len, lines))) > 1 or not lines[0] or not set("".join(lines)) <= set("01"):
        raise ValueError
    return TourCase(name, int(expected), lines, origin)


def _loader(form: str, build: Callable[..., Case]) -> Callable[[Path], list[Case]]:
    return lambda path: _lines(path, form, build)


LOADERS: dict[str, Callable[[Path], list]] = {
    "stab": load_cases,
    "shadow": load_shadow_cases,
    "region": _loader("name; expected; cell; target; occluders; origin", _region),
    "oblique": _loader("name; expected; cell; target; occluders; origin", _oblique),
    "sightline": _loader("name; expected; segment; excepted; triangles; origin", _sightline),
    "coverage": _loader("name; expected; viewpoint; size; polygons; box; pixels; origin", _coverage),
    "backface": _loader("name; expected; cell; surface; origin", _backface),
    "graph": _loader("name; cells; portals; seen; traces; origin", _graph),
    "model": _loader("name; objects; cells; seen; origin", _model),
    "knapsack": _loader("name; expected; budget; objects; origin", _knapsack),
    "tour": _loader("name; expected; rows; origin", _tour),
}
