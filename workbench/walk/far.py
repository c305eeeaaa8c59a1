"""Depth meshes on a walk: in a view cell that has some, they are drawn in place of what stands on them.

To levels, memory and policies a face is an object of its own with one level, which its view cell alone may see; far
objects are no members of that cell's set. So one cache, look-ahead and reader serve both.

Source: Aliaga et al. 1999, sections 3.1 and 5.2.
"""

import numpy as np

from ...data.camera import Screen
from ...data.depth_meshes import FACES
from ...data.ragged import owners_of, places_of, starts_of
from ...data.store.walk_depth import DepthIndex
from ...data.store.walk_folder import WalkFolder
from ...solvers.walk.set_items import Balls, Shelves

# Corners of a face, as right and up where forward is 1.
CORNERS = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])
NONE = -1


class FarFaces:
    """Faces of depth meshes as objects whose ids follow those of the display."""

    def __init__(self, walk: WalkFolder, wanted: bool) -> None:
        """Prepare those of a database; none at all if they are not wanted."""
        self.index: DepthIndex = walk.depth_meshes if wanted else walk.without_depth_meshes()
        self.first, self._row_of = walk.objects.num_rows, np.full(walk.graph.cell_count, NONE)
        self._row_of[self.index.cells] = np.arange(len(self.index))

    def row(self, eye: np.ndarray, holders: np.ndarray) -> int:
        """Of the cells that hold an eye [m] the one with depth meshes whose middle is nearest, or NONE."""
        rows = self._row_of[holders]
        rows = rows[rows >= 0]
        if not len(rows):
            return NONE
        return int(rows[np.argmin(np.linalg.norm(self.index.middles[rows] - eye, axis=1))])

    def near(self, row: int, objects: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Those of some objects that are drawn as geometry, and the finest level that the view cell asks of each."""
        if row == NONE:
            return objects, np.zeros(len(objects), np.int64)
        near, levels = self.index.near_levels(row)
        place = np.searchsorted(near, objects)
        held = place < len(near)
        held[held] = near[place[held]] == objects[held]
        return objects[held], levels[place[held]]

    def in_view(self, row: int, eye: np.ndarray, axes: np.ndarray, screen: Screen) -> np.ndarray:
        """Ids of the faces that may be in view: a face is not where all that it may show is beyond a side of the view.

        Args:
            row: a view cell's.
            eye: in the cell [m], shape (3,).
            axes: right, up and forward, shape (3, 3).
            screen: the view.
        """
        wide, high = screen.width / 2 / screen.focal, screen.height / 2 / screen.focal
        sides = np.array([[1, 0, wide], [-1, 0, wide], [0, 1, high], [0, -1, high]]) @ axes
        # A face shows points of the cone over its corners, from the cull box on.
        ways = CORNERS @ FACES
        begins = ways * self.index.cull_boxes[row] / 2 + self.index.middles[row] - eye
        beyond = (ways @ sides.T < 0).all(axis=1) & (begins @ sides.T < 0).all(axis=1)
        return self.first + len(FACES) * row + np.flatnonzero(~beyond.any(axis=1))

    def triangles(self, faces: np.ndarray) -> np.ndarray:
        """Of some faces, by their ids."""
        return self.index.faces.ravel()[faces - self.first]

    def shelves(self, starts: np.ndarray, items: np.ndarray, sizes: np.ndarray, faces: np.ndarray) -> Shelves:
        """Levels of objects as items (`Shelves.of`), and each face as an item of its own."""
        count = self.index.faces.size
        return Shelves.of(
            np.concatenate([starts, starts[-1] + 1 + np.arange(count)]),
            np.concatenate([items, len(sizes) + np.arange(count)]),
            np.concatenate([sizes, self.index.sizes.ravel()]),
            np.concatenate([faces, self.index.faces.ravel()]),
        )

    def balls(self, boxes: np.ndarray) -> Balls:
        """Balls around boxes [m], and, around faces, some that hold every eye: they may be in view at once."""
        around = np.repeat(self.index.middles, len(FACES), axis=0)
        # Far above any model's size.
        return Balls.around(np.concatenate([boxes, np.stack([around - 1e9, around + 1e9], axis=1)]))

    def sets(
        self, cells: np.ndarray, starts: np.ndarray, members: np.ndarray, limits: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sets of cells and limits of levels, with faces in place of what stands on them.

        Args:
            cells: of each list, shape (n,), int64.
            starts: members of list r are members[starts[r]:starts[r + 1]], ascending.
            members: display ids.
            limits: the coarsest level that does for each.

        Returns:
            The same, each list ascending: starts, members, limits.
        """
        rows = self._row_of[cells]
        owners, sizes = owners_of(starts), np.diff(starts)
        plain = rows[owners] == NONE
        having = np.flatnonzero(rows != NONE)
        near_starts, near = self.index.near_lists
        counts = np.diff(near_starts)[rows[having]]
        places = places_of(near_starts[rows[having]], counts)
        faces = self.first + len(FACES) * rows[having][:, None] + np.arange(len(FACES))
        parts = [
            (owners[plain], members[plain], limits[plain]),
            (np.repeat(having, counts), near[places], self.index.levels[places]),
            (np.repeat(having, len(FACES)), faces.ravel(), np.zeros(faces.size, np.int64)),
        ]
        owner, member, limit = (np.concatenate(part) for part in zip(*parts, strict=True))
        order = np.lexsort((member, owner))
        return starts_of(np.bincount(owner, minlength=len(sizes))), member[order], limit[order]
