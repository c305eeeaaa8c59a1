"""The model of a display database, for drawing and for judging."""

import numpy as np
import warp as wp

from ...data.animation import Animation
from ...data.camera import NEAR_M, CameraPath, Screen
from ...data.depth_meshes import FACES
from ...data.errors import InputError
from ...data.scene import Definition, Instance, Mesh, Role, Scene
from ...data.store.depth_items import decode_face
from ...data.store.ranges import Range, ReadFailed, Source
from ...data.store.walk_folder import WalkFolder, item_mesh
from ...kernels.raster import Images, device_triangles, launch_raster
from ...solvers.levels.benefit import NOTHING
from ...verify.rays.far_side import placed_triangles
from .far import FarFaces

# Bytes that are read at a time when everything is.
LOT = 2**22


def whole_scene(walk: WalkFolder, source: Source) -> Scene:
    """All objects by display id with all their levels; what moves is left without a shape, as it is judged by nobody.

    Raises:
        InputError: the geometry cannot be read, or is not as the index says.
    """
    meshes = _meshes(walk, source)
    names = ("definition_id", "name", "kind", "role", "transform", "animation")
    starts, items = walk.object_items
    shapes: dict[tuple[int, ...], int] = {}
    definitions, objects = [], []
    for number, (_, name, kind, role, transform, moving) in enumerate(
        zip(*(walk.objects[column].to_pylist() for column in names), strict=True)
    ):
        own = () if moving is not None else tuple(items[starts[number] : starts[number + 1]].tolist())
        if own not in shapes:
            shapes[own] = len(definitions)
            empty = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32), 0.0)
            definitions.append(Definition(str(len(definitions)), tuple(meshes[item] for item in own) or (empty,)))
        objects.append(Instance(name, kind, shapes[own], np.array(transform).reshape(4, 4), Role(role)))
    return Scene(definitions, objects, origin=walk.origin, yaw_deg=walk.yaw_deg, grid_m=walk.grid_m)


def _meshes(walk: WalkFolder, source: Source) -> list[Mesh]:
    """Every item of the file."""
    columns = ("offset", "size", "vertices", "error_m")
    offsets, sizes, vertices, errors = (walk.items[name].to_numpy() for name in columns)
    ends, found = offsets + sizes, []
    for first in _lots(offsets, ends):
        rows = range(*first)
        begin, end = int(offsets[rows[0]]), int(ends[rows[-1]])
        try:
            data = source.read(Range(begin, end - begin, tuple(rows), 0))
        except ReadFailed as error:
            raise InputError(f"{walk.folder}: expected its geometry, found none: {error}") from None
        for item in rows:
            own = data[offsets[item] - begin : ends[item] - begin]
            points, faces = item_mesh(own, int(vertices[item]), f"{walk.folder}: item {item}")
            found.append(Mesh(points, faces, float(errors[item])))
    return found


def _lots(offsets: np.ndarray, ends: np.ndarray) -> list[tuple[int, int]]:
    """First and past-the-last of consecutive items that take about LOT bytes."""
    if not len(offsets):
        return []
    breaks = np.flatnonzero(np.diff(ends // LOT)) + 1
    return list(zip(np.append(0, breaks).tolist(), np.append(breaks, len(offsets)).tolist(), strict=True))


class Drawing:
    """Draws frames from the bytes of items that are there."""

    def __init__(self, walk: WalkFolder, screen: Screen, far: FarFaces) -> None:
        """Nothing is placed yet."""
        self._walk, self._screen, self._far = walk, screen, far
        self._starts, self._items = walk.object_items
        self._vertices = walk.items["vertices"].to_numpy()
        self._transforms = walk.objects["transform"]
        texts, periods = walk.objects["animation"].to_pylist(), walk.objects["period_s"].to_pylist()
        self._moving = {
            number: Animation(text, np.inf if period is None else period)
            for number, (text, period) in enumerate(zip(texts, periods, strict=True))
            if text is not None
        }
        self._placed: dict[tuple[int, int], np.ndarray] = {}

    def triangles(self, number: int, lod: int, held: dict[int, bytes], t: float) -> np.ndarray:
        """Triangles of an object at a level [grid steps], (n, 3, 3), int32; what moves is where it is at t [s]."""
        if (number, lod) in self._placed:
            return self._placed[number, lod]
        if number >= self._far.first:
            self._placed[number, lod] = self._depth_meshes(number - self._far.first, held)
            return self._placed[number, lod]
        walk, item = self._walk, int(self._items[self._starts[number] + lod])
        points, faces = item_mesh(held[item], int(self._vertices[item]), f"{walk.folder}: item {item}")
        transform = np.array(self._transforms[number].as_py()).reshape(4, 4)
        if number in self._moving:
            transform = transform @ self._moving[number].matrix(t)
        world = np.round((points @ transform[:3, :3].T + transform[:3, 3]) / walk.grid_m).astype(np.int32)
        if np.linalg.det(transform[:3, :3]) < 0:
            faces = faces[:, ::-1]
        if number not in self._moving:
            self._placed[number, lod] = world[faces]
        return world[faces]

    def _depth_meshes(self, number: int, held: dict[int, bytes]) -> np.ndarray:
        """Triangles of all layers of a face, whole."""
        index, (row, face) = self._far.index, divmod(number, len(FACES))
        item = decode_face(held[self._walk.items.num_rows + number], f"{self._walk.folder}: depth mesh {number}")
        reach, texels = index.reaches[row], int(index.texels[row])
        parts = [np.zeros((0, 3, 3)), *(placed_triangles(mesh, face, texels, reach) for mesh in item.meshes)]
        return np.round((np.concatenate(parts) + index.middles[row]) / self._walk.grid_m).astype(np.int32)

    def draw(self, path: CameraPath, at: int, objects: np.ndarray, lods: np.ndarray, held: dict[int, bytes]) -> Images:
        """The object that each pixel of a frame shows; depth meshes whole, as a renderer looks at all of their pixels.

        Args:
            path: the eyes.
            at: which.
            objects: display ids, and faces of depth meshes, shape (n,).
            lods: level of each, below 0 for what is not drawn.
            held: bytes of the items of all that is drawn.
        """
        drawn = [(o, k) for o, k in zip(objects.tolist(), lods.tolist(), strict=True) if k > NOTHING]
        parts = [self.triangles(number, lod, held, float(path.t[at])) for number, lod in drawn]
        # What was drawn once is kept while it is drawn: who leaves the view, leaves.
        self._placed = {key: self._placed[key] for key in drawn if key in self._placed}
        ends = np.cumsum([0, *map(len, parts)])
        calls = np.column_stack([ends[:-1], ends[1:], [o for o, _ in drawn]]).astype(np.int32)
        triangles = device_triangles(np.concatenate([*parts, np.zeros((0, 3, 3), np.int32)]))
        return draw(triangles, calls, path, at, self._screen, self._walk.grid_m)


def draw(triangles: wp.array, calls: np.ndarray, path: CameraPath, at: int, screen: Screen, grid_m: float) -> Images:
    """The object that each pixel of one frame of a path shows; draws as of `launch_raster`, eyes in metres."""
    return launch_raster(
        triangles, calls, np.array([0, len(calls)]), path.eyes[at : at + 1] / grid_m, path.axes()[at : at + 1],
        width=screen.width, height=screen.height, focal=screen.focal, near=NEAR_M / grid_m, depths=True,
    )  # fmt: skip
