"""Hard cases of meshes and levels: back faces, clipping, deviation, pictures, and the choice of levels."""

from fractions import Fraction

import numpy as np

from ...data.camera import CameraPath, Screen
from ...data.scene import Definition, Instance, Mesh, Role, Scene
from ...data.solids import closed_elements
from ...kernels.backface import build_cones, launch_backface
from ...kernels.clip import launch_clip
from ...kernels.deviation import launch_deviation
from ...kernels.launch import Device
from ...kernels.raster import device_triangles as raster_triangles
from ...kernels.raster import launch_raster
from ...kernels.select import launch_select
from ...verify.cases.hard_cases import HardCases, Shape, faces, fan
from ...verify.exact.clip import bounds_of, clipped
from ...verify.exact.deviation import deviation_squared
from ...verify.exact.raster import first_hit
from .outcomes import Outcome, Outcomes, worst

# Quarterings of a triangle in rationals, and how near the bounds on a deviation should be to each other.
PIECES, TIGHT = 1, 0.02
# What a pixel shows is left to rounding where its centre is so near to an edge (squared), or two surfaces to another.
SURE = 1e-12


def triangles_of(shapes: list[Shape]) -> np.ndarray:
    """Triangles of shapes, shape (m, 3, 3), float64."""
    return np.array([t for shape in shapes for face in faces(shape) for t in fan(face)], float)


def scene_of(shapes: list[Shape]) -> Scene:
    """One object of shapes; a grid of 1 m keeps them as they are, and makes none too small to be used."""
    corners = triangles_of(shapes)
    mesh = Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3))
    objects = [Instance("object", "", 0, np.eye(4), Role.OCCLUDER)]
    return Scene([Definition("shape", (mesh,))], objects, grid_m=1.0)


def backface(cases: HardCases, device: Device) -> Outcomes:
    """Triangles that are turned away."""
    for case in cases.backface:
        boxes, rows, scene = np.array([case.cell], np.int32), np.zeros((1, 2), int), scene_of(case.surface)
        cones = build_cones(closed_elements(scene), scene.triangle_counts)
        removed = int(launch_backface(cones, boxes, rows, device=device)[0][0])
        outcome = Outcome.RIGHT if removed == case.expected else Outcome.WITHHELD
        yield case.name, Outcome.WRONG if removed > case.expected else outcome


def select(cases: HardCases, device: Device) -> Outcomes:
    """All whole numbers: values are exact. Less than the optimum is withheld, less than half of the gain wrong."""
    for case in cases.knapsack:
        levels = np.array([level for levels in case.objects for level in levels])
        starts = np.cumsum([0, *map(len, case.objects)])
        found = launch_select(levels[None, :, 0].astype(float), levels[:, 1], starts, case.budget, device=device)
        if case.expected is None or not found.feasible[0]:
            yield case.name, Outcome.RIGHT if (case.expected is None) != found.feasible[0] else Outcome.WRONG
            continue
        value, cost = levels[starts[:-1] + found.choice[0]].sum(axis=0).tolist()
        told = value == found.value[0] and cost == found.cost[0]
        base = sum(max(levels, key=lambda level: (-level[1], level[0]))[0] for levels in case.objects)
        half = case.expected - base <= 2 * (value - base)
        if told and half and cost <= case.budget and value <= case.expected <= found.bound[0]:
            yield case.name, Outcome.RIGHT if value == case.expected else Outcome.WITHHELD
        else:
            yield case.name, Outcome.WRONG


def clip(cases: HardCases, device: Device) -> Outcomes:
    """What is left of all shapes in the box from the cell's middle to the target's: no less than in rationals."""
    for case in cases.region:
        triangles = triangles_of([*case.occluders, case.target]).astype(np.int32)
        middles = [np.array(box, np.int64).sum(axis=0) // 2 for box in (case.cell, case.target)]
        box = np.array([np.min(middles, axis=0), np.max(middles, axis=0)], np.int32)
        found = launch_clip(triangles, np.array([[0, len(triangles)]]), box[None], device=device)[0].tolist()
        left = [polygon for polygon in (clipped(t, *box) for t in triangles) if len(polygon) > 2]
        if not left:
            yield case.name, Outcome.RIGHT if any(a > b for a, b in zip(*found, strict=True)) else Outcome.WITHHELD
            continue
        least, most = bounds_of([point for polygon in left for point in polygon])
        held = all(a <= b for a, b in [*zip(found[0], least, strict=True), *zip(most, found[1], strict=True)])
        tight = all(b - a < 2 for a, b in [*zip(found[0], least, strict=True), *zip(most, found[1], strict=True)])
        yield case.name, (Outcome.RIGHT if tight else Outcome.WITHHELD) if held else Outcome.WRONG


def deviation(cases: HardCases, device: Device) -> Outcomes:
    """From the occluders' surface to the target's and back: the bounds must not miss what rationals say."""
    for case in (c for c in cases.region if len(c.occluders) == 1):
        sides = [triangles_of(shapes) for shapes in (case.occluders, [case.target])]
        found = launch_deviation(*sides, device=device)
        exact = [[tuple(tuple(Fraction(int(c)) for c in p) for p in t) for t in side.tolist()] for side in sides]
        outcomes = []
        for way, (a, b) in enumerate((exact, exact[::-1])):
            least, most = deviation_squared(a, b, PIECES)
            lower, upper = (Fraction(float(bound[way])) for bound in (found.lower, found.upper))
            if upper**2 < least or lower**2 > most:
                outcomes.append(Outcome.WRONG)
            else:
                outcomes.append(Outcome.RIGHT if upper <= lower * (1 + TIGHT) + 1 else Outcome.WITHHELD)
        yield case.name, worst(outcomes)


def raster(cases: HardCases, device: Device) -> Outcomes:
    """A small picture from the cell's middle towards the target's: what rationals tell surely must be shown."""
    screen = Screen(2, 2, 60.0)
    for case in cases.region:
        shapes = [*case.occluders, case.target]
        triangles = [triangles_of([shape]) for shape in shapes]
        owners = np.repeat(np.arange(len(shapes)), [len(part) for part in triangles])
        corners = np.concatenate(triangles).astype(np.int32)
        eye, goal = (np.array(box, float).mean(axis=0) for box in (case.cell, case.target))
        way = goal - eye
        yaw, pitch = np.degrees([np.arctan2(way[1], way[0]), np.arctan2(way[2], np.hypot(way[0], way[1]))])
        axes = CameraPath(eye[None], np.array([yaw]), np.array([pitch]), np.zeros(1)).axes()
        calls = np.column_stack([np.arange(len(owners)), np.arange(len(owners)) + 1, owners])
        size = {"width": screen.width, "height": screen.height, "focal": screen.focal, "near": 1.0}
        scene = raster_triangles(corners, device)
        shown = launch_raster(scene, calls, np.array([0, len(calls)]), eye[None], axes, device=device, **size).ids[0]
        outcomes = []
        for row, column in np.ndindex(screen.height, screen.width):
            pixel = (column + 0.5 - screen.width / 2, screen.height / 2 - row - 0.5)
            hit = first_hit(corners, owners, eye, axes[0], pixel, screen.focal, 1.0)
            sure = (hit.clear is None or hit.clear > SURE) and (hit.lead is None or hit.lead > SURE)
            same = int(shown[row, column]) == hit.owner
            outcomes.append(Outcome.RIGHT if same else Outcome.WRONG if sure else Outcome.WITHHELD)
        yield case.name, worst(outcomes)
