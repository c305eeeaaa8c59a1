"""Cases on meshes: the z-buffer beside Embree, deviation bounds beside sampling."""

from functools import partial

import numpy as np
import trimesh

from ....data.buildings.office import make_office
from ....data.camera import NEAR_M, CameraPath, Screen
from ....kernels import deviation as deviation_kernels
from ....kernels import raster as raster_kernels
from ....kernels.deviation import Deviation, launch_deviation
from ....kernels.launch import Device
from ....kernels.raster import Images, device_triangles, launch_raster
from ....verify.exact.raster import first_hit
from ....verify.rays.embree import embree_scene
from ..suite import Case, Errors

JUDGED_PIXELS = 40
# Triangles that stay away from a ray by more than this [pixels] are not put to the exact twin.
MARGIN = 4.0
# Rays nearer than this to an edge [pixels], or surfaces to each other (part of the depth), are left to rounding.
CLEAR, LEAD = 1.0e-6, 1.0e-9
# Points on a surface whose distances are taken one by one.
SAMPLES = 300


def raster_cases(n: int, device: Device) -> list[Case]:
    """One picture of n pixels, 4:3, of an office without furniture; wrong pixels are those that exact rays refute."""
    scene = make_office(floors=1, rooms_per_side=2, furnished=False, seed=4)
    screen = Screen(round((n * 4 / 3) ** 0.5), round((n * 3 / 4) ** 0.5), 60.0)
    triangles, owners = scene.triangles()
    room = scene.spaces[0].vertices
    eye = (room.min(axis=0) + room.max(axis=0)) / 2
    path = CameraPath(eye[None], np.array([20.0]), np.array([-5.0]), np.zeros(1))
    eyes, axes = path.eyes / scene.grid_m, path.axes()
    calls = np.column_stack([np.arange(len(owners)), np.arange(len(owners)) + 1, owners])
    on_device, near = device_triangles(triangles, device), NEAR_M / scene.grid_m
    column, row = np.meshgrid(np.arange(screen.width), np.arange(screen.height))
    right, up = column + 0.5 - screen.width / 2, screen.height / 2 - row - 0.5
    ways = np.stack([right, up, np.full_like(right, screen.focal)], axis=-1).reshape(-1, 3) @ axes[0]
    camera = (triangles - eyes[0]) @ axes[0].T
    starts, embree = np.repeat(eyes, len(ways), axis=0).astype(np.float32), embree_scene(triangles)

    def judge(found: Images) -> Errors:
        wrong = 0
        for pixel in np.random.default_rng(n).choice(len(ways), JUDGED_PIXELS, replace=False):
            at = (float(right.flat[pixel]), float(up.flat[pixel]))
            some = near_ray(camera, np.array(at) / screen.focal, MARGIN / screen.focal)
            truth = first_hit(triangles[some], owners[some], eyes[0], axes[0], at, screen.focal, near)
            certain = (truth.clear is None or truth.clear > CLEAR**2) and (truth.lead is None or truth.lead > LEAD)
            wrong += certain and found.ids[0].flat[pixel] != truth.owner
        return Errors(wrong_hidden=int(wrong))

    return [
        Case(
            kernel="raster",
            scene=f"bare office ({JUDGED_PIXELS})",
            method="kernel",
            n=screen.width * screen.height,
            work=lambda: launch_raster(
                on_device,
                calls,
                np.array([0, len(calls)]),
                eyes,
                axes,
                width=screen.width,
                height=screen.height,
                focal=screen.focal,
                near=near,
                device=device,
            ),
            judge=judge,
            baseline="embreex raw",
            reference=lambda: embree.run(starts, ways.astype(np.float32)),
            share=1.0,
            modules=[raster_kernels.__name__],
        )
    ]


def near_ray(camera: np.ndarray, at: np.ndarray, margin: float) -> np.ndarray:
    """Triangles, in camera coordinates, shape (m, 3, 3), whose bounds on the plane at depth 1 come near to a point."""
    depth = camera[:, :, 2:]
    front = (depth > 0).all(axis=(1, 2))
    flat = camera[:, :, :2] / np.where(depth > 0, depth, 1.0)
    near = ((flat.min(axis=1) - margin < at) & (at < flat.max(axis=1) + margin)).all(axis=1)
    # What the plane of the eye cuts has no such bounds.
    return (front & near) | (~front & (depth > 0).any(axis=(1, 2)))


def deviation_cases(n: int, device: Device) -> list[Case]:
    """A sphere of n triangles, dented at random, and the sphere of a quarter as many; in metres."""
    steps = round(np.log(n / 20) / np.log(4))
    fine, coarse = (trimesh.creation.icosphere(subdivisions=level, radius=1.0) for level in (steps, steps - 1))
    random = np.random.default_rng(n)
    dented = fine.vertices * random.uniform(0.98, 1.02, (len(fine.vertices), 1))
    a, b = dented[fine.faces], np.array(coarse.vertices)[coarse.faces]
    pick = random.integers(0, len(a), SAMPLES)
    points = np.einsum("nk,nkc->nc", random.dirichlet((0.5, 0.5, 0.5), SAMPLES), a[pick])
    return [
        Case(
            kernel="deviation",
            scene=f"spheres ({SAMPLES} points)",
            method="kernel",
            n=len(a),
            work=lambda: launch_deviation(a, b, device=device),
            judge=partial(judge_deviation, points, b),
            baseline="trimesh sampled",
            reference=lambda: sampled_deviation(points, b),
            share=1.0,
            modules=[deviation_kernels.__name__],
        )
    ]


def judge_deviation(points: np.ndarray, b: np.ndarray, found: Deviation) -> Errors:
    """Gap between the bounds; error is by how much a sampled point is farther than the upper bound, relative to it."""
    sampled, upper, lower = sampled_deviation(points, b), float(found.upper[0]), float(found.lower[0])
    return Errors(gap=1.0 - lower / upper, error=max(0.0, sampled / upper - 1.0))


def sampled_deviation(points: np.ndarray, b: np.ndarray) -> float:
    """Greatest distance of the points from the triangles, one by one: a lower bound of the deviation."""
    best = np.full(len(points), np.inf)
    for triangle in b:
        nearest = trimesh.triangles.closest_point(np.repeat(triangle[None], len(points), axis=0), points)
        best = np.minimum(best, np.linalg.norm(nearest - points, axis=1))
    return float(best.max())
