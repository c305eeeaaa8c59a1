"""What the union of random eyes in a view cell sees: a ground truth that others measure by, to be measured itself.

An eye draws a cube map: six square images of 90 degrees along the axes, a ray through the middle of each pixel. It sees
the opaque object that a ray meets first, and every transparent one before it. Sources: 32 eyes a cell are the ground
truth of web3d-pvs (a learned system of 2026), 125 that of vLOD (Chhugani et al. 2005, section 8).
"""

import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.special import binom

from ...data.errors import InputError
from ...data.graph import CellGraph
from ...data.progress import phase
from ...data.scene import OPAQUE, Role, Scene
from ...data.solids import SolidIndex
from .embree import Candidates, embree_scene, through_glass
from .eyes import draw_eyes

# Sizes of the unions.
EYES = (1, 4, 16, 32, 125)
# Rays of all eyes of a cell at one resolution, at most, as long as there is more than one eye.
RAYS_MOST = 1 << 25
# On a side of a face.
PIXELS_MOST = 1 << 14
# Rays cast together.
BATCH = 1 << 17
# Eyes apart from these whose frames, the faces of their cube maps, are looked at; and pixels on a side of a frame.
FRAME_EYES, FRAME_PIXELS = 16, 256
# Points apart from all eyes for which solid angles are taken.
SPOTS = 256
# Draws of points before a view cell that is nearly all solid is left out.
DRAWS = 8
THREADS = 2


@dataclass(frozen=True)
class Views:
    """What eyes in view cells see at one resolution.

    Attributes:
        pixels: on a side of a face of their cube maps.
        marks: what each eye sees, shape (cells, eyes, objects), bool.
        odd: a ray for each pair of cell and object that somebody sees and that was not expected; rows are places among
            the cells.
        seconds: that it took.
    """

    pixels: int
    marks: np.ndarray
    odd: Candidates
    seconds: float

    @property
    def eyes(self) -> int:
        """In each cell."""
        return self.marks.shape[1]

    def missed(self, eyes: int) -> np.ndarray:
        """Probability that so many of the eyes, drawn at random, miss an object, shape (cells, objects), float64.

        Exact for these eyes: one that k of n eyes see is missed by m of them in C(n - k, m) of C(n, m) draws. More eyes
        never miss more.
        """
        return binom(self.eyes - self.marks.sum(axis=1), eyes) / binom(self.eyes, eyes)

    def unions(self, eyes: int) -> np.ndarray:
        """What disjoint groups of so many eyes see, shape (cells, groups, objects), bool; left-over eyes do nothing."""
        cells, _, objects = self.marks.shape
        groups = self.eyes // eyes
        return self.marks[:, : groups * eyes].reshape(cells, groups, eyes, objects).any(axis=2)


class Eyes:
    """Random eyes in view cells of a model.

    Attributes:
        cells: that hold enough free points, shape (n,), int.
        points: the eyes [grid steps], shape (n, 125, 3), float32: outside every solid.
        frame_eyes: others, whose frames are looked at, shape (n, 16, 3).
        spots: more points, for solid angles, shape (n, 256, 3).
    """

    def __init__(
        self, scene: Scene, solids: list[tuple[int, np.ndarray]], graph: CellGraph, cells: np.ndarray, seed: int = 0
    ):
        """Draw the eyes of each cell; the same for the same arguments, whatever other cells there are.

        Args:
            scene: the model.
            solids: its closed opaque elements, as from `closed_elements`.
            graph: cells.
            cells: to look from, shape (n,), int.
            seed: of the draw.
        """
        opaque, self._owners = scene.triangles(*OPAQUE)
        glass, self._glass_owners = scene.triangles(Role.TRANSPARENT)
        self._owners = np.append(self._owners, -1).astype(np.int64)
        self._opaque, self._glass, self._objects = embree_scene(opaque), embree_scene(glass), len(scene.objects)
        index, ends = SolidIndex(graph.cells[cells], solids), np.cumsum([EYES[-1], FRAME_EYES, SPOTS])
        drawn = {}
        for place, cell in enumerate(cells.tolist()):
            rng, found = np.random.default_rng([seed, cell]), np.zeros((0, 3), np.float32)
            for _ in range(DRAWS):
                more = draw_eyes(graph.cells[cell], index, place, int(ends[-1]), rng, graph.plans.of(cell))
                found = np.concatenate([found, more])
                if len(found) >= ends[-1]:
                    drawn[cell] = found[: ends[-1]]
                    break
        self.cells = np.array(list(drawn), np.int64)
        points = np.array(list(drawn.values()), np.float32).reshape(-1, ends[-1], 3)
        self.points, self.frame_eyes, self.spots = np.split(points, ends[:-1], axis=1)

    def views(self, pixels: int, usual: np.ndarray, eyes: int | None = None) -> Views:
        """What the first eyes of each cell see in cube maps.

        Args:
            pixels: on a side of a face.
            usual: objects that each cell is expected to see, shape (n, objects), bool; what else is seen is odd.
            eyes: how many look; as many as `eyes_for` says by default.

        Raises:
            InputError: no pixel or more than 16,384 on a side, or not 1 to 125 eyes.
        """
        most = eyes_for(pixels)
        eyes = most if eyes is None else eyes
        if not 1 <= eyes <= EYES[-1]:
            raise InputError(f"eyes: expected 1 to {EYES[-1]}, found {eyes}")
        begin, marks, odd = time.perf_counter(), np.zeros((len(self.cells), eyes, self._objects), bool), []
        every = list(np.ndindex(len(self.cells), eyes))
        with phase(f"{pixels} pixels", len(every), "eye") as bar, ThreadPoolExecutor(THREADS) as pool:
            for found in pool.map(lambda one: self._look(one, pixels, usual[one[0]], marks[one]), every):
                odd += found
                bar.update()
        return Views(pixels, marks, _candidates(odd), time.perf_counter() - begin)

    def frames(self) -> np.ndarray:
        """Pixels of each opaque object in frames of the other eyes, shape (n, 6 * 16, objects), int32."""
        every, faces = list(np.ndindex(len(self.cells), FRAME_EYES)), (6, self._objects)

        def draw(one: tuple[int, int]) -> np.ndarray:
            out = np.zeros(6 * self._objects, np.int32)
            for first, along in _batches(FRAME_PIXELS):
                owners = self._first(self.frame_eyes[one], along)[1]
                face = (first + np.arange(len(along))) // FRAME_PIXELS**2
                hit = owners >= 0
                out += np.bincount(face[hit] * self._objects + owners[hit], minlength=len(out)).astype(np.int32)
            return out.reshape(faces)

        out = np.zeros((len(self.cells), FRAME_EYES, *faces), np.int32)
        with phase("frames", len(every), "eye") as bar, ThreadPoolExecutor(THREADS) as pool:
            for one, found in zip(every, pool.map(draw, every), strict=True):
                out[one] = found
                bar.update()
        return out.reshape(len(self.cells), FRAME_EYES * 6, self._objects)

    def _first(self, eye: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parameter and object of each ray's first opaque hit; infinity and -1 if there is none."""
        if self._opaque is None:
            return np.full(len(along), np.inf, np.float32), np.full(len(along), -1)
        found = self._opaque.run(np.repeat(eye[None], len(along), axis=0), along, output=1)
        return np.where(found["primID"] >= 0, found["tfar"], np.float32(np.inf)), self._owners[found["primID"]]

    def _look(self, which: tuple[int, int], pixels: int, usual: np.ndarray, marks: np.ndarray) -> list[tuple]:
        """Mark what one eye sees; row, object, origin, direction and reach of the first ray to each unusual object."""
        (place, number), odd = which, []
        eye = self.points[place, number]
        for _, along in _batches(pixels):
            reach, owners = self._first(eye, along)
            hit = np.flatnonzero(owners >= 0)
            shown = [(hit, owners[hit], reach[hit])]
            if self._glass is not None:
                origins = np.repeat(eye[None], len(along), axis=0)
                for rays, triangles, passed in through_glass(self._glass, origins, along, reach):
                    shown.append((rays, self._glass_owners[triangles], passed))
            for rays, objects, far in shown:
                new = np.flatnonzero(~(usual | marks)[objects])
                for one in new[np.unique(objects[new], return_index=True)[1]]:
                    odd.append((place, objects[one], eye, along[rays[one]], far[one]))
                marks[objects] = True
        return odd


def eyes_for(pixels: int) -> int:
    """How many eyes look at a resolution: the largest union whose cube maps are few enough rays, at least one.

    Raises:
        InputError: no pixel on a side, or more than 16,384.
    """
    if not 1 <= pixels <= PIXELS_MOST:
        raise InputError(f"pixels: expected 1 to {PIXELS_MOST:,} on a side, found {pixels}")
    return max([count for count in EYES if count * 6 * pixels**2 <= RAYS_MOST], default=EYES[0])


def cube_directions(pixels: int, first: int, count: int) -> np.ndarray:
    """Directions through the middles of pixels `first` and following of a cube map, shape (count, 3), float32.

    Unit length; face by face, +x, -x, +y, -y, +z, -z, row by row.
    """
    number = np.arange(first, first + count)
    face, place = np.divmod(number, pixels * pixels)
    axis, row = face // 2, np.arange(count)
    out = np.empty((count, 3))
    for turn, across in ((1, place % pixels), (2, place // pixels)):
        out[row, (axis + turn) % 3] = (2 * across + 1) / pixels - 1
    out[row, axis] = 1 - 2 * (face % 2)
    return (out / np.linalg.norm(out, axis=1, keepdims=True)).astype(np.float32)


def _batches(pixels: int) -> Iterator[tuple[int, np.ndarray]]:
    """All directions of a cube map, some at a time, and the number of the first of them."""
    for first in range(0, 6 * pixels * pixels, BATCH):
        yield first, cube_directions(pixels, first, min(BATCH, 6 * pixels * pixels - first))


def _candidates(found: Sequence[tuple]) -> Candidates:
    """One ray for each pair, the first eye's."""
    rows, objects = (np.array([one[k] for one in found], np.int64) for k in range(2))
    once = np.unique(np.stack([rows, objects]), axis=1, return_index=True)[1]
    origins, along = (np.array([found[k][n] for k in once], np.float64).reshape(-1, 3) for n in (2, 3))
    reach = np.array([found[k][4] for k in once], np.float64)
    return Candidates(rows[once], np.ones(len(once), np.int64), objects[once], origins, along, reach)


@dataclass(frozen=True)
class FrameErrors:
    """What frames of other eyes in the same cells show that unions of eyes lack; means over frames and unions.

    Attributes:
        pixels: share of the pixels whose opaque object is lacking.
        frames: share of the frames in which that is any pixel.
        worst: share of the pixels that one frame in a hundred exceeds.
    """

    pixels: float
    frames: float
    worst: float


def frame_errors(frames: np.ndarray, views: Views, eyes: int) -> FrameErrors:
    """What frames show that disjoint groups of so many eyes lack.

    Args:
        frames: pixels of each object, shape (cells, frames, objects), as from `Eyes.frames`.
        views: of the eyes.
        eyes: in each group.
    """
    shares = [
        own.astype(np.float32) @ (~seen).T.astype(np.float32) / FRAME_PIXELS**2
        for own, seen in zip(frames, views.unions(eyes), strict=True)
    ]
    share = np.stack(shares)
    return FrameErrors(float(share.mean()), float((share > 0).mean()), float(np.quantile(share, 0.99)))
