"""Cases on a furnished office: back-face culling, the shaft test, confirming sightlines."""

from functools import cache, partial

import numpy as np

from ....data.buildings.office import make_office
from ....data.prepared import PreparedModel
from ....data.regions import Regions
from ....data.scene import OPAQUE, Scene
from ....data.solids import closed_elements
from ....data.verdict import Verdict
from ....kernels import backface as backface_kernels
from ....kernels import shaft as shaft_kernels
from ....kernels import sightline as sightline_kernels
from ....kernels.backface import build_cones, launch_backface
from ....kernels.launch import Device
from ....kernels.shaft import ShaftAnswers, launch_shaft
from ....kernels.shields import device_shields
from ....kernels.sightline import device_triangles, launch_confirm
from ....verify.exact.backface import back_facing, outward_triangles
from ....verify.exact.sightline import Sight, Sightlines
from ....verify.rays.embree import embree_scene
from ..suite import Case, Errors
from .shadow import sampled_errors

FLOORS, ROOMS = 1, 3
JUDGED_CULLS, REFERENCE_CULLS = 40, 100
JUDGED_SHAFTS, SEGMENTS_A_SHAFT, REFERENCE_SHAFTS = 100, 40, 20
JUDGED_RAYS = 500
# Sides that the shaft test does not halve further [grid steps], and pieces per pair.
SMALLEST, PIECES = (256, 256), 300


@cache
def office() -> Scene:
    """A storey with six rooms, furnished."""
    return make_office(floors=FLOORS, rooms_per_side=ROOMS, seed=4)


def prepared(scene: Scene) -> PreparedModel:
    """A model whose furniture hides by its sections alone: as in 0.1.0, so that times compare."""
    model = PreparedModel(scene)
    model.blocking_planes = model.surfaces
    return model


@cache
def opaque_triangles() -> tuple[np.ndarray, np.ndarray]:
    """The office's opaque triangles and their owners."""
    return office().triangles(*OPAQUE)


@cache
def sightlines() -> Sightlines:
    """Exact judge of segments in the office."""
    return Sightlines(*opaque_triangles())


def boxes_in_spaces(
    random: np.random.Generator, count: int, sides: tuple[float, float], scene: Scene | None = None
) -> np.ndarray:
    """Boxes with sides of so many metres inside rooms, shape (count, 2, 3), int32; they may overlap furniture."""
    scene = scene or office()
    spaces = np.array([[s.vertices.min(axis=0), s.vertices.max(axis=0)] for s in scene.spaces])
    chosen = np.round(spaces[random.integers(0, len(spaces), count)] / scene.grid_m)
    extent = np.minimum(random.uniform(*sides, (count, 3)) / scene.grid_m, chosen[:, 1] - chosen[:, 0])
    low = chosen[:, 0] + random.random((count, 3)) * (chosen[:, 1] - chosen[:, 0] - extent)
    return np.stack([low, low + np.maximum(extent, 1)], axis=1).astype(np.int32)


def backface_cases(n: int, device: Device) -> list[Case]:
    """Triangles of n (view cell, object) pairs that turn their backs; error-free is exactly as many as the twin."""
    random = np.random.default_rng(n)
    triangles, owners = opaque_triangles()
    cones = build_cones(closed_elements(office()), office().triangle_counts)
    cells = boxes_in_spaces(random, 64, (0.5, 2.0))
    rows = np.column_stack([random.integers(0, len(cells), n), random.choice(np.unique(owners), n)])
    solid = triangles.astype(float)

    def judge(found: tuple[np.ndarray, np.ndarray]) -> Errors:
        over = under = 0
        for (cell, owner), count in zip(rows[:JUDGED_CULLS], found[0], strict=False):
            own = triangles[owners == owner]
            truth = int(np.sum(np.array(back_facing(own, cells[cell])) & outward_triangles(own)))
            over, under = over + max(0, count - truth), under + max(0, truth - count)
        return Errors(wrong_hidden=int(over), wrong_visible=int(under))

    return [
        Case(
            kernel="backface",
            scene=f"office ({JUDGED_CULLS} pairs)",
            method="kernel",
            n=n,
            work=lambda: launch_backface(cones, cells, rows, device=device),
            judge=judge,
            baseline="NumPy float64",
            reference=lambda: [numpy_backface(solid[owners == o], cells[c]) for c, o in rows[:REFERENCE_CULLS]],
            share=min(n, REFERENCE_CULLS) / n,
            modules=[backface_kernels.__name__],
        )
    ]


def numpy_backface(triangles: np.ndarray, cell: np.ndarray) -> int:
    """Triangles that have the farthest corner of a box behind their plane; plain NumPy."""
    a, b, c = triangles.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    farthest = np.where(normal > 0, cell[1], cell[0])
    return int((((farthest - a) * normal).sum(axis=1) <= 0).sum())


def shaft_cases(n: int, device: Device) -> list[Case]:
    """N pairs of a view cell and a small box, each in a room; judged by exact segments from outside all solids."""
    random = np.random.default_rng(n)
    model = prepared(office())
    shields = device_shields(model.regions, model.patches, device)
    boxes = np.concatenate([boxes_in_spaces(random, n, (0.5, 1.5)), boxes_in_spaces(random, n, (0.1, 0.6))])
    rows = np.arange(2 * n).reshape(2, n).T
    return [
        Case(
            kernel="shaft",
            scene=f"office ({min(n, JUDGED_SHAFTS)} pairs)",
            method="kernel",
            n=n,
            work=lambda: launch_shaft(shields, boxes, rows, smallest=SMALLEST, cap=PIECES, device=device),
            judge=partial(judge_shafts, boxes, rows[:JUDGED_SHAFTS], random),
            baseline="NumPy, unsplit",
            reference=lambda: numpy_shafts(model.regions, boxes, rows[:REFERENCE_SHAFTS]),
            share=min(n, REFERENCE_SHAFTS) / n,
            modules=[shaft_kernels.__name__],
        )
    ]


def judge_shafts(boxes: np.ndarray, rows: np.ndarray, random: np.random.Generator, found: ShaftAnswers) -> Errors:
    """Hidden pairs against exact segments."""
    share = np.round(random.random((2, len(rows), SEGMENTS_A_SHAFT, 3)) * 1024) / 1024
    origins, ends = (
        (boxes[side, :1] + part * (boxes[side, 1:] - boxes[side, :1])).reshape(-1, 3)
        for side, part in zip(rows.T, share, strict=True)
    )
    clear = sightlines().outside_solids(origins) & (sightlines().check(origins, ends) == Sight.CLEAR)
    return sampled_errors(found.verdict[: len(rows)] == Verdict.HIDDEN, clear.reshape(len(rows), -1).any(axis=1))


def numpy_shafts(regions: Regions, boxes: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Pairs between whose boxes one rectangle stands that covers their shaft; nothing is halved; plain NumPy."""
    axis = (regions.boxes[:, 1] == regions.boxes[:, 0]).argmax(axis=1)
    low, high = regions.boxes[:, 0].astype(float), regions.boxes[:, 1].astype(float)
    plane = low[np.arange(len(axis)), axis][:, None, None, None]
    hidden = np.zeros(len(rows), bool)
    for k, (v, x) in enumerate(boxes[rows].astype(float)):
        near, far = v[:, axis].T[:, :, None], x[:, axis].T[:, None, :]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (plane[..., 0] - near) / (far - near)
        between = ((t >= 0) & (t <= 1)).all(axis=(1, 2)) & np.isfinite(t).all(axis=(1, 2))
        t = np.where(between[:, None, None], t, 0.0)[..., None]
        covers = ((v[0] + t * (x[0] - v[0]) >= low[:, None, None]) | _is_axis(axis)).all(axis=(1, 2, 3))
        covers &= ((v[1] + t * (x[1] - v[1]) <= high[:, None, None]) | _is_axis(axis)).all(axis=(1, 2, 3))
        hidden[k] = (between & covers).any()
    return hidden


def _is_axis(axis: np.ndarray) -> np.ndarray:
    """True at the axis of each rectangle, shape (n, 1, 1, 3)."""
    return (axis[:, None] == np.arange(3))[:, None, None]


def rays_cases(n: int, device: Device) -> list[Case]:
    """N random segments in the office: which are clear. Embree answers the same in float32, and may be wrong."""
    random = np.random.default_rng(n)
    triangles, owners = opaque_triangles()
    scene = device_triangles(triangles, owners, device)
    bounds = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    origins, ends = random.uniform(*bounds, (2, n, 3)).astype(np.float32).astype(float)
    nobody = np.full(n, -1)
    embree = embree_scene(triangles)
    starts, ways = origins.astype(np.float32), (ends - origins).astype(np.float32)

    def judge(found: np.ndarray) -> Errors:
        truth = sightlines().check(origins[:JUDGED_RAYS], ends[:JUDGED_RAYS]) == Sight.CLEAR
        clear = found[: len(truth)]
        return Errors(wrong_visible=int((clear & ~truth).sum()), unknown_pct=100.0 * float((truth & ~clear).mean()))

    return [
        Case(
            kernel="rays",
            scene=f"office ({min(n, JUDGED_RAYS)} segments)",
            method="confirm",
            n=n,
            work=lambda: launch_confirm(scene, origins, ends, nobody, device=device),
            judge=judge,
            baseline="embreex raw",
            # With query OCCLUDED embreex overwrites the distances that limit a ray.
            reference=lambda: embree.run(starts, ways, dists=np.ones(n, np.float32), query="OCCLUDED"),
            share=1.0,
            modules=[sightline_kernels.__name__],
        )
    ]
