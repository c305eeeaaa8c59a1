"""Sections of closed elements by axial planes: rectangles inside them, many sections at once.

A section is cut in whole grid steps: crossings are rounded, and what comes within two steps of a rounded outline is
left out (data/outlines.py), so every rectangle lies wholly where the winding number is not 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .graph import OTHER_AXES
from .outlines import Outlines, cover, tiles

# Steps of the staircase along an oblique outline of a section.
SECTION_STEPS = 4
# Steps along an outline on a level: slabs of turned wings reach to the middle of the walls on them.
LEVEL_STEPS = 24


@dataclass(frozen=True)
class Cut:
    """A section of a closed surface just below or just above an axial plane.

    Attributes:
        triangles: those of the surface that reach over the plane [grid steps], shape (m, 3, 3), int.
        axis: perpendicular to the plane.
        plane: its coordinate.
        below: which of the two sections.
    """

    triangles: np.ndarray
    axis: int
    plane: int
    below: bool = True


def section_rectangles(cuts: Sequence[Cut]) -> tuple[np.ndarray, np.ndarray]:
    """Disjoint rectangles inside sections.

    Returns:
        Section of each, ascending, shape (n,), and corners in u and v, shape (n, 2, 2), int64.
    """
    return tiles(_outlines(cuts), _steps(cuts), anywhere=True)


def largest_sections(cuts: Sequence[Cut], ends: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
    """The largest rectangles inside sections; they overlap.

    Args:
        cuts: of elements.
        ends: what rectangles are cut short by on both of their ends, along u and v [grid steps], shape (cuts, 2), int.
        least: smaller ones are left out [squared grid steps].

    Returns:
        As `section_rectangles`.
    """
    owners, found = [np.zeros(0, np.int64)], [np.zeros((0, 2, 2), np.int64)]
    for part in cover(_outlines(cuts), _steps(cuts), anywhere=True):
        # What is no larger in all holds no such rectangle: most sections of furniture are frames of thin boards.
        large = part.areas(part.kept) >= least
        wanted = part.kept & large[part.rasters.owner]
        owner, rectangles = part.rasters.maximal(wanted, wanted)
        owner, rectangles = owner + part.first, rectangles.astype(np.int64)
        rectangles += ends[owner][:, None] * np.array([[1], [-1]])
        size = rectangles[:, 1] - rectangles[:, 0]
        keep = (size > 0).all(axis=1) & (size.prod(axis=1) >= least)
        owners.append(owner[keep])
        found.append(rectangles[keep])
    return np.concatenate(owners), np.concatenate(found)


def _steps(cuts: Sequence[Cut]) -> np.ndarray:
    """Steps along oblique edges of each section, int."""
    return np.array([LEVEL_STEPS if cut.axis == 2 else SECTION_STEPS for cut in cuts], int)


def _outlines(cuts: Sequence[Cut]) -> Outlines:
    """Outlines of sections."""
    owner = np.repeat(np.arange(len(cuts)), [len(cut.triangles) for cut in cuts])
    # The height first, then u and v.
    turned = [cut.triangles[:, :, [cut.axis, *OTHER_AXES[cut.axis]]] for cut in cuts]
    turned = np.concatenate([np.zeros((0, 3, 3), np.int64), *turned]).astype(np.int64)
    plane = np.array([cut.plane for cut in cuts], np.int64)[owner]
    below = np.array([cut.below for cut in cuts], bool)[owner]
    heights, flat = turned[:, :, 0], turned[:, :, 1:]
    above = np.where(below[:, None], heights >= plane[:, None], heights > plane[:, None])
    # The lone corner is the one on its own side; the two edges at it are cut.
    lone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    rows = np.arange(len(turned))
    ends, exact = [], []
    for step in (1, 2):
        other = (lone + step) % 3
        h0, h1 = heights[rows, lone], heights[rows, other]
        share = ((plane - h0) / (h1 - h0))[:, None]
        # Both triangles of an edge must round to the same point: always from its upper end.
        p0, p1 = flat[rows, lone], flat[rows, other]
        share = np.where((h0 > h1)[:, None], share, 1 - share)
        top, bottom = np.where((h0 > h1)[:, None], p0, p1), np.where((h0 > h1)[:, None], p1, p0)
        ends.append(np.round(top + share * (bottom - top)).astype(np.int64))
        exact.append((top == bottom) | (share == 0) | (share == 1))
    forward = above[rows, lone][:, None]
    edges = np.stack([np.where(forward, ends[0], ends[1]), np.where(forward, ends[1], ends[0])], axis=1)
    # An axial edge may be rounded along itself, but not across.
    both = exact[0] & exact[1]
    straight = (edges[:, 0] == edges[:, 1]) & both
    rounded = ~(straight.any(axis=1) | both.all(axis=1))
    kept = (edges[:, 0] != edges[:, 1]).any(axis=1)
    return Outlines(edges[kept], owner[kept], len(cuts), rounded[kept])


def over(triangles: np.ndarray, axis: int, plane: int, *, below: bool = True) -> Cut:
    """The section of a closed surface by a plane, with the triangles that reach over it."""
    return Cut(triangles[reaching(triangles, axis, plane, below=below)], axis, plane, below)


def reaching(triangles: np.ndarray, axis: int, plane: int, *, below: bool = True) -> np.ndarray:
    """Triangles, shape (m, 3, 3), that a section just below or just above a plane cuts, shape (m,), bool."""
    heights = triangles[:, :, axis]
    above = heights >= plane if below else heights > plane
    return above.any(axis=1) & ~above.all(axis=1)
