"""Truth for a walk: sampled frames against rays from the eye, and against pictures of the whole model.

Rays find what the eye sees; exact sightlines decide (verify/rays/looks.py). Pixels that differ from a picture of the
whole model are judged by rays, too: where members of the set abut, a rasteriser leaves cracks through which the whole
model has something to show and the eye sees nothing.
"""

from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np

from ...data.camera import CameraPath
from ...data.depth_meshes import FACES
from ...data.errors import InputError
from ...data.store.bake_folder import read_bake
from ...data.store.depth_items import decode_face
from ...data.store.ranges import Range
from ...kernels.raster import Images, device_triangles
from ...solvers.levels.benefit import NOTHING
from ...verify.rays.far_side import PlacedMeshes
from ...verify.rays.looks import INNER, Eyewitness
from .display import Display, Shown
from .far import NONE
from .memory import MISSING, Stored
from .opened import Opened
from .scene import Drawing, draw, whole_scene

RAYS = 20_000
# Rays through each pixel that differs.
PIXEL_RAYS = 16


@dataclass(frozen=True)
class FrameTruth:
    """A frame, judged.

    Attributes:
        frame: of the path.
        seen: objects that rays met.
        dropped: of them, those that visibility left out, confirmed by exact sightlines: any is an error.
        undrawn: of them, those that were there and chosen, and were not drawn: any is an error.
        missing: of them, those of which no level was there.
        left_out: of them, those that the frame's time did not suffice for.
        unseen: objects that were drawn and that no ray met.
        pixels: of the picture.
        differing: pixels at which all that the eye may see and the whole model, both at their finest, differ.
        wrong: of them, those at which a ray meets what visibility left out: any is an error.
        other: pixels at which what was drawn shows another object than the whole model at its finest.
        doubtful: objects that rays met at edges only and visibility left out.
    """

    frame: int
    seen: int
    dropped: list[int]
    undrawn: list[int]
    missing: int
    left_out: int
    unseen: int
    pixels: int
    differing: int
    wrong: int
    other: int
    doubtful: int


@dataclass
class Truth:
    """Sampled frames by one policy.

    Attributes:
        policy: its name.
        frames: judged.
    """

    policy: str
    frames: list[FrameTruth] = field(default_factory=list)

    def add(self, frame: FrameTruth | None) -> None:
        """A frame; None for one whose eye is in a solid, which sees nothing that can be said."""
        if frame is not None:
            self.frames.append(frame)

    @property
    def wrong(self) -> int:
        """Objects and pixels that should have been there and were not."""
        return sum(len(one.dropped) + len(one.undrawn) + one.wrong for one in self.frames)


class Judge:
    """Compares frames of a path with the whole model. What moves is judged by nobody: it is everywhere in its box."""

    def __init__(self, opened: Opened, path: CameraPath, display: Display) -> None:
        """Read the whole model.

        Raises:
            InputError: its geometry cannot be read.
        """
        self._path, self._screen, self._grid_m = path, display.screen, opened.walk.grid_m
        self._opened, self._far, self._pictures = opened, display.far, {}
        self._scene, self._graph = whole_scene(opened.walk, opened.source), opened.walk.graph
        self._witness = Eyewitness(self._scene, self._graph, _cracks(opened))
        self._drawing = Drawing(opened.walk, display.screen, display.far)
        triangles, owners = self._scene.triangles()
        self._triangles, count = device_triangles(triangles), len(self._scene.objects)
        self._starts = np.searchsorted(owners, np.arange(count + 1))
        self._still = np.array([bool(self._scene.definitions[o.definition_id].lods[0].faces.size) for o in
                                self._scene.objects])  # fmt: skip

    def compare(self, frame: int, shown: Shown, stored: Stored, held: dict[int, bytes]) -> FrameTruth | None:
        """A frame against the truth; None if its eye is in a solid, which sees nothing that can be said."""
        eye, axes = self._path.eyes[frame] / self._grid_m, self._path.axes()[frame]
        if not self._witness.outside_solids(eye[None])[0]:
            return None
        rng = np.random.default_rng(frame)
        half = INNER * np.array([self._screen.width, self._screen.height]) / 2 / self._screen.focal
        along = _directions(rng.uniform(-half, half, (RAYS, 2)), axes)
        near = shown.objects < self._far.first
        objects, levels, there = shown.objects[near], shown.lods[near], stored.drawn[near]
        # What stands on depth meshes is kept, as far as they are there.
        standing = self._far.index.far.of(shown.row) if shown.row != NONE else np.zeros(0, np.int64)
        members = np.union1d(objects, standing)
        seen, dropped, doubtful = self._witness.look(eye, along, members)
        known = np.isin(seen, objects)
        place = np.searchsorted(objects, seen[known])
        lods, drawn = levels[place], there[place]
        undrawn = seen[known][(lods != NOTHING) & (drawn < 0) & (drawn != MISSING)]
        whole, kept = self._picture(frame, np.arange(len(self._still))), self._picture(frame, members)
        rows = np.flatnonzero((whole != kept).ravel())
        wrong = self._wrong_pixels(eye, axes, rows, whole.ravel()[rows], members, rng)
        faces = shown.objects[~near][stored.drawn[~near] >= 0]
        picture = self._with_meshes(frame, self._drawn_images(frame, objects, there, held), faces, shown.row)
        on_screen = objects[(there >= 0) & self._still[objects]]
        lost = np.isin(seen, standing).sum() if len(faces) < (~near).sum() else 0
        return FrameTruth(
            frame, len(seen), dropped.tolist(), undrawn.tolist(), int((drawn == MISSING).sum() + lost),
            int((lods == NOTHING).sum()), len(np.setdiff1d(on_screen, seen)), whole.size, len(rows), wrong,
            int((picture != whole).sum()), len(doubtful),
        )  # fmt: skip

    def visible_pixels(self, frame: int, shown: Shown) -> np.ndarray:
        """Pixels that show each object that the eye may see, all at the levels that were chosen, int64."""
        near = shown.objects < self._far.first
        images = self._drawn_images(frame, shown.objects[near], shown.lods[near], {})
        faces = shown.objects[~near]
        picture = self._with_meshes(frame, images, faces, shown.row, name_faces=True).ravel()
        counts = np.bincount(picture[picture >= 0], minlength=self._far.first + self._far.index.faces.size)
        return counts[shown.objects]

    def _picture(self, frame: int, objects: np.ndarray) -> np.ndarray:
        """The object that each pixel shows, of some at their finest."""
        calls = np.column_stack([self._starts[objects], self._starts[objects + 1], objects])
        return draw(self._triangles, calls, self._path, frame, self._screen, self._grid_m).ids[0]

    def _drawn_images(self, frame: int, objects: np.ndarray, lods: np.ndarray, held: dict[int, bytes]) -> Images:
        """The same of geometry that was drawn: from the bytes that were there, or, where none are, from the model."""
        still = self._still[objects]
        objects, lods = objects[still & (lods >= 0)], lods[still & (lods >= 0)]
        if held:
            return self._drawing.draw(self._path, frame, objects, lods, held)
        parts = []
        for number, lod in zip(objects.tolist(), lods.tolist(), strict=True):
            faces = self._scene.definitions[self._scene.objects[number].definition_id].lods[lod].faces
            parts.append(self._scene.world_vertices(number, lod)[faces])
        ends = np.cumsum([0, *map(len, parts)])
        triangles = device_triangles(np.concatenate([*parts, np.zeros((0, 3, 3), np.int32)]))
        calls = np.column_stack([ends[:-1], ends[1:], objects])
        return draw(triangles, calls, self._path, frame, self._screen, self._grid_m)

    def _with_meshes(
        self, frame: int, images: Images, faces: np.ndarray, row: int, *, name_faces: bool = False
    ) -> np.ndarray:
        """The object that each pixel shows, of geometry and some faces of a row's depth meshes, cast ray by ray.

        Args:
            frame: of the path.
            images: of the geometry.
            faces: ids of those that are there.
            row: of them.
            name_faces: give a face's id in place of the object's.
        """
        if not len(faces):
            return images.ids[0]
        if row not in self._pictures:
            self._pictures = {row: self._placed(row)}
        meshes, ids = self._pictures[row]
        screen, eye = self._screen, self._path.eyes[frame] - self._far.index.middles[row]
        y, x = np.divmod(np.arange(screen.width * screen.height), screen.width)
        spots = np.column_stack([x + 0.5 - screen.width / 2, screen.height / 2 - 0.5 - y]) / screen.focal
        # One along the axis of view, so that the parameter is the depth.
        way = np.column_stack([spots, np.ones(len(spots))]) @ self._path.axes()[frame]
        depth, (face, down, along) = (part.T for part in meshes.meet(np.repeat(eye[None], len(way), axis=0), way))
        number = self._far.first + len(FACES) * row + face
        own = np.isfinite(depth) & np.isin(number, faces)
        own &= np.where(own, depth, 0.0) / self._grid_m * images.inverse_depths[0].ravel() < 1
        shown = images.ids[0].ravel().copy()
        shown[own] = number[own] if name_faces else ids[face[own], down[own], along[own]]
        return shown.reshape(images.ids[0].shape)

    def _placed(self, row: int) -> tuple[PlacedMeshes, np.ndarray]:
        """Depth meshes of a row [m], and the object that each of their texels shows."""
        index, items = self._far.index, []
        for face in range(len(FACES)):
            data = self._opened.source.read(Range(int(index.offsets[row, face]), int(index.sizes[row, face]), (), 0))
            items.append(decode_face(data, f"{self._opened.place}: depth mesh {face} of cell {index.cells[row]}"))
        layers, ranks = (np.stack([getattr(item, name) for item in items]) for name in ("layers", "ranks"))
        meshes = PlacedMeshes(tuple(item.meshes for item in items), layers, float(index.reaches[row]))
        return meshes, np.where(ranks < 0, -1, index.far.of(row)[ranks])

    def _wrong_pixels(
        self, eye: np.ndarray, axes: np.ndarray, rows: np.ndarray, shown: np.ndarray, kept: np.ndarray,
        rng: np.random.Generator,
    ) -> int:  # fmt: skip
        """Pixels of those that differ that show an object that is not kept, and that rays through them do meet."""
        lost = (shown >= 0) & ~np.isin(shown, kept)
        if not lost.any():
            return 0
        screen, rows = self._screen, rows[lost]
        corners = np.column_stack(
            [rows % screen.width - screen.width / 2, screen.height / 2 - 1 - rows // screen.width]
        )
        spots = np.repeat(corners, PIXEL_RAYS, axis=0) + rng.random((PIXEL_RAYS * len(rows), 2))
        sure = self._witness.look(eye, _directions(spots / screen.focal, axes), kept)[1]
        return int(np.isin(shown[lost], sure).sum())


def _cracks(opened: Opened) -> np.ndarray:
    """Openings that the bake closed, where it is still there to ask: what is seen through one counts as hidden."""
    with suppress(InputError):
        return read_bake(opened.walk.bake_place).cracks
    return np.zeros((0, 2, 3), np.int32)


def _directions(spots: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Directions through points of the screen at distance 1, unit length, float32."""
    rays = np.column_stack([spots, np.ones(len(spots))]) @ axes
    return (rays / np.linalg.norm(rays, axis=1)[:, None]).astype(np.float32)
