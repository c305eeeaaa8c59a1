"""Cull box and level threshold of a view cell, balanced: the least error that a budget of triangles allows.

The larger the cull box, the less far geometry stretches, and the coarser the levels of what is within must be. Both
errors are in closed form, and monotonic: the longest skin of any depth mesh, f rho / (half the box) texels
(parallax.py), falls as the box grows; the level threshold, a bound on what surfaces move by on the image
(levels/pixel_error.py), rises, for what is geometry about a box is geometry about a larger one. What no texel shows
stays geometry, too: that of the smallest box is the most, as about a larger one fewer objects hide others.

So for each threshold the largest box that keeps the budget is told by how far objects reach, in one pass; of these
pairs the one with the least weighted sum is taken. The paper finds one by nested bisection.

Source: Aliaga et al. 1999, section 3.3.
"""

from dataclasses import dataclass

import numpy as np

from ...data.camera import Screen
from ...data.depth_meshes import RIM, FarSide
from ...data.errors import InputError
from ...data.lod import object_errors
from ...data.ragged import places_of
from ...data.scene import Scene
from ...kernels.launch import CPU, Device
from ..levels.pixel_error import PixelLimit, pixel_levels
from .far_side import TEXELS, FarSides
from .parallax import EyeRange

# What a pixel of skin weighs beside one of levels: as published, and as measured: of rays from eyes in seven cells of
# two plants a pixel of the bound on skins misleads 0.07 times as many as one of the level threshold (decision 33).
PUBLISHED_WEIGHT, SKIN_WEIGHT = 0.15, 0.07
# Of the budget, for depth meshes while boxes are compared; the published system has a fixed number for them.
MESH_SHARE = 0.25
# Level thresholds that are tried [pixels].
PIXELS_LEAST, PIXELS_MOST = 0.5, 64.0
THRESHOLDS = np.geomspace(PIXELS_LEAST, PIXELS_MOST, 99)
# The smallest cull box, as a multiple of the ball around the cell: what is nearer turns too fast.
BOX_LEAST = 2.0
# Meshes with more than this share of the triangles that they stand for do not pay.
PAYS = 0.5


@dataclass(frozen=True)
class Budget:
    """What a view cell may take.

    Attributes:
        triangles: of near geometry and depth meshes, to all sides.
        screen: what errors are measured on.
        skin_weight: of a pixel of skin, beside one of levels.

    Raises:
        InputError: a number that is not above 0.
    """

    triangles: int = 200_000
    screen: Screen = Screen()  # noqa: RUF009 frozen
    skin_weight: float = SKIN_WEIGHT

    def __post_init__(self) -> None:
        for name in ("triangles", "skin_weight"):
            if not 0 < getattr(self, name) < np.inf:
                raise InputError(f"{name}: expected a number above 0, found {getattr(self, name)}")


@dataclass(frozen=True)
class Balanced:
    """A view cell, parted.

    Attributes:
        side: near geometry, and depth meshes of the rest.
        cull_box: size of the box [grid steps].
        pixels: level threshold; no level of near geometry is off by more, from anywhere in the cell.
        levels: level of each object of `side.near`, int64.
        triangles: of them and of the meshes.
        without: of all that may be seen, at the levels of the least threshold.
        stood_for: of them, those of objects that stand on meshes alone.
    """

    side: FarSide
    cull_box: float
    pixels: float
    levels: np.ndarray
    triangles: int
    without: int
    stood_for: int

    @property
    def pays(self) -> bool:
        """Whether the meshes have far fewer triangles than what they stand for."""
        return self.side.triangles < PAYS * self.stood_for


class Balance:
    """A model, ready for one view cell after another.

    Attributes:
        sides: parts what may be seen about a cull box that is given.
    """

    def __init__(
        self, scene: Scene, budget: Budget, *, texels: int = TEXELS, error: float = 1.0, device: Device = CPU
    ) -> None:
        """Place its triangles; see `FarSides`.

        Raises:
            InputError: a number out of range.
        """
        self.sides = FarSides(scene, texels=texels, error=error, device=device)
        self._budget, self._focal, self._grid_m = budget, texels / 2 - RIM, scene.grid_m
        self._bounds = scene.object_bounds()
        self._errors, self._starts = object_errors(scene)
        shapes = [[len(mesh.faces) for mesh in shape.lods] for shape in scene.definitions]
        self._faces = np.array([n for placed in scene.objects for n in shapes[placed.definition_id]], np.int64)

    def of(self, potential: np.ndarray, cell: np.ndarray) -> Balanced:
        """Part what may be seen from a view cell.

        Args:
            potential: objects that may be seen from the cell, ascending, int.
            cell: low and high corner [grid steps], shape (2, 3).
        """
        cell = np.asarray(cell, np.float64)
        middle, reach = cell.mean(axis=0), float(np.linalg.norm(cell[1] - cell[0]) / 2)
        smallest = 2 * BOX_LEAST * reach
        # As far as the boxes of objects are from the middle along the axes: so large, a box holds part of them.
        away = np.maximum(self._bounds[potential, 0] - middle, middle - self._bounds[potential, 1]).max(axis=1)
        largest = max(smallest, 2.0 * float(away.max(initial=0.0)))
        always = np.isin(potential, self.sides.geometry(potential, cell, smallest))
        ends = np.where(always, 0.0, away)
        order = np.argsort(ends, kind="stable")
        # Just too small for each object in turn.
        boxes = np.nextafter(2 * ends[order], 0)
        best, box = np.inf, smallest
        for pixels in THRESHOLDS:
            counts = np.cumsum(self._counts(potential, self._levels(potential, cell, pixels))[order])
            if not len(counts) or counts[-1] <= self._budget.triangles:
                # All of it fits as geometry; so it does at all thresholds to come.
                if pixels < best:
                    box = largest
                break
            fitting = int(np.searchsorted(counts, (1 - MESH_SHARE) * self._budget.triangles, "right"))
            if boxes[fitting] < smallest:
                continue
            error = pixels + self._budget.skin_weight * self._skin(reach, boxes[fitting])
            if error < best:
                best, box = error, float(boxes[fitting])
        side = self.sides.of(potential, cell, box)
        pixels = self._threshold(side.near, cell, self._budget.triangles - side.triangles)
        levels = self._levels(side.near, cell, pixels)
        far = int(self._counts(side.far, self._levels(side.far, cell, PIXELS_LEAST)).sum())
        near = int(self._counts(side.near, self._levels(side.near, cell, PIXELS_LEAST)).sum())
        drawn = int(self._counts(side.near, levels).sum()) + side.triangles
        return Balanced(side, box, pixels, levels, drawn, near + far, far)

    def _skin(self, reach: float, box: float) -> float:
        """The longest skin that there may be about a cull box [pixels]."""
        eyes = EyeRange(reach, box / 2, self._focal)
        return eyes.on_screen(self._focal * reach / (box / 2), self._budget.screen)

    def _threshold(self, objects: np.ndarray, cell: np.ndarray, triangles: float) -> float:
        """The least level threshold at which objects have at most so many triangles, or the greatest [pixels]."""
        fits = (self._counts(objects, self._levels(objects, cell, p)).sum() <= triangles for p in THRESHOLDS)
        return float(next((p for p, held in zip(THRESHOLDS, fits, strict=False) if held), PIXELS_MOST))

    def _levels(self, objects: np.ndarray, cell: np.ndarray, pixels: float) -> np.ndarray:
        """The coarsest level of each that is off by no more pixels from anywhere in the cell."""
        counts = np.diff(self._starts)[objects]
        starts = np.append(0, np.cumsum(counts))
        errors = self._errors[places_of(self._starts[objects], counts)]
        rows = np.column_stack([np.zeros(len(objects), np.int64), np.arange(len(objects))])
        limit = PixelLimit(pixels, self._budget.screen)
        boxes = self._bounds[objects] * self._grid_m
        return pixel_levels(cell[None] * self._grid_m, boxes, errors, starts, rows, limit).astype(np.int64)

    def _counts(self, objects: np.ndarray, levels: np.ndarray) -> np.ndarray:
        """Triangles of each at its level."""
        return self._faces[self._starts[objects] + levels]
