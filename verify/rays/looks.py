"""Rays from the eyes of a camera path: what they meet must be in what the eye is said to see.

Embree finds, exact sightlines decide: what it reports beyond a vertex or an edge may not be there.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...data.camera import CameraPath, Screen
from ...data.graph import CellGraph
from ...data.scene import OPAQUE, Role, Scene
from ..exact.sightline import Sightlines
from ..exact.trace import portal_links
from .adjudicate import OVERSHOOT, Judge, Judgement, meets_flat_box
from .embree import embree_scene, through_glass

# Rays keep to this share of the screen, so that float32 does not take them off it.
INNER = 0.9999


@dataclass(frozen=True)
class Look:
    """What rays of one eye met.

    Attributes:
        frame: place in the path.
        seen: objects, ascending.
        dropped: those of them that the answers lack and that exact sightlines confirm.
        doubtful: those that the answers lack and that exact sightlines meet at edges only, or not at all.
    """

    frame: int
    seen: np.ndarray
    dropped: np.ndarray
    doubtful: np.ndarray


class Eyewitness:
    """Looks at a model through rays."""

    def __init__(self, scene: Scene, graph: CellGraph, cracks: np.ndarray) -> None:
        """Build Embree's scenes; cracks are openings that the graph closes, flat boxes [grid steps]."""
        self._grid_m = scene.grid_m
        opaque, glass = scene.triangles(*OPAQUE), scene.triangles(Role.TRANSPARENT)
        self._owners = opaque[1], glass[1]
        self._opaque, self._glass = embree_scene(opaque[0]), embree_scene(glass[0])
        self.lines = Sightlines(*opaque)
        self._judge = Judge(graph, self.lines, Sightlines(*glass), portal_links(graph), cracks)

    def _is_seen(self, target: int, eye: np.ndarray, end: np.ndarray) -> bool:
        """Whether a sightline shows the object, and not through a crack."""
        found = self._judge.sees_object(target, eye, end)
        return found is Judgement.VISIBLE and not meets_flat_box(eye, end, self._judge.cracks)

    def looks(
        self, path: CameraPath, screen: Screen, kept: list[np.ndarray], rays: int, seed: int = 0
    ) -> Iterator[Look]:
        """Cast random rays of each frame's screen from its eye; eyes in solids are passed over.

        Args:
            path: eyes and directions of view.
            screen: what rays go through.
            kept: objects that each eye is said to see, ascending.
            rays: of each eye.
            seed: of the rays.
        """
        rng = np.random.default_rng(seed)
        eyes, axes = path.eyes / self._grid_m, path.axes()
        half = INNER * np.array([screen.width, screen.height]) / 2 / screen.focal
        free = self.lines.outside_solids(eyes)
        for frame in np.flatnonzero(free).tolist():
            spots = np.column_stack([rng.uniform(-half, half, (rays, 2)), np.ones(rays)]) @ axes[frame]
            along = (spots / np.linalg.norm(spots, axis=1)[:, None]).astype(np.float32)
            yield Look(frame, *self.look(eyes[frame], along, kept[frame]))

    def look(self, eye: np.ndarray, along: np.ndarray, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cast rays from an eye.

        Args:
            eye: outside of solids [grid steps], shape (3,), float64.
            along: directions of unit length, shape (n, 3), float32.
            kept: objects that the eye is said to see, ascending.

        Returns:
            Objects that rays met, ascending; those of them that are not kept and that exact sightlines confirm; and
            those that are not kept and that these meet at edges only, or not at all.
        """
        objects, reach, ray = self._met(np.repeat(eye[None], len(along), axis=0).astype(np.float32), along)
        seen = np.unique(objects)
        lacking = np.flatnonzero(~np.isin(seen, kept))
        sure = np.zeros(len(seen), bool)
        for place in lacking:
            # Another ray may meet it better than the first.
            for row in np.flatnonzero(objects == seen[place])[:50]:
                end = eye + along[ray[row]].astype(float) * float(reach[row]) * OVERSHOOT
                sure[place] |= self._is_seen(int(seen[place]), eye, end)
        return seen, seen[sure], seen[lacking][~sure[lacking]]

    def outside_solids(self, eyes: np.ndarray) -> np.ndarray:
        """Whether eyes are outside of all solids, so that they see anything [grid steps], shape (n, 3); bool."""
        return self.lines.outside_solids(eyes)

    def _met(self, origins: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Object, parameter and ray of everything that rays meet up to the first opaque thing."""
        reach, hits = np.full(len(origins), np.inf, np.float32), np.full(len(origins), -1)
        if self._opaque is not None:
            found = self._opaque.run(origins, along, output=1)
            hits = found["primID"]
            reach[hits >= 0] = found["tfar"][hits >= 0]
        met = np.flatnonzero(hits >= 0)
        parts = [(self._owners[0][hits[met]], reach[met], met)]
        for ray, triangle, at in through_glass(self._glass, origins, along, reach):
            parts.append((self._owners[1][triangle], at, ray))
        return tuple(np.concatenate(column) for column in zip(*parts, strict=True))
