"""Cases of shadows: umbras and shrunk occluders against rationals, cube maps against exact segments."""

from functools import partial

import numpy as np

from ....data.patches import Patches
from ....data.verdict import Verdict
from ....kernels import coverage as coverage_kernels
from ....kernels import shrink as shrink_kernels
from ....kernels import umbra as umbra_kernels
from ....kernels.coverage import CubeMaps, launch_coverage
from ....kernels.launch import Device
from ....kernels.occludee import launch_occludees
from ....kernels.shrink import Polygons, launch_shrink
from ....kernels.umbra import USABLE, Umbras, launch_umbra
from ....verify.arithmetic import rational
from ....verify.exact.shrink import shrunk
from ....verify.exact.sightline import Sight, Sightlines
from ....verify.exact.umbra import hides, occluder
from ..suite import Case, Errors

JUDGED_PAIRS, POINTS_A_PAIR = 40, 8
REFERENCE_SHRINKS = 200
RESOLUTION, REFERENCE_POLYGONS = 128, 10
JUDGED_BOXES, SEGMENTS_A_BOX = 200, 24
# A point this far beyond a polygon, in units of its distance from the projection point, is behind it.
BEYOND = np.array([1.001, 1.5, 30.0])


def parallelograms(random: np.random.Generator, count: int) -> Patches:
    """Planar outlines in any direction, some of them axial, exactly planar on the grid."""
    f, g = random.integers(-1500, 1501, (2, count, 3))
    axial = random.random(count) < 0.3
    f[axial, 1:] = 0
    g[axial, ::2] = 0
    f[f.any(axis=1) == 0, 0] = g[g.any(axis=1) == 0, 1] = 700
    low = random.integers(-500, 500, (count, 3))
    corners = np.stack([low, low + f, low + f + g, low + g], axis=1)
    cross = np.cross(f, g).astype(float)
    area = np.linalg.norm(cross, axis=1)
    normal = cross / np.maximum(area, 1.0)[:, None]
    heights = np.einsum("nki,ni->nk", corners, normal)
    return Patches(
        corners.reshape(-1, 3).astype(np.int32),
        np.arange(count + 1) * 4,
        np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1).astype(np.int32),
        normal,
        np.stack([heights.min(axis=1) - 1e-6, heights.max(axis=1) + 1e-6], axis=1),
        np.arange(count, dtype=np.int32),
        area,
    )


def shadow_cases(n: int, device: Device) -> list[Case]:
    """N view cells, each with an outline before it: its umbra, and what is left of it from a point of the cell."""
    random = np.random.default_rng(n)
    outlines = parallelograms(random, n)
    corners = outlines.corners.reshape(-1, 4, 3)
    away = outlines.normal * random.uniform(800, 4000, (n, 1)) * random.choice([-1, 1], (n, 1))
    low = np.round(corners.mean(axis=1) + away).astype(np.int32)
    cells = np.stack([low, low + random.integers(64, 1024, (n, 3))], axis=1).astype(np.int32)
    points = cells[:, 0] + random.uniform(0.1, 0.9, (n, 3)) * (cells[:, 1] - cells[:, 0])
    pairs = np.repeat(np.arange(n)[:, None], 2, axis=1)
    umbras = launch_umbra(cells, outlines, pairs, device=device)
    usable = np.flatnonzero(umbras.status == USABLE)
    few = usable[:REFERENCE_SHRINKS]
    exact = [occluder(cells[k].tolist(), corners[k].tolist()) for k in usable[:JUDGED_PAIRS]]

    def judge_umbra(found: Umbras) -> Errors:
        held, truth = [], []
        for row, one in zip(usable, exact, strict=False):
            x = points_behind(random, cells[row], corners[row])
            held.append(found.contains(row, x))
            truth.append([hides(one, point) for point in rational(x.tolist())])
        held, truth = np.concatenate(held), np.concatenate(truth)
        return Errors(wrong_hidden=int((held & ~truth).sum()), wrong_visible=int((truth & ~held).sum()))

    def judge_shrink(found: Polygons) -> Errors:
        wrong, size, whole = 0, 0.0, 0.0
        for place, one in enumerate(exact):
            row = usable[place]
            polygon = found.corners[found.starts[place] : found.starts[place + 1]]
            whole += polygon_area(np.array([[float(c) for c in q] for q in shrunk(one, rational([points[row]])[0])]))
            size += polygon_area(polygon)
            if len(polygon):
                q = random.dirichlet(np.ones(len(polygon)), len(BEYOND)) @ polygon
                x = points[row] + BEYOND[:, None] * (q - points[row])
                wrong += sum(not hides(one, point) for point in rational(x.tolist()))
        return Errors(wrong_hidden=wrong, gap=1.0 - size / whole)

    def reference_shrink() -> None:
        planes = numpy_umbra(cells[few], corners[few])[0]
        for k, row in enumerate(few):
            numpy_shrink(corners[row].astype(float), planes[k], points[row])

    common = {"n": n, "baseline": "NumPy float64", "modules": [umbra_kernels.__name__, shrink_kernels.__name__]}
    return [
        Case(
            kernel="shadow",
            scene=f"quads ({JUDGED_PAIRS * POINTS_A_PAIR} points)",
            method="umbra",
            work=lambda: launch_umbra(cells, outlines, pairs, device=device),
            judge=judge_umbra,
            reference=lambda: numpy_umbra(cells, corners),
            share=1.0,
            **common,
        ),
        Case(
            kernel="shadow",
            scene=f"quads ({JUDGED_PAIRS})",
            method="shrink",
            work=lambda: launch_shrink(umbras, usable, points[usable], device=device),
            judge=judge_shrink,
            reference=reference_shrink,
            share=len(few) / len(usable),
            **common,
        ),
    ]


def points_behind(random: np.random.Generator, cell: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """Points behind an outline and beside, seen from the cell, multiples of 1/64, shape (n, 3)."""
    middle = outline.mean(axis=0)
    through = random.dirichlet(np.full(len(outline), 0.4), POINTS_A_PAIR) @ outline
    through = middle + (through - middle) * random.choice([0.3, 0.9, 1.2], (POINTS_A_PAIR, 1))
    away = (through - cell.mean(axis=0)) * random.choice([0.1, 0.5, 3.0], (POINTS_A_PAIR, 1))
    return np.round((through + away) * 64) / 64


def polygon_area(corners: np.ndarray) -> float:
    """Area of a planar polygon, 0 for fewer than three corners."""
    if len(corners) < 3:
        return 0.0
    spokes = corners[1:] - corners[0]
    return 0.5 * float(np.linalg.norm(np.cross(spokes[:-1], spokes[1:]).sum(axis=0)))


def numpy_umbra(cells: np.ndarray, outlines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Supporting planes m . x >= c of box cells (n, 2, 3) and quads (n, 4, 3): shapes (n, 4, 3), (n, 4); plain NumPy.

    Of the planes through an edge and a corner of the cell, the one with all other corners on the inner side.

    Source: Chhugani et al. 2005, section 5.2.
    """
    pick = np.array([[(k >> axis) & 1 for axis in range(3)] for k in range(8)])
    corners = cells[:, pick, np.arange(3)].astype(float)
    rows = np.arange(len(cells))
    planes, offsets = np.empty((len(cells), 4, 3)), np.empty((len(cells), 4))
    for edge in range(4):
        a, b = outlines[:, edge].astype(float), outlines[:, (edge + 1) % 4].astype(float)
        inner = outlines[:, (edge + 2) % 4] - a
        m = np.cross((b - a)[:, None], corners - a[:, None])
        m *= np.sign(np.einsum("npi,ni->np", m, inner))[:, :, None]
        m /= np.maximum(np.linalg.norm(m, axis=2), 1e-300)[:, :, None]
        best = np.einsum("npi,nqi->npq", m, corners - a[:, None]).min(axis=2).argmax(axis=1)
        planes[:, edge] = m[rows, best]
        offsets[:, edge] = (planes[:, edge] * a).sum(axis=1)
    return planes, offsets


def numpy_shrink(polygon: np.ndarray, planes: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The part of a polygon with m . q >= m . point for every plane: behind it the umbra is never left."""
    for m in planes:
        heights = (polygon - point) @ m
        out = []
        for k, height in enumerate(heights):
            after = heights[k - len(heights) + 1]
            if height >= 0:
                out.append(polygon[k])
            if (height >= 0) != (after >= 0):
                step = height / (height - after)
                out.append(polygon[k] + step * (polygon[k - len(heights) + 1] - polygon[k]))
        if not out:
            return np.zeros((0, 3))
        polygon = np.array(out)
    return polygon


def coverage_cases(n: int, device: Device) -> list[Case]:
    """A cube map of n triangles about a point; what it covers is judged by exact segments to small boxes behind."""
    random = np.random.default_rng(n)
    size = 16_000 / np.sqrt(n)
    directions = random.normal(size=(n, 1, 3))
    middle = 3000 * directions / np.linalg.norm(directions, axis=2, keepdims=True)
    triangles = np.round(middle + size * random.uniform(-1, 1, (n, 3, 3))).astype(np.int32)
    eye = np.array([[0.5, 0.25, 0.125]])
    corners, starts = triangles.reshape(-1, 3).astype(float), np.arange(n + 1) * 3
    owners = np.zeros(n, int)
    return [
        Case(
            kernel="coverage",
            scene=f"triangles ({JUDGED_BOXES} boxes)",
            method="kernel",
            n=n,
            work=lambda: launch_coverage(eye, corners, starts, owners, resolution=RESOLUTION, device=device),
            judge=partial(judge_coverage, triangles, eye, random),
            baseline="NumPy float64",
            reference=lambda: numpy_coverage(eye[0], triangles[:REFERENCE_POLYGONS].astype(float)),
            share=min(n, REFERENCE_POLYGONS) / n,
            modules=[coverage_kernels.__name__],
        )
    ]


def judge_coverage(triangles: np.ndarray, eye: np.ndarray, random: np.random.Generator, maps: CubeMaps) -> Errors:
    """Boxes that the map covers against exact segments from its eye to points of them."""
    away = random.normal(size=(JUDGED_BOXES, 3))
    low = np.round(away * random.uniform(7000, 12_000, (JUDGED_BOXES, 1)) / np.linalg.norm(away, axis=1)[:, None])
    boxes = np.stack([low, low + random.integers(20, 200, (JUDGED_BOXES, 3))], axis=1).astype(np.int32)
    rows = np.column_stack([np.arange(JUDGED_BOXES), owners_of(boxes)])
    hidden = launch_occludees(maps, boxes, rows) == Verdict.HIDDEN
    share = random.random((JUDGED_BOXES, SEGMENTS_A_BOX, 3))
    share[:, :8] = np.array([[(k >> axis) & 1 for axis in range(3)] for k in range(8)])
    ends = (boxes[:, :1] + share * (boxes[:, 1:] - boxes[:, :1])).reshape(-1, 3)
    clear = Sightlines(triangles).check(np.repeat(eye, len(ends), axis=0), ends) == Sight.CLEAR
    return sampled_errors(hidden, clear.reshape(JUDGED_BOXES, -1).any(axis=1))


def owners_of(boxes: np.ndarray) -> np.ndarray:
    """The only map, for every box."""
    return np.zeros(len(boxes), int)


def sampled_errors(hidden: np.ndarray, seen: np.ndarray) -> Errors:
    """Against sampled truth: what is seen is visible, what is not seen may be."""
    return Errors(
        wrong_hidden=int((hidden & seen).sum()),
        unknown_pct=100.0 * float((~hidden & ~seen).mean()),
        overestimate=float((~hidden).sum() / max(seen.sum(), 1)),
    )


def numpy_coverage(eye: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Farthest depth of the nearest triangle that covers each pixel's whole square, shape (6, size, size); plain NumPy.

    A pixel is covered if its four corners are; depth is linear in 1 / depth over a face, so corners bound it.
    """
    out = np.full((6, RESOLUTION, RESOLUTION), np.inf)
    ticks = np.linspace(-1, 1, RESOLUTION + 1)
    for face in range(6):
        axis = face // 2
        d = np.empty((RESOLUTION + 1, RESOLUTION + 1, 3))
        d[..., axis] = 1 - 2 * (face % 2)
        d[..., (axis + 1) % 3], d[..., (axis + 2) % 3] = ticks[None], ticks[:, None]
        for corners in triangles - eye:
            sides = d @ np.cross(corners, np.roll(corners, -1, axis=0)).T
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            with np.errstate(divide="ignore"):
                depth = (normal @ corners[0]) / (d @ normal)
            inside = ((sides >= 0).all(axis=2) | (sides <= 0).all(axis=2)) & (depth > 0)
            whole = inside[:-1, :-1] & inside[1:, :-1] & inside[:-1, 1:] & inside[1:, 1:]
            far = np.maximum.reduce([depth[:-1, :-1], depth[1:, :-1], depth[:-1, 1:], depth[1:, 1:]])
            out[face] = np.where(whole, np.minimum(out[face], far), out[face])
    return out
