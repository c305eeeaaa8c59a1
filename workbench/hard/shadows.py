"""Hard cases of shafts, umbras, shrunk occluders and cube maps: is a box hidden from a cell by some shapes?"""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce

import numpy as np

from ...data.patches import Patches, find_patches, join_outlines
from ...data.prepared import PreparedModel
from ...data.ragged import starts_of
from ...data.verdict import Verdict
from ...kernels.coverage import CubeMaps, launch_coverage
from ...kernels.launch import Device
from ...kernels.occludee import launch_occludees
from ...kernels.shaft import launch_shaft
from ...kernels.shields import device_shields
from ...kernels.shrink import launch_shrink
from ...kernels.umbra import Umbras, launch_umbra
from ...solvers.projection_point import cluster_problems, solve_points
from ...solvers.visibility.projection import VlodSettings, vlod_hidden
from ...verify.arithmetic import box_corners, cross, dot, minus, rational
from ...verify.cases.hard_cases import HardCases, Shape, faces, fan
from .meshes import scene_of
from .oblique import around_end
from .outcomes import Outcome, Outcomes, one_sided

# Halvings, and lines tried, before a kernel gives up a case.
CAP = 4000
# Pixels on the side of the cube maps that cases about regions are drawn into.
RESOLUTION = 64


@dataclass(frozen=True)
class _Question:
    """Is a box hidden from a cell by some shapes? Cases about umbras and about regions, as one."""

    name: str
    cell: Shape
    box: Shape
    shapes: list[Shape]
    hidden: bool


def _questions(cases: HardCases) -> list[_Question]:
    shadows = [_Question(c.name, c.cell, c.box, [c.outline], c.expected != "not") for c in cases.shadow]
    regions = [_Question(c.name, c.cell, c.target, c.occluders, c.expected == "hidden") for c in cases.region]
    return shadows + regions


def shaft(cases: HardCases, device: Device) -> Outcomes:
    """Halving as far as it takes; what is a prism is asked about as the box around it."""
    oblique = [
        _Question(c.name, around_end(c.cell), around_end(c.target), c.occluders, c.expected == "hidden")
        for c in cases.oblique
    ]
    apart = [q for q in oblique if any(h <= a or b <= low for a, b, low, h in zip(*q.box, *q.cell, strict=True))]
    for asked in _questions(cases) + apart:
        model = PreparedModel(scene_of(asked.shapes))
        shields = device_shields(model.regions, model.patches, device)
        boxes = np.array([asked.cell, asked.box], np.int32)
        answers = launch_shaft(shields, boxes, np.array([[0, 1]]), smallest=(1, 1), cap=CAP, device=device)
        yield asked.name, one_sided(bool(answers.verdict[0] == Verdict.HIDDEN), asked.hidden)


def _outlines(shapes: list[Shape]) -> Patches:
    """Each face of each shape as an outline, if it can be one."""
    found = []
    for face in (face for shape in shapes for face in faces(shape)):
        triangles = np.array(fan(face), np.int32)
        owners = np.zeros(len(triangles), int)
        found.append(find_patches(triangles, owners, least_area=0.0, most_corners=99, cos_limit=0.5, axial=True))
    return reduce(join_outlines, found)


@dataclass(frozen=True)
class _Shadows:
    """All questions at once: the pair of cell and outline of each umbra, and which question it belongs to."""

    questions: list[_Question]
    cells: np.ndarray
    outlines: Patches
    of: np.ndarray
    umbras: Umbras

    @staticmethod
    def of_cases(cases: HardCases, device: Device) -> "_Shadows":
        """The umbras of all questions, by one launch."""
        questions = _questions(cases)
        tables = [_outlines(asked.shapes) for asked in questions]
        of = np.repeat(np.arange(len(tables)), [len(t.area) for t in tables])
        cells, outlines = np.array([asked.cell for asked in questions], np.int32), reduce(join_outlines, tables)
        pairs = np.column_stack([of, np.arange(len(of))])
        return _Shadows(questions, cells, outlines, of, launch_umbra(cells, outlines, pairs, device=device))


def umbra(cases: HardCases, device: Device) -> Outcomes:
    """Whether all corners of the box are in an umbra."""
    shadows = _Shadows.of_cases(cases, device)
    for number, asked in enumerate(shadows.questions):
        corners = np.array(box_corners(asked.box), float)
        claimed = any(shadows.umbras.contains(pair, corners).all() for pair in np.flatnonzero(shadows.of == number))
        yield asked.name, one_sided(claimed, asked.hidden)


def shrink(cases: HardCases, device: Device) -> Outcomes:
    """Seen from several projection points, with and without a limit of depth, no visible box may be behind."""
    shadows = _Shadows.of_cases(cases, device)
    rows = np.arange(len(shadows.of))
    claimed = np.zeros(len(shadows.questions), bool)
    for share in (0.5, 0.0, 1.0):
        points = (shadows.cells[:, 0] + share * (shadows.cells[:, 1] - shadows.cells[:, 0]))[shadows.of]
        for limited in (False, True):
            depths = np.array([_depth(shadows, row) for row in rows]) if limited else None
            polygons = launch_shrink(shadows.umbras, rows, points, depths, device=device)
            for row in np.flatnonzero(np.diff(polygons.starts)):
                outline = polygons.corners[polygons.starts[row] : polygons.starts[row + 1]]
                box = shadows.questions[shadows.of[row]].box
                normal, far = shadows.umbras.normal[row], shadows.umbras.far[row]
                claimed[shadows.of[row]] |= _behind(points[row], outline, normal, far, box)
    for asked, claim in zip(shadows.questions, claimed, strict=True):
        yield asked.name, one_sided(bool(claim), asked.hidden)


def _depth(shadows: _Shadows, row: int) -> float:
    """How far the question's box reaches beyond the occluder of an umbra, and a step more."""
    corners = np.array(box_corners(shadows.questions[shadows.of[row]].box), float)
    return float((corners @ shadows.umbras.normal[row]).max() - shadows.umbras.far[row]) + 1.0 + 1e-6


def _behind(eye: np.ndarray, outline: np.ndarray, normal: np.ndarray, far: float, box: Shape) -> bool:
    """Whether a box is behind a convex polygon as seen from the eye, exactly for the float64 corners given."""
    (viewpoint, n), corners = rational([eye.tolist(), normal.tolist()]), rational(outline.tolist())
    points = box_corners(box)
    if any(dot(n, x) < Fraction(float(far)) for x in points):
        return False
    sides = zip(corners, corners[1:] + corners[:1], strict=True)
    planes = [cross(minus(a, viewpoint), minus(b, viewpoint)) for a, b in sides]
    return all(dot(m, minus(x, viewpoint)) >= 0 for m in planes for x in points)


def _maps(cases: HardCases, device: Device) -> Iterator[CubeMaps]:
    for case in cases.coverage:
        polygons = [face for shape in case.polygons for face in faces(shape)]
        starts = starts_of([len(p) for p in polygons])
        corners = np.array([corner for polygon in polygons for corner in polygon], float)
        owners = np.zeros(len(polygons), int)
        yield launch_coverage(np.array([case.viewpoint]), corners, starts, owners, resolution=case.size, device=device)


def coverage(cases: HardCases, device: Device) -> Outcomes:
    """Pixels that are covered."""
    for case, maps in zip(cases.coverage, _maps(cases, device), strict=True):
        found = {tuple(pixel) for pixel in np.argwhere(np.isfinite(maps.depth(0))).tolist()}
        outcome = Outcome.RIGHT if found == case.pixels else Outcome.WITHHELD
        yield case.name, Outcome.WRONG if found - case.pixels else outcome


def occludees(cases: HardCases, device: Device) -> Outcomes:
    """Boxes in cube maps, and behind shrunk occluders."""
    for case, maps in zip(cases.coverage, _maps(cases, device), strict=True):
        verdict = launch_occludees(maps, np.array([case.box]), np.array([[0, 0]]))[0]
        yield case.name, one_sided(bool(verdict == Verdict.HIDDEN), case.expected == "hidden")
    shadows = _Shadows.of_cases(cases, device)
    yield from _projected(shadows, shadows.cells.mean(axis=1), device)


def _projected(shadows: _Shadows, points: np.ndarray, device: Device) -> Outcomes:
    """Questions by shrunk occluders in cube maps, one projection point each."""
    polygons = launch_shrink(shadows.umbras, np.arange(len(shadows.of)), points[shadows.of], device=device)
    sizes = np.diff(polygons.starts)
    starts = starts_of(sizes[sizes > 0])
    owners = shadows.of[sizes > 0]
    maps = launch_coverage(points, polygons.corners, starts, owners, resolution=RESOLUTION, device=device)
    boxes = np.array([asked.box for asked in shadows.questions], np.int32)
    verdicts = launch_occludees(maps, boxes, np.repeat(np.arange(len(boxes))[:, None], 2, axis=1))
    for asked, claim in zip(shadows.questions, verdicts == Verdict.HIDDEN, strict=True):
        yield asked.name, one_sided(bool(claim), asked.hidden)


def points(cases: HardCases, device: Device) -> Outcomes:
    """All occluders of a question as one cluster."""
    shadows = _Shadows.of_cases(cases, device)
    for objective in ("socp", "lp"):
        cluster = np.zeros(len(shadows.of), int)
        options = {"objective": objective, "depth": 4096.0}
        problems = cluster_problems(shadows.umbras, shadows.cells, shadows.of, cluster, 1, **options)
        for name, outcome in _projected(shadows, solve_points(problems).point, device):
            yield f"{name}, {objective}", outcome


def vlod(cases: HardCases, device: Device) -> Outcomes:
    """The whole method, one cell at a time."""
    settings = VlodSettings(clusters=6, objective="centre", resolution=RESOLUTION)
    for asked in _questions(cases):
        cells, boxes = np.array([asked.cell], np.int32), np.array([asked.box], np.int32)
        hidden, _ = vlod_hidden(cells, _outlines(asked.shapes), boxes, np.zeros(1, int), settings, device=device)
        yield asked.name, one_sided(bool(hidden[0, 0]), asked.hidden)
