"""What the eye sees along a walk: objects and time of each frame, and whether rays from the eye meet anything else."""

import argparse
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...data.camera import CameraPath, Screen
from ...data.store.bake_folder import BakeFolder, read_bake
from ...kernels.eye import EyeAnswers, EyeModel, eye_model, launch_eye
from ...kernels.launch import CPU
from ...verify.rays.looks import Eyewitness
from ..export.sets import model_of
from ..summary import table
from ..walk.path import walk

FRAMES, RAYS_FRAMES, RAYS = 9_000, 300, 20_000
SCREEN = Screen()


@dataclass(frozen=True)
class EyeBench:
    """Frames of a walk.

    Attributes:
        objects: kept by the wedge, by way: boxes in the frustum, the wedge, without sets, rectangles alone; of each
            frame.
        each_ms: kernel and launcher for one frame at a time, CPU time of the thread.
        batch_ms: CPU time of a frame, all at once.
        sequences: portals passed for each frame.
        looked: frames that rays were cast in.
        rays: cast.
        seen: objects that the rays of a frame met, on average.
        dropped: objects that rays met and the wedge dropped; any is an error.
        doubtful: likewise, but met at edges only.
    """

    objects: dict[str, np.ndarray]
    each_ms: np.ndarray
    batch_ms: float
    sequences: np.ndarray
    looked: int
    rays: int
    seen: float
    dropped: int
    doubtful: int

    def text(self) -> str:
        """Two tables."""
        rows = [(way, f"{count.mean():,.1f}", f"{count.max():,}") for way, count in self.objects.items()]
        times = np.quantile(self.each_ms, (0.5, 0.99, 1.0))
        return "\n".join(
            [
                table(("objects a frame", "mean", "most"), rows),
                "",
                f"one frame at a time, ms: {times[0]:.2f} median, {times[1]:.2f} 99 %, {times[2]:.2f} most; "
                f"all at once {self.batch_ms:.3f} each",
                f"portals passed: {self.sequences.mean():.0f} mean, {self.sequences.max():,} most; given up for "
                f"rectangles in {(self.sequences < 0).sum():,} of {len(self.sequences):,} frames",
                f"{self.rays:,} rays in {self.looked:,} frames: {self.seen:.1f} objects seen a frame, "
                f"{self.dropped:,} dropped ({self.doubtful:,} more at edges only)",
            ]
        )


def part_of(path: CameraPath, frames: np.ndarray | slice) -> CameraPath:
    """Some frames of a path."""
    return replace(path, **{name: column[frames] for name, column in vars(path).items()})


def kept_by(answers: EyeAnswers) -> list[np.ndarray]:
    """Objects of each frame."""
    return np.split(answers.objects, answers.starts[1:-1])


def measure_eye(bake: BakeFolder, frames: int, looked: int, rays: int) -> EyeBench:
    """Walk through a bake.

    Raises:
        InputError: no frames, no inhabitable cell, or the bake is of a bare cell graph.
    """
    scene, path = model_of(bake), walk(bake, frames)
    boxes, grid_m = scene.object_bounds(), bake.grid_m
    potential = bake.potential_objects, bake.potential_cells
    bound = eye_model(bake.graph, boxes, grid_m, potential, CPU)
    free = eye_model(bake.graph, boxes, grid_m, device=CPU)
    boxed = eye_model(bake.graph.with_portals(np.zeros(0, int)), boxes, grid_m, potential, CPU)
    launch_eye(bound, part_of(path, slice(1)), SCREEN)
    begin = time.thread_time()
    wedge = launch_eye(bound, path, SCREEN)
    batch_ms = 1e3 * (time.thread_time() - begin) / len(path)
    others = launch_eye(free, path, SCREEN), launch_eye(bound, path, SCREEN, limit=0)
    counts = [np.diff(answers.starts) for answers in (launch_eye(boxed, path, SCREEN), wedge, *others)]
    ways = "boxes in the frustum", "wedge", "wedge without sets", "rectangles alone"
    some = np.unique(np.linspace(0, len(path) - 1, looked).astype(int))
    kept = kept_by(wedge)
    witness = Eyewitness(scene, bake.graph, bake.cracks)
    looks = list(witness.looks(part_of(path, some), SCREEN, [kept[frame] for frame in some], rays))
    return EyeBench(
        dict(zip(ways, counts, strict=True)),
        _each_ms(bound, path),
        batch_ms,
        wedge.sequences,
        len(looks),
        rays * len(looks),
        float(np.mean([len(look.seen) for look in looks])) if looks else 0.0,
        sum(len(look.dropped) for look in looks),
        sum(len(look.doubtful) for look in looks),
    )


def _each_ms(model: EyeModel, path: CameraPath) -> np.ndarray:
    """CPU time of each frame, launched alone."""
    spent = []
    for frame in range(len(path)):
        own = part_of(path, slice(frame, frame + 1))
        begin = time.thread_time()
        launch_eye(model, own, SCREEN)
        spent.append(1e3 * (time.thread_time() - begin))
    return np.array(spent)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Bakes, and how much is measured."""
    parser.add_argument("bakes", nargs="+", type=Path, metavar="BAKE", help="X.bake")
    parser.add_argument("--frames", type=int, default=FRAMES, help=f"of the walk; {FRAMES} by default")
    parser.add_argument("--looked", type=int, default=RAYS_FRAMES, help=f"frames with rays; {RAYS_FRAMES} by default")
    parser.add_argument("--rays", type=int, default=RAYS, help=f"of each; {RAYS} by default")


def run(options: argparse.Namespace) -> int:
    """Print a table of each bake; 1 if anything was dropped."""
    dropped = 0
    for folder in options.bakes:
        found = measure_eye(read_bake(folder), options.frames, options.looked, options.rays)
        print(f"{folder}:\n{found.text()}\n")
        dropped += found.dropped
    return int(dropped > 0)
