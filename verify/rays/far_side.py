"""Depth meshes judged by rays: is every texel where it is said to be, and what do eyes see that no texel shows?

Meshes are placed in the model from what they store alone: a vertex in column c and row r of an image of n texels a
side, with a parallax p, lies on the ray from the cell's middle through that texel's centre, at a depth of
f * reach / p; the focal length f is n / 2 - 1 texels. Where a mesh is met at a texel of another layer, or of none, it
is not there.
"""

from dataclasses import dataclass, fields

import numpy as np
from embreex.rtcore_scene import EmbreeScene

from ...data.depth_meshes import FACES, DepthMesh, FarSide
from ...data.scene import Role, Scene
from .embree import embree_scene

# Embree is float32: what that may come to of a texel, even at a slant; and what a slant adds between texels.
SINGLE, SLANT = 1.0e-2, 1.5
# A ray through a corner of a mesh may pass beside it: others, so many texels away, are tried.
BESIDE = np.array([[0, 0], [1, 1], [-1, 1], [1, -1], [-1, -1]]) * 1.0e-4
# Meshes that a ray may pass at texels they do not show.
PASSES = 64


@dataclass(frozen=True)
class FarCheck:
    """What rays said of a view cell's depth meshes.

    Attributes:
        texels: that were looked at, each from an eye of its own.
        over: of them, those drawn farther from where they are than the bound.
        tenths: how many were off by less than a tenth of the bound, by one to two, and so on; the last ones are `over`;
            shape (11,), int64.
        worst: the most that any was off, as part of the bound.
        rays: cast from eyes in the cell.
        nothing: of them, those that leave the model.
        near: that meet geometry first.
        near_lost: of those, the ones that a mesh is before.
        on_images: that meet a far object at a place that a texel shows.
        misplaced: of those, the ones that meet the meshes elsewhere: before it, where a texel is torn, or nowhere.
        uncovered: that meet a far object at a place that no texel shows, for other far objects hide it from the middle.
    """

    texels: int
    over: int
    tenths: np.ndarray
    worst: float
    rays: int
    nothing: int
    near: int
    near_lost: int
    on_images: int
    misplaced: int
    uncovered: int

    def __add__(self, other: "FarCheck") -> "FarCheck":
        """Both together."""
        total = {one.name: getattr(self, one.name) + getattr(other, one.name) for one in fields(self)}
        return FarCheck(**(total | {"worst": max(self.worst, other.worst)}))


def placed_triangles(mesh: DepthMesh, face: int, texels: int, reach: float) -> np.ndarray:
    """A mesh's triangles about the middle of its cell, in the unit of `reach`, shape (m, 3, 3)."""
    half, (column, row) = texels / 2, mesh.pixels.astype(np.float64).T
    aside = np.stack([column + 0.5 - half, half - 0.5 - row, np.full(len(row), half - 1)])
    return ((aside * (reach / mesh.parallax.astype(np.float64))).T @ FACES[face])[mesh.triangles.astype(np.int64)]


class PlacedMeshes:
    """Meshes about the middle of a cell, ready for rays."""

    def __init__(self, meshes: tuple[tuple[DepthMesh, ...], ...], layers: np.ndarray, reach: float) -> None:
        """Place them.

        Args:
            meshes: of each face, one for each layer.
            layers: of each texel, shape (6, texels, texels).
            reach: from the middle to the cell's corners, in the unit that rays are in.
        """
        self._layers, self.half = layers, layers.shape[1] / 2
        # About the middle, so that float32 is as fine as can be. Layers lie in the same planes: each is met on its own.
        self._scenes = []
        for layer in range(max(map(len, meshes), default=0)):
            having = [face for face, own in enumerate(meshes) if len(own) > layer]
            parts = [placed_triangles(meshes[face][layer], face, layers.shape[1], reach) for face in having]
            faces = np.repeat(having, [len(part) for part in parts])
            self._scenes.append((embree_scene(np.concatenate(parts)), faces))

    def meet(self, origins: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where rays about the middle first meet a mesh at a texel that it shows.

        Args:
            origins: shape (n, 3).
            way: directions, shape (n, 3).

        Returns:
            The parameter, infinite for none, shape (n,), and face, row and column of the texel, shape (n, 3), int64.
        """
        out, texels = np.full(len(way), np.inf), np.zeros((len(way), 3), np.int64)
        for layer in range(len(self._scenes)):
            met, where = self.meet_layer(layer, origins, way)
            nearer = met < out
            out[nearer], texels[nearer] = met[nearer], where[nearer]
        return out, texels

    def meet_layer(self, layer: int, origins: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same for the meshes of one layer."""
        along, out, rays = np.zeros(len(way)), np.full(len(way), np.inf), np.arange(len(way))
        texels = np.zeros((len(way), 3), np.int64)
        if layer >= len(self._scenes):
            return out, texels
        meshes, faces = self._scenes[layer]
        for _ in range(PASSES):
            hit, more = _cast(meshes, origins[rays] + along[rays, None] * way[rays], way[rays])
            met = hit >= 0
            rays, hit, more = rays[met], hit[met], more[met]
            if not len(rays):
                break
            along[rays] += more
            face = faces[hit]
            column, row = self.places(origins[rays] + along[rays, None] * way[rays], face)
            good = self._layers[face, row, column] == layer
            out[rays[good]] = along[rays[good]]
            texels[rays[good]] = np.column_stack([face, row, column])[good]
            rays = rays[~good]
            along[rays] *= 1 + 1e-6
        return out, texels

    def places(self, points: np.ndarray, face: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Column and row of points, seen from the middle on some faces."""
        right, up, depth = np.einsum("nij,nj->in", FACES[face], points)
        most = 2 * self.half - 1
        column = np.floor(self.half + right / depth * (self.half - 1))
        row = np.floor(self.half - up / depth * (self.half - 1))
        return np.clip(column, 0, most).astype(int), np.clip(row, 0, most).astype(int)


def check_far_side(
    scene: Scene, side: FarSide, cell: np.ndarray, rng: np.random.Generator, *, texels: int, rays: int
) -> FarCheck:
    """Cast rays from the middle through texels, and from eyes anywhere in a cell to all sides.

    Args:
        scene: the model; what is transparent in it stops no ray.
        side: of the cell.
        cell: low and high corner [grid steps], shape (2, 3).
        rng: draws texels, eyes and directions.
        texels: to look at.
        rays: to cast.
    """
    judge = _Judge(scene, side)
    looked = judge.texels(_eyes(cell, texels, rng), rng)
    way = rng.normal(size=(rays, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    return FarCheck(*looked, rays, *judge.eyes(_eyes(cell, rays, rng), way))


def _eyes(cell: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Half of them anywhere in a cell, half at its corners, where most is off."""
    anywhere = rng.uniform(cell[0], cell[1], (count, 3))
    return np.where(rng.random((count, 1)) < 0.5, anywhere, cell[rng.integers(0, 2, (count, 3)), np.arange(3)])


class _Judge:
    """Embree's scenes of one far side: the model, what was drawn of it, and the meshes."""

    def __init__(self, scene: Scene, side: FarSide) -> None:
        triangles, owners = scene.triangles()
        opaque = ~scene.object_mask(Role.TRANSPARENT)[owners]
        drawn = np.isin(owners, np.concatenate([side.far, side.unseen]))
        self._side, self._owners = side, owners[opaque]
        self._model, self._drawn = embree_scene(triangles[opaque]), embree_scene(triangles[drawn])
        self._meshes = PlacedMeshes(side.meshes, side.layers, side.reach)
        self._half = self._meshes.half
        self._unit = (self._half - 1) * side.reach
        self._allowed = side.texel_error + SLANT

    def texels(self, eyes: np.ndarray, rng: np.random.Generator) -> tuple[int, int, np.ndarray, float]:
        """Of texels; see `FarCheck`."""
        side, half = self._side, self._half
        # Texels beyond the face's edges are there so that faces overlap.
        inner = np.zeros(side.ids.shape, bool)
        inner[:, 1:-1, 1:-1] = True
        shown = np.flatnonzero((side.ids >= 0) & inner)
        if not len(shown) or not len(eyes):
            return 0, 0, np.zeros(11, np.int64), 0.0
        face, row, column = np.unravel_index(rng.choice(shown, len(eyes)), side.ids.shape)
        aside = np.stack([column + 0.5 - half, half - 0.5 - row, np.full(len(row), half - 1)], axis=1) / (half - 1)
        way = np.einsum("ni,nij->nj", aside, FACES[face])
        there, depth = _cast(self._drawn, np.repeat(side.middle[None], len(way), axis=0), way)
        own, placed = side.layers[face, row, column], np.full(len(way), np.inf)
        for layer in np.unique(own).tolist():
            for shift in BESIDE / (half - 1):
                left = np.flatnonzero((own == layer) & ~np.isfinite(placed))
                near = way[left] + shift @ FACES[face[left], :2]
                placed[left] = self._meshes.meet_layer(layer, np.zeros((len(left), 3)), near)[0]
        both = (there >= 0) & np.isfinite(placed)
        eye = eyes - side.middle
        true, seen = (way * np.where(both, along, 1.0)[:, None] - eye for along in (depth, placed))
        off = np.arctan2(np.linalg.norm(np.cross(true, seen), axis=1), (true * seen).sum(axis=1)) * (half - 1)
        off = np.where(both, np.maximum(off - SINGLE, 0) / side.error, np.inf)
        tenths = np.bincount(np.ceil(10 * np.minimum(off, 1.05) - 1).clip(0).astype(int), minlength=11)
        return len(off), int((off > 1).sum()), tenths, float(off.max())

    def eyes(self, eyes: np.ndarray, way: np.ndarray) -> tuple[int, ...]:
        """Rays by what they meet first; see `FarCheck`."""
        side = self._side
        hit, far = _cast(self._model, eyes, way)
        placed, _ = self._meshes.meet(eyes - side.middle, way)
        met = hit >= 0
        owner = self._owners[np.maximum(hit, 0)]
        distant = met & np.isin(owner, side.far)
        nearer = np.where(met, self._unit * (_inverse(placed) - _inverse(far)), 0.0)
        nearer = self._at_best(eyes, way, far, nearer)
        point = eyes + way * np.where(met, far, 0.0)[:, None] - side.middle
        there = np.zeros(len(eyes), bool)
        there[distant] = self._on_image(point[distant], owner[distant])
        near = met & ~distant
        lost, misplaced = near & (nearer > self._allowed), there & (np.abs(nearer) > self._allowed)
        return tuple(int(some.sum()) for some in (~met, near, lost, there, misplaced, distant & ~there))

    def _at_best(self, eyes: np.ndarray, way: np.ndarray, far: np.ndarray, nearer: np.ndarray) -> np.ndarray:
        """By how much meshes are before what rays meet [texels]; the least within a texel, as images are no sharper."""
        off = np.flatnonzero(np.abs(nearer) > self._allowed)
        nearer = nearer.copy()
        aside = np.cross(way[off], np.eye(3)[np.argmin(np.abs(way[off]), axis=1)])
        aside /= np.linalg.norm(aside, axis=1)[:, None] * (self._half - 1)
        across = np.cross(way[off], aside)
        for turn in np.arange(8) * np.pi / 4:
            beside = way[off] + np.cos(turn) * aside + np.sin(turn) * across
            placed, _ = self._meshes.meet(eyes[off] - self._side.middle, beside)
            again = self._unit * (_inverse(placed) - _inverse(far[off]))
            nearer[off] = np.where(np.abs(again) < np.abs(nearer[off]), again, nearer[off])
        return nearer

    def _on_image(self, points: np.ndarray, owner: np.ndarray) -> np.ndarray:
        """Whether texels at or beside points, seen from the middle, show the same object as deep."""
        side = self._side
        face = np.argmax(points @ FACES[:, 2].T, axis=1)
        column, row = self._meshes.places(points, face)
        parallax = self._unit / (points * FACES[face, 2]).sum(axis=1)
        low, high = np.full(len(points), np.inf), np.full(len(points), -np.inf)
        for down in (-1, 0, 1):
            for beside in (-1, 0, 1):
                at = face, *(np.clip(n, 0, side.ids.shape[1] - 1) for n in (row + down, column + beside))
                same = side.ids[at] == owner
                low = np.where(same, np.minimum(low, side.parallax[at]), low)
                high = np.where(same, np.maximum(high, side.parallax[at]), high)
        return (low - SLANT <= parallax) & (parallax <= high + SLANT)


def _inverse(depth: np.ndarray) -> np.ndarray:
    """Of depths; an eye on a surface is at none."""
    return 1 / np.maximum(depth, 1e-9)


def _cast(scene: EmbreeScene | None, origins: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangle that each ray meets first, -1 for none, and the parameter where it does, infinite for none."""
    if scene is None:
        return np.full(len(way), -1), np.full(len(way), np.inf)
    found = scene.run(origins.astype(np.float32), way.astype(np.float32), output=1)
    hit = found["primID"].astype(np.int64)
    return hit, np.where(hit >= 0, found["tfar"].astype(np.float64), np.inf)
