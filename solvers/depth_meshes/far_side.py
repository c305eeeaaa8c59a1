"""What may be seen from a view cell, parted by a cull box: geometry within it, and images with depth of the rest.

An object is geometry, drawn as ever, if its box is not wholly beyond the cull box, if it is transparent (glass shows
what is behind it; so does all that moves), or if no texel shows it: then it may still be seen from elsewhere in the
cell, and is never left out. All others stand on six depth meshes, one on each face of the box, as the middle of the
cell sees them past the geometry: what near objects hide there is on the images, for another eye may see it.

What the images lack is what far objects hide of each other from the middle alone; `verify` counts it by rays.

Source: Aliaga et al. 1999, section 3.1. There geometry is cut at the cull box; here an object is on one side of it.
"""

import numpy as np

from ...data.depth_meshes import FACES, NOTHING, RIM, DepthMesh, FarSide
from ...data.errors import InputError
from ...data.scene import Role, Scene
from ...kernels.launch import CPU, Device, side_by_side
from ...kernels.raster import Images, device_triangles, launch_raster
from .layers import layers_of
from .mesh import depth_mesh
from .parallax import EyeRange

# Texels along a face, and texels that a mesh may be off by: as published, and what a pixel of a screen does not show.
TEXELS, ERROR = 512, 1.0
TEXELS_LEAST, TEXELS_MOST = 8, 2**14
# Neighbouring texels that are drawn farther apart than this for an eye at a corner hang together no more.
SKIN = 2.0


class FarSides:
    """A model, ready to be parted for one view cell after another."""

    def __init__(self, scene: Scene, *, texels: int = TEXELS, error: float = ERROR, device: Device = CPU) -> None:
        """Place its triangles.

        Args:
            scene: the model.
            texels: along each image, from 8.
            error: texels that a mesh may be off by for an eye at a cell's corners, > 0.
            device: draws the images.

        Raises:
            InputError: a number out of range.
        """
        if not TEXELS_LEAST <= texels <= TEXELS_MOST:
            raise InputError(f"texels: expected {TEXELS_LEAST} to {TEXELS_MOST:,} along a face, found {texels}")
        if not 0 < error < np.inf:
            raise InputError(f"error: expected texels above 0, found {error}")
        self._texels, self._error, self._device = texels, error, device
        self._boxes, self._starts = scene.object_bounds(), scene.triangle_starts
        self._glass = scene.object_mask(Role.TRANSPARENT)
        self._triangles = device_triangles(scene.triangles()[0], device)

    def of(self, potential: np.ndarray, cell: np.ndarray, cull_box: float) -> FarSide:
        """Part what may be seen from a view cell, and make depth meshes of what is far.

        Args:
            potential: objects that may be seen from the cell, ascending, int.
            cell: low and high corner [grid steps], shape (2, 3).
            cull_box: size of the box, a cube around the cell's middle [grid steps].

        Returns:
            Every object of `potential` is in `near` or in `far`.

        Raises:
            InputError: a cull box that does not hold the ball around the cell.
        """
        middle, reach = _ball(np.asarray(cell, np.float64), cull_box)
        eyes = EyeRange(reach, cull_box / 2, self._texels / 2 - RIM)
        beyond = self._beyond(potential, middle, cull_box / 2)
        images = self._draw(beyond, middle, cull_box / 2)
        parallax, shown = eyes.parallax(images.inverse_depths), images.ids >= 0
        allowed, step = self._error / eyes.worst(1.0), SKIN / eyes.worst(1.0)

        def make(face: int) -> tuple[np.ndarray, tuple[DepthMesh, ...]]:
            layers = layers_of(parallax[face], shown[face], step)
            used = np.unique(layers[shown[face]])
            return layers, tuple(depth_mesh(parallax[face], layers == layer, allowed) for layer in used)

        made = dict(side_by_side(make, range(len(FACES)), self._device))
        layers, meshes = zip(*(made[face] for face in range(len(FACES))), strict=True)
        far = np.unique(images.ids[shown]).astype(np.int64)
        return FarSide(
            near=np.setdiff1d(potential, far),
            unseen=np.setdiff1d(beyond, far),
            far=far,
            middle=middle,
            reach=reach,
            ids=images.ids,
            parallax=parallax,
            layers=np.stack(layers),
            meshes=meshes,
            error=eyes.worst(max([0.0, *(mesh.error for face in meshes for mesh in face)])),
            skin=eyes.worst(_longest_skin(parallax, np.stack(layers))),
        )

    def geometry(self, potential: np.ndarray, cell: np.ndarray, cull_box: float) -> np.ndarray:
        """Objects that `of` has in `near`, without making meshes; no others are so, and beyond, about a larger box.

        Args and raises as there.
        """
        middle, _ = _ball(np.asarray(cell, np.float64), cull_box)
        images = self._draw(self._beyond(potential, middle, cull_box / 2), middle, cull_box / 2)
        return np.setdiff1d(potential, images.ids)

    def _beyond(self, potential: np.ndarray, middle: np.ndarray, half: float) -> np.ndarray:
        """Opaque objects that are wholly beyond the box."""
        boxes = self._boxes[potential]
        within = ((boxes[:, 0] <= middle + half) & (boxes[:, 1] >= middle - half)).all(axis=1)
        return potential[~within & ~self._glass[potential]]

    def _draw(self, objects: np.ndarray, middle: np.ndarray, half: float) -> Images:
        """Six images of objects beyond the box; a face shows none that does not reach beyond its plane."""
        boxes, calls, starts = self._boxes[objects], [], [0]
        for forward in FACES[:, 2]:
            ahead = np.maximum(*((boxes - middle) @ forward).T) > half
            own = objects[ahead]
            calls.append(np.column_stack([self._starts[own], self._starts[own + 1], own]))
            starts.append(starts[-1] + len(own))
        return launch_raster(
            self._triangles,
            np.concatenate(calls),
            np.array(starts),
            np.repeat(middle[None], len(FACES), axis=0),
            FACES,
            width=self._texels,
            height=self._texels,
            focal=self._texels / 2 - RIM,
            # Nothing that is drawn is so near.
            near=half / 2,
            depths=True,
            device=self._device,
        )


def _ball(cell: np.ndarray, cull_box: float) -> tuple[np.ndarray, float]:
    """Middle and radius of the ball around a cell, which a cull box must hold."""
    middle, reach = cell.mean(axis=0), float(np.linalg.norm(cell[1] - cell[0]) / 2)
    if not 0 < reach < cull_box / 2:
        raise InputError(
            f"cull box: expected a size above {2 * reach:,.0f} steps, which the ball around the cell has, "
            f"found {cull_box:,.0f}"
        )
    return middle, reach


def _longest_skin(parallax: np.ndarray, layers: np.ndarray) -> float:
    """The greatest step between neighbouring texels of a layer."""
    longest = 0.0
    for axis in (1, 2):
        here, there = (np.take(layers, range(k, layers.shape[axis] - 1 + k), axis) for k in (0, 1))
        joined = (here == there) & (here != NOTHING)
        longest = max(longest, float(np.abs(np.diff(parallax, axis=axis))[joined].max(initial=0.0)))
    return longest
