"""Textured depth meshes of a view cell: six images around it, and triangles that say how far away their texels are.

Source: Aliaga et al. 1999, section 3.1.
"""

from dataclasses import dataclass

import numpy as np

# Right, up and forward for each face: +x, -x, +y, -y, +z, -z.
FACES = np.array([[np.eye(3)[k - 2], np.eye(3)[k - 1], sign * np.eye(3)[k]] for k in range(3) for sign in (1, -1)])
# Texels of each image that lie beyond its face on every side: the faces overlap, and leave no seam.
RIM = 1
# Heights of vertices are multiples of this [texels].
PARALLAX_STEP = 2.0**-6
# The layer of a texel that shows nothing.
NOTHING = 255


@dataclass(frozen=True)
class DepthMesh:
    """Triangles over an image.

    Attributes:
        pixels: column and row of each vertex, top row first, shape (n, 2), uint16.
        parallax: of each vertex [texels], multiples of PARALLAX_STEP, shape (n,), float32.
        triangles: vertices of each, shape (m, 3), uint32; each holds a pixel that shows something, if only at a corner.
        error: no texel that shows something is drawn farther than this from its own parallax [texels], proved.
    """

    pixels: np.ndarray
    parallax: np.ndarray
    triangles: np.ndarray
    error: float

    def arrays(self) -> list[np.ndarray]:
        """What is to be stored."""
        return [self.pixels, self.parallax, self.triangles]


@dataclass(frozen=True)
class FarSide:
    """What may be seen from a view cell, parted by a cull box.

    A texel in column c and row r of n shows what the middle sees along (c + 0.5 - n / 2, n / 2 - 0.5 - r, f) to the
    right, up and forward of its face, with a focal length of f = n / 2 - RIM texels. Its parallax is f reach / depth,
    the depth being along the face's forward direction.

    Attributes:
        near: objects to be drawn as geometry, ascending, int64.
        unseen: those of them that lie beyond the box, and no texel shows.
        far: objects that stand on the meshes alone.
        middle: of the cell [grid steps], shape (3,), float64.
        reach: from there to the cell's corners [grid steps].
        ids: object that each texel shows, -1 for none, top row first, shape (6, texels, texels), int32.
        parallax: of each texel [texels], float64; 0 where nothing is shown.
        layers: of each texel, NOTHING where nothing is shown, uint8. A mesh shows the texels of its layer alone.
        meshes: of each face, in the order of FACES, one for each layer from 0.
        error: texels that no texel is drawn off by more than, for any eye of the cell; proved.
        skin: the longest stretch between neighbouring texels of a layer, for any eye of the cell [texels].
    """

    near: np.ndarray
    unseen: np.ndarray
    far: np.ndarray
    middle: np.ndarray
    reach: float
    ids: np.ndarray
    parallax: np.ndarray
    layers: np.ndarray
    meshes: tuple[tuple[DepthMesh, ...], ...]
    error: float
    skin: float

    @property
    def triangles(self) -> int:
        """Of all meshes."""
        return sum(len(mesh.triangles) for face in self.meshes for mesh in face)

    @property
    def texel_error(self) -> float:
        """Texels of parallax that no texel is off by more than; proved."""
        return max([0.0, *(mesh.error for face in self.meshes for mesh in face)])
