"""The software renderer: draws chosen levels of a scene's objects, and says how long it took."""

import time
from collections.abc import Callable

import numpy as np

from ...data.camera import NEAR_M, CameraPath, Screen
from ...data.scene import Scene
from ...kernels.raster import Images, device_triangles, launch_raster
from ...solvers.levels.benefit import NOTHING, Candidates, Sightings, Tuples
from ...solvers.levels.cost_model import CostModel, fit_cost_model

NAME = "the software renderer (z-buffer, one CPU thread)"
SAMPLE_FRAMES = 48
REPEATS = 3


class SoftwareRenderer:
    """Draws frames of a path; every frame is drawn by one CPU thread, hidden surfaces and all."""

    def __init__(self, scene: Scene, tuples: Tuples, sightings: Sightings, screen: Screen) -> None:
        """Place the triangles of all levels of the objects that the path meets."""
        self._screen, self._grid_m = screen, scene.grid_m
        self._ranges: dict[tuple[int, int], tuple[int, int]] = {}
        parts, count = [], 0
        for object_id in np.unique(sightings.object_id).tolist():
            own = slice(*tuples.starts[object_id : object_id + 2])
            for lod in sorted(set(tuples.lod[own].tolist()) - {NOTHING}):
                faces = scene.definitions[scene.objects[object_id].definition_id].lods[lod].faces
                parts.append(scene.world_vertices(object_id, lod)[faces])
                self._ranges[object_id, lod] = (count, count + len(faces))
                count += len(faces)
        self._triangles = device_triangles(np.concatenate([*parts, np.zeros((0, 3, 3), np.int32)]))

    def draw(self, path: CameraPath, frame: int, objects: np.ndarray, lods: np.ndarray) -> tuple[Images, float]:
        """One frame and the CPU seconds it took, which other work on the machine changes least.

        Args:
            path: the eyes.
            frame: which.
            objects: ids, shape (n,).
            lods: level of each, NOTHING for none, shape (n,).
        """
        calls = [
            (*self._ranges[object_id, lod], object_id)
            for object_id, lod in zip(objects.tolist(), lods.tolist(), strict=True)
            if lod != NOTHING
        ]
        calls = np.array(calls, np.int32).reshape(-1, 3)
        eye, axes = path.eyes[frame : frame + 1] / self._grid_m, path.axes()[frame : frame + 1]
        screen, starts = self._screen, np.array([0, len(calls)])
        begun = time.thread_time()
        images = launch_raster(
            self._triangles,
            calls,
            starts,
            eye,
            axes,
            width=screen.width,
            height=screen.height,
            focal=screen.focal,
            near=NEAR_M / self._grid_m,
        )
        return images, time.thread_time() - begun


def measure_samples(
    renderer: SoftwareRenderer,
    path: CameraPath,
    sightings: Sightings,
    tuples: Tuples,
    candidates: Candidates,
    seed: int,
    progress: Callable[[], None] = lambda: None,
) -> dict[str, np.ndarray]:
    """Frames along a path, timed: all objects at their finest, at their coarsest, and some at random levels.

    Returns:
        Columns primitives, pixels, objects and seconds (median of REPEATS), as `fit_cost_model` takes them.
    """
    random, rows = np.random.default_rng(seed), []
    frames = np.unique(np.linspace(0, len(path) - 1, SAMPLE_FRAMES).round().astype(int))
    for frame in frames:
        own = np.arange(*sightings.starts[frame : frame + 2])
        first, size = candidates.starts[own], np.diff(candidates.starts)[own]
        for share in (0.0, 1.0, None, None):
            level = random.random(len(own)) if share is None else np.full(len(own), share)
            chosen = first + np.minimum((level * size).astype(int), np.maximum(size - 2, 0))
            if share is None:
                chosen = chosen[random.random(len(own)) < random.uniform(0.2, 1.0)]
            which = candidates.tuple_id[chosen]
            seconds = [
                renderer.draw(path, int(frame), tuples.owner[which], tuples.lod[which])[1] for _ in range(REPEATS)
            ]
            drawn = int((tuples.lod[which] != NOTHING).sum())
            row = tuples.primitives[which].sum(), candidates.pixels[chosen].sum(), drawn, np.median(seconds)
            rows.append(row)
        progress()
    return dict(zip(("primitives", "pixels", "objects", "seconds"), np.array(rows, np.float64).T, strict=True))


def fit_renderer(samples: dict[str, np.ndarray]) -> CostModel:
    """The cost model of the software renderer."""
    return fit_cost_model(**samples, renderer=NAME)
