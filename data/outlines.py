"""What closed outlines cover of their planes, exactly, on rasters of their own coordinates.

An outline is a set of directed edges of which as many leave a point as reach it. Axial edges give windings that are
exact; a raster cell that an oblique edge may cross, or a rounded one comes near, is dropped: what is called covered is
a subset of what is. Many outlines are worked on at once (data/rasters.py).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from .patience import ask
from .ragged import places_of
from .rasters import Rasters

# An oblique outline is followed by a staircase: at most this many steps per edge, none shorter than OBLIQUE_STEP grid
# steps.
OBLIQUE_STEPS = 12
OBLIQUE_STEP = 64
# What comes within so many grid steps of an edge that was rounded to the grid is not called covered.
ROUNDED_REACH = 2
# The box around an oblique part that is carved out is no larger than so many times what it may lose.
CARVED_BOX = 4


@dataclass(frozen=True)
class Outlines:
    """Outlines of many planes.

    Attributes:
        edges: directed edges (from, to) x (u, v) [grid steps], shape (m, 2, 2), int64; outlines are counter-clockwise.
        owner: outline of each edge, ascending, shape (m,), int64.
        count: of outlines.
        rounded: edges that may be off by half a step; what comes within ROUNDED_REACH of them is left out; (m,), bool.
    """

    edges: np.ndarray
    owner: np.ndarray
    count: int
    rounded: np.ndarray

    @property
    def oblique(self) -> np.ndarray:
        """Edges that are not along an axis, shape (m,), bool."""
        return (self.edges[:, 0] != self.edges[:, 1]).all(axis=1)

    def part(self, first: int, stop: int) -> "Outlines":
        """Outlines from `first` to before `stop`."""
        a, b = np.searchsorted(self.owner, [first, stop])
        return Outlines(self.edges[a:b], self.owner[a:b] - first, stop - first, self.rounded[a:b])

    def only(self, chosen: np.ndarray) -> "Outlines":
        """Chosen outlines, (count,) bool, numbered anew."""
        mine, number = chosen[self.owner], np.cumsum(chosen) - 1
        return Outlines(self.edges[mine], number[self.owner[mine]], int(chosen.sum()), self.rounded[mine])


@dataclass(frozen=True)
class Covered:
    """What some outlines cover.

    Attributes:
        first: number of the first of them.
        rasters: one for each.
        kept: raster cells inside, bool.
        lost: those that are inside or partly so, and were dropped.
    """

    first: int
    rasters: Rasters
    kept: np.ndarray
    lost: np.ndarray

    def areas(self, mask: np.ndarray) -> np.ndarray:
        """Area of cells by raster, shape (rasters,), float64."""
        chosen = np.flatnonzero(mask)
        area = self.rasters.area[chosen]
        if len(self.rasters) == 1:
            return area.sum(keepdims=True)
        return np.bincount(self.rasters.owner[chosen], area, minlength=len(self.rasters))


def cover(
    outlines: Outlines,
    steps: int | np.ndarray = OBLIQUE_STEPS,
    *,
    anywhere: bool = False,
    carve: np.ndarray | None = None,
) -> Iterator[Covered]:
    """What outlines cover, in lots.

    Args:
        outlines: of planes.
        steps: most steps of the staircase along an oblique edge; 1 for none. One number, or one for each outline.
        anywhere: inside is where the winding number is not 0; otherwise where it is positive.
        carve: oblique parts of an outline are left out with the boxes around them where that loses no more than this
            area [squared grid steps] in each; 0 for none. By default none; shape (count,), float.
    """
    every = Rasters.of([_breaks(outlines, c, steps) for c in (0, 1)], outlines.count)
    for first, rasters in every.lots():
        mine = outlines.part(first, first + len(rasters))
        covered, crossed = _windings(mine, rasters, anywhere)
        if carve is not None:
            for which in np.flatnonzero(carve[first : first + len(rasters)]):
                _carve(mine.part(which, which + 1), rasters, int(which), covered, crossed, float(carve[first + which]))
        yield Covered(first, rasters, covered & ~crossed, covered & crossed)


def tiles(
    outlines: Outlines, steps: int | np.ndarray = OBLIQUE_STEPS, *, anywhere: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Disjoint rectangles inside outlines: outline of each, ascending, and corners, shape (n, 2, 2), int64.

    Arguments as of `cover`.
    """
    owners, found = [np.zeros(0, np.int64)], [np.zeros((0, 2, 2), np.int64)]
    for part in cover(outlines, steps, anywhere=anywhere):
        owner, rectangles = part.rasters.tile(part.kept)
        owners.append(owner + part.first)
        found.append(rectangles)
    return np.concatenate(owners), np.concatenate(found)


def outline(triangles: np.ndarray, owner: np.ndarray, count: int) -> Outlines:
    """Outlines of unions of triangles, each turned counter-clockwise: edges left after opposite ones cancelled.

    Args:
        triangles: corners (u, v) [grid steps], shape (m, 3, 2), int, any orientation.
        owner: plane of each, shape (m,).
        count: of planes.
    """
    # Doubles go first: beside a partner that is single, a doubled triangle would leave their oblique edge standing.
    triangles = triangles.astype(np.int64)
    order = np.lexsort((triangles[:, :, 1], triangles[:, :, 0]), axis=1)
    triangles = np.take_along_axis(triangles, order[:, :, None], axis=1)
    ask()
    rows = np.unique(np.column_stack([owner, triangles.reshape(-1, 6)]), axis=0)
    owner, triangles = rows[:, 0], rows[:, 1:].reshape(-1, 3, 2)
    ask()
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    clockwise = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] < 0
    triangles = np.where(clockwise[:, None, None], triangles[:, ::-1], triangles)
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 4)
    turned = edges[:, [2, 3, 0, 1]]
    upward = (edges[:, :2] < turned[:, :2])[:, 0] | ((edges[:, 0] == turned[:, 0]) & (edges[:, 1] < turned[:, 1]))
    keyed = np.column_stack([np.repeat(owner, 3), np.where(upward[:, None], edges, turned)])
    ask()
    keys, where = np.unique(keyed, axis=0, return_inverse=True)
    ask()
    times = np.bincount(where.ravel(), np.where(upward, 1, -1), minlength=len(keys)).astype(np.int64)
    forward = np.repeat(keys, np.maximum(times, 0), axis=0)
    backward = np.repeat(keys[:, [0, 3, 4, 1, 2]], np.maximum(-times, 0), axis=0)
    left = np.concatenate([forward, backward])
    left = left[np.argsort(left[:, 0], kind="stable")]
    return Outlines(left[:, 1:].reshape(-1, 2, 2), left[:, 0], count, np.zeros(len(left), bool))


def _breaks(outlines: Outlines, c: int, steps: int | np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Raster coordinates, with their outlines: every end, steps along oblique edges, and beside rounded ones.

    Lines beside rounded edges keep what is lost there thin: they lie as far as is marked across the edge.
    """
    edges, owner = outlines.edges[:, :, c], outlines.owner
    doubtful, mine = edges[outlines.rounded].ravel(), np.repeat(owner[outlines.rounded], 2)
    lots = [(np.repeat(owner, 2), edges.ravel())]
    lots += [(mine, doubtful + sign * 2 * ROUNDED_REACH) for sign in (-1, 1)]
    of, (a, b) = owner[outlines.oblique], edges[outlines.oblique].T
    most = steps if isinstance(steps, int) else steps[of]
    number = np.minimum(most, np.abs(b - a) // OBLIQUE_STEP)
    some = number > 1
    a, b, of, number = a[some], b[some], of[some], number[some]
    share = places_of(np.ones(len(of), np.int64), number - 1)
    times = number - 1
    lots.append((np.repeat(of, times), (share * np.repeat((b - a) / number, times) + np.repeat(a, times)).astype(int)))
    return lots


def _windings(outlines: Outlines, rasters: Rasters, anywhere: bool) -> tuple[np.ndarray, np.ndarray]:
    """Raster cells inside outlines, and those that oblique edges may cross or that rounded ones come near; bool."""
    edges, owner, oblique = outlines.edges, outlines.owner, outlines.oblique
    steep = ~oblique & (edges[:, 0, 0] == edges[:, 1, 0])
    change = np.zeros(rasters.nodes[-1], np.int32)
    columns = rasters.find(0, owner[steep], edges[steep][:, 0, 0])
    # A point right of an edge that rises has it on its right-hand side: outlines are counter-clockwise, so -1.
    for end, sign in ((0, -1), (1, 1)):
        rows = rasters.find(1, owner[steep], edges[steep][:, end, 1])
        np.add.at(change, rasters.node(owner[steep], columns, rows), sign)
    winding = rasters.sum_along(change, 1)
    of, row, first, last, sign = _crossings(edges[oblique], owner[oblique], rasters)
    # Cells left of `last` in such a row are either crossed (dropped) or left of the edge.
    np.add.at(winding, rasters.node(of, last, row), sign)
    winding = rasters.sum_along(winding, 0)
    crossed = rasters.mark(0, of, row, first, last)
    for axis in (0, 1) if outlines.rounded.any() else ():
        crossed |= rasters.mark(axis, *_near(outlines, rasters, axis))
    # Beyond the last row and column there are no cells, and nothing is inside.
    inside = winding != 0 if anywhere else winding > 0
    return inside & (rasters.area > 0), crossed


def _crossings(edges: np.ndarray, owner: np.ndarray, rasters: Rasters) -> tuple[np.ndarray, ...]:
    """Where oblique edges may cross rows of their rasters: raster, row, first column, past the last one, winding."""
    (a, b), rising = edges.transpose(1, 0, 2), edges[:, 1, 1] > edges[:, 0, 1]
    low, high = np.where(rising[:, None], a, b), np.where(rising[:, None], b, a)
    begin, end = (rasters.find(1, owner, point[:, 1]) for point in (low, high))
    edge = np.repeat(np.arange(len(edges)), end - begin)
    slope = ((high[:, 0] - low[:, 0]) / (high[:, 1] - low[:, 1]))[edge]
    row, of, low = places_of(begin, end - begin), owner[edge], low[edge]
    at = np.stack([low[:, 0] + (rasters.at(1, of, row + k) - low[:, 1]) * slope for k in (0, 1)])
    # Half a step of padding covers the float64 rounding many times over and only ever drops cells. Beyond its own
    # ends, where the next raster cell may be as wide as the wall, the edge never reaches.
    reach = np.sort(edges[:, :, 0], axis=1)[edge].T
    left, right = np.clip(np.sort(at, axis=0) + np.array([[-0.5], [0.5]]), *reach)
    first = np.maximum(rasters.find(0, of, np.floor(left).astype(np.int64), "right") - 1, 0)
    last = np.minimum(rasters.find(0, of, np.ceil(right).astype(np.int64)), rasters.sizes[0][of] - 1)
    return of, row, first, last, np.where(rising, -1, 1)[edge]


def _near(outlines: Outlines, rasters: Rasters, axis: int) -> tuple[np.ndarray, ...]:
    """What comes within ROUNDED_REACH of rounded edges that run across an axis, as `Rasters.mark` wants it."""
    edges, owner = outlines.edges[outlines.rounded], outlines.owner[outlines.rounded]
    flat = np.abs(edges[:, 1, 0] - edges[:, 0, 0]) > np.abs(edges[:, 1, 1] - edges[:, 0, 1])
    mine = flat == (axis == 1)
    edges, owner, other = edges[mine], owner[mine], 1 - axis
    a, b = edges[:, 0], edges[:, 1]
    swap = (a[:, other] > b[:, other])[:, None]
    low, high = np.where(swap, b, a), np.where(swap, a, b)
    slope = (high[:, axis] - low[:, axis]) / np.maximum(high[:, other] - low[:, other], 1)
    begin = np.maximum(rasters.find(other, owner, low[:, other] - ROUNDED_REACH, "right") - 1, 0)
    end = np.minimum(rasters.find(other, owner, high[:, other] + ROUNDED_REACH), rasters.sizes[other][owner] - 1)
    edge = np.repeat(np.arange(len(edges)), end - begin)
    line, of = places_of(begin, end - begin), owner[edge]
    # The slope is at most 1: reaching further along the edge moves it no further across.
    at = np.stack([np.clip(rasters.at(other, of, line + k), low[edge, other], high[edge, other]) for k in (0, 1)])
    at = low[edge, axis] + (at - low[edge, other]) * slope[edge]
    left, right = at.min(axis=0) - 2 * ROUNDED_REACH, at.max(axis=0) + 2 * ROUNDED_REACH
    first = np.maximum(rasters.find(axis, of, np.floor(left).astype(np.int64), "right") - 1, 0)
    last = np.minimum(rasters.find(axis, of, np.ceil(right).astype(np.int64)), rasters.sizes[axis][of] - 1)
    return of, line, first, last


def _carve(
    outline: Outlines, rasters: Rasters, which: int, covered: np.ndarray, crossed: np.ndarray, carve_area: float
) -> None:
    """Leave out the boxes around oblique parts of one outline, where that loses little; changes `crossed`."""
    oblique = outline.oblique
    if not oblique.any():
        return
    shape = rasters.sizes[0][which], rasters.sizes[1][which]
    mine = slice(rasters.nodes[which], rasters.nodes[which + 1])
    covered, crossed, area = (table[mine].reshape(shape) for table in (covered, crossed, rasters.area))
    us, vs = (at[s[which] : s[which + 1]] for at, s in zip(rasters.coordinates, rasters.starts, strict=True))
    for window in _carved(outline.edges[oblique], us, vs, carve_area):
        # Where nothing is open, as on the floor under a pillar, there is no opening to make a rectangle of.
        if (area * covered)[window].sum() <= carve_area and (~covered & ~crossed)[window].any():
            crossed[window] = True


def _carved(edges: np.ndarray, us: np.ndarray, vs: np.ndarray, carve_area: float) -> list[tuple[slice, slice]]:
    """Windows of the raster: the box around each connected run of oblique edges, if it is not too large.

    Source: Lei and Ouhyoung, "Carving", section 4.1: the carving volume is the box around the edges of a cluster.
    """
    points, ends = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    low, high = ends.reshape(-1, 2).T
    count, run = connected_components(coo_matrix((np.ones(len(low)), (low, high)), (len(points),) * 2), directed=False)
    boxes = np.stack([np.full((count, 2), points.max()), np.full((count, 2), points.min())], axis=1)
    np.minimum.at(boxes[:, 0], run, points)
    np.maximum.at(boxes[:, 1], run, points)
    boxes = boxes[np.prod((boxes[:, 1] - boxes[:, 0]).astype(float), axis=1) <= CARVED_BOX * carve_area]
    u, v = np.searchsorted(us, boxes[:, :, 0]), np.searchsorted(vs, boxes[:, :, 1])
    return [(slice(*a), slice(*b)) for a, b in zip(u.tolist(), v.tolist(), strict=True)]
