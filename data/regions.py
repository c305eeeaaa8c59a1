"""Opaque regions of axial planes: true opaque surface on the plane, and the sections of closed elements it cuts.

A sightline that starts outside every solid and passes the plane inside a region has met opaque surface by then: either
the surface on the plane, or that of a closed element whose inside it has reached. Cutting *all* closed elements fills
the gaps that walls leave in each other's faces and merges what a model keeps apart, so one region is as strong as the
wall that a person sees. Open, inverted or doubled meshes give no section; they lose occlusion, never safety.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from .apart import taken_apart
from .blockers import Blockers
from .graph import OTHER_AXES, flat_boxes
from .opaque import OpaquePlanes
from .patience import ask
from .ragged import places_of, starts_of
from .rasters import Rasters
from .sections import Cut, reaching, section_rectangles

# Regions and pieces of furniture below this hide little and would fill the hierarchy.
LEAST_M2 = 0.5
# An element thinner than this is also cut through its middle, which serves cells that touch its face.
THIN_M = 0.6
# A closed element with oblique faces is cut only where it is so large: its sections break into many rectangles.
ROUND_M2 = 2.0
# Normals that rise, or lean off an axis, by less than this do not count.
UPRIGHT = 1e-3
# An oblique section of more triangles than this is left out: it costs more than it hides.
SECTION_TRIANGLES = 200
# Lots of planes are worked on every so many of them in turn: what there is no time for is then missing everywhere.
TURNS = 8


@dataclass
class Regions:
    """Connected regions, each on a raster of its own distinct coordinates.

    Attributes:
        axis: the axis each is perpendicular to, shape (regions,), int32.
        plane: coordinate on that axis [grid steps], shape (regions,), int32.
        places: where each region's u, v and table begin in the three arrays below, shape (regions + 1, 3), int64.
        u: ascending raster coordinates on the lower of the other two axes, all regions one after another, int32.
        v: likewise on the higher one.
        open_before: uncovered raster cells before (i, j), a summed-area table of len(u) x len(v) per region, int32.
        boxes: rectangles inside the regions, overlapping, none able to grow [grid steps], shape (boxes, 2, 3), int32.
        region: region of each rectangle, shape (boxes,), int32.
    """

    axis: np.ndarray
    plane: np.ndarray
    places: np.ndarray
    u: np.ndarray
    v: np.ndarray
    open_before: np.ndarray
    boxes: np.ndarray
    region: np.ndarray

    @property
    def blockers(self) -> Blockers:
        """The rectangles as a target search wants them."""
        return Blockers(self.boxes, self.axis[self.region])


def find_regions(
    opaque: OpaquePlanes, occluders: list[np.ndarray], details: list[np.ndarray], grid_m: float
) -> Iterator[tuple[int, Regions]]:
    """Regions of every plane that holds enough opaque surface, or the middle of a thin or oblique closed element.

    In parts, as of `join_regions`; fewer of them are sound occluders, too.

    Args:
        opaque: opaque rectangles.
        occluders: triangles (m, 3, 3) of each closed element that is cut, int32.
        details: likewise of closed elements that are cut only if they are boxes and large enough.
        grid_m: grid step [m].

    Raises:
        OutOfTime: there is no time for the next part.
    """
    least = LEAST_M2 / grid_m**2
    elements = _Sections(occluders, details, least, ROUND_M2 / grid_m**2)
    index = opaque.index
    axes, planes, owners, found = [], [], [], []
    for axis in range(3):
        extent = (opaque.boxes[axis][:, 1] - opaque.boxes[axis][:, 0]).astype(float)[:, OTHER_AXES[axis]]
        every, place = np.unique(opaque.boxes[axis][:, 0, axis], return_inverse=True)
        area = np.bincount(place, extent.prod(axis=1), minlength=len(every))
        middles = elements.middles(axis, round(THIN_M / grid_m))
        wanted = np.unique(np.concatenate([every[area >= least], middles])).astype(np.int64)
        surface = [index.rectangles(axis, k) for k in wanted.tolist()]
        place, sections = elements.rectangles(axis, wanted)
        place = np.concatenate([np.repeat(np.arange(len(wanted)), [len(part) for part in surface]), place])
        owners.append(place + sum(map(len, planes)))
        found += [*surface, sections]
        axes.append(np.full(len(wanted), axis, np.int32))
        planes.append(wanted.astype(np.int32))
    owner, rectangles = np.concatenate(owners), np.concatenate([np.zeros((0, 2, 2), np.int64), *found])
    yield from _connected(owner, rectangles, np.concatenate(axes), np.concatenate(planes), least)


def _connected(
    owner: np.ndarray, rectangles: np.ndarray, axes: np.ndarray, planes: np.ndarray, least: float
) -> Iterator[tuple[int, Regions]]:
    """Connected parts of unions of rectangles of planes, and maximal rectangles of each; as of `find_regions`.

    Args:
        owner: plane of each rectangle, shape (n,).
        rectangles: shape (n, 2, 2), int64.
        axes: of each plane, shape (planes,), int32.
        planes: coordinates, likewise.
        least: smaller parts are left out [squared grid steps].
    """
    ask()
    owner, plane = taken_apart(owner, rectangles, len(planes))
    axes, planes = axes[plane], planes[plane]
    order = np.argsort(owner, kind="stable")
    owner, rectangles = owner[order], rectangles[order]
    points = [[(np.repeat(owner, 2), rectangles[:, :, c].ravel())] for c in (0, 1)]
    ask()
    lots, known = list(Rasters.of(points, len(planes)).lots()), {}
    for number in (k for turn in range(TURNS) for k in range(turn, len(lots), TURNS)):
        ask()
        first, rasters = lots[number]
        a, b = np.searchsorted(owner, [first, first + len(rasters)])
        covered = rasters.paint(owner[a:b] - first, rectangles[a:b])
        plane, own, mask = _parts(rasters, covered, least)
        yield number, _regions(axes[first + plane], planes[first + plane], own, mask, known)


def _parts(rasters: Rasters, covered: np.ndarray, least: float) -> tuple[np.ndarray, Rasters, np.ndarray]:
    """Connected parts of what rasters cover: raster of each part, and its own raster and covered cells."""
    owner, row, first, last = rasters.strips(covered, 1)
    strips = np.arange(len(owner))
    # Runs of the next row that share a column: from the first that ends beyond the run's begin, to the last that
    # begins before its end.
    begin, end = rasters.node(owner, row, first), rasters.node(owner, row, last)
    wide = rasters.sizes[1][owner]
    low, high = np.searchsorted(end, begin + wide, side="right"), np.searchsorted(begin, end + wide)
    one, other = np.repeat(strips, np.maximum(high - low, 0)), places_of(low, np.maximum(high - low, 0))
    graph = coo_matrix((np.ones(len(one), np.int8), (one, other)), (len(strips),) * 2)
    count, part = connected_components(graph, directed=False)
    # In the order of their first cells; small ones have no number.
    head = np.full(count, len(strips))
    np.minimum.at(head, part, strips)
    sides = [rasters.at(axis, owner, line) for axis, line in ((0, row), (0, row + 1), (1, first), (1, last))]
    area = np.bincount(part, ((sides[1] - sides[0]) * (sides[3] - sides[2])).astype(float), minlength=count)
    order = np.argsort(head)
    order = order[area[order] >= least]
    number = np.full(count, -1)
    number[order] = np.arange(len(order))
    part = number[part]
    # Raster lines that separate equal rows belong to other parts of the plane: a row begins or ends with a run unless
    # one of the row beside it holds all of the run.
    within = (begin[other] - wide[other] >= begin[one]) & (end[other] - wide[other] <= end[one])
    around = (begin[other] - wide[other] <= begin[one]) & (end[other] - wide[other] >= end[one])
    begins, ends = np.ones(len(strips), bool), np.ones(len(strips), bool)
    begins[other[within]] = False
    ends[one[around]] = False
    kept = part >= 0
    points = [
        [(part[kept & begins], sides[0][kept & begins]), (part[kept & ends], sides[1][kept & ends])],
        [(part[kept], sides[2][kept]), (part[kept], sides[3][kept])],
    ]
    own = Rasters.of(points, len(order))
    of, rectangles = rasters.tile(covered)
    corner = rasters.node(of, *(rasters.find(axis, of, rectangles[:, 0, axis]) for axis in (0, 1)))
    mine = part[np.searchsorted(begin, corner, side="right") - 1]
    return owner[head[order]], own, own.paint(mine[mine >= 0], rectangles[mine >= 0])


def _regions(
    axis: np.ndarray, plane: np.ndarray, rasters: Rasters, covered: np.ndarray, known: dict[bytes, np.ndarray]
) -> Regions:
    """Regions of what each raster covers; `known` as of `Rasters.maximal`."""
    opened = rasters.sum_along(rasters.sum_along(~covered & (rasters.area > 0), 0), 1)
    before = np.zeros(len(covered), np.int32)
    cells = np.flatnonzero(rasters.area > 0)
    before[cells + rasters.sizes[1][rasters.owner[cells]] + 1] = opened[cells]
    region, rectangles = rasters.maximal(covered, covered, known)
    boxes = flat_boxes(rectangles, axis[region], plane[region])
    places = np.stack([*rasters.starts, rasters.nodes], axis=1)
    u, v = (at.astype(np.int32) for at in rasters.coordinates)
    return Regions(axis, plane, places, u, v, before, boxes, region.astype(np.int32))


def join_regions(numbered: Iterable[tuple[int, Regions]]) -> Regions:
    """All of some parts, in the order of their numbers."""
    parts = [no_regions(), *(part for _, part in sorted(numbered, key=lambda found: found[0]))]
    places = np.concatenate([np.diff(part.places, axis=0) for part in parts])
    places = np.concatenate([np.zeros((1, 3), np.int64), np.cumsum(places, axis=0)])
    columns = {
        field.name: np.concatenate([getattr(part, field.name) for part in parts])
        for field in fields(Regions)
        if field.name not in ("places", "region")
    }
    before = starts_of([len(part.axis) for part in parts])
    region = [part.region + count for part, count in zip(parts, before[:-1], strict=True)]
    return Regions(places=places, region=np.concatenate(region).astype(np.int32), **columns)


def no_regions() -> Regions:
    """Regions of nothing."""
    boxes, places, empty = np.zeros((0, 2, 3), np.int32), np.zeros((1, 3), np.int64), np.zeros(0, np.int32)
    return Regions(empty, empty, places, empty, empty, empty, boxes, empty)


class _Sections:
    """Sections of closed elements."""

    def __init__(
        self, occluders: list[np.ndarray], details: list[np.ndarray], least: float, least_round: float
    ) -> None:
        self._triangles = occluders + [
            triangles
            for triangles in details
            if _is_box(triangles) and np.sort(np.ptp(triangles, axis=(0, 1)).astype(float))[1:].prod() >= least
        ]
        self._boxes = np.array([[t.min(axis=(0, 1)), t.max(axis=(0, 1))] for t in self._triangles], np.int64)
        self._boxes = self._boxes.reshape(-1, 2, 3)
        self._solid_box = np.array([_is_box(t) for t in self._triangles], bool)
        self._least = least
        size = (self._boxes[:, 1] - self._boxes[:, 0]).astype(float)
        faces = np.stack([size[:, OTHER_AXES[axis]].prod(axis=1) for axis in range(3)], axis=1)
        straight = np.array([((_normals(t) != 0).sum(axis=1) == 1).all() for t in self._triangles], bool)
        self._large = (faces >= least_round) | straight[:, None]
        # What stands at an angle is cut along its own faces (data/curtains.py); along the axes it gives staircases.
        oblique = np.array([_stands_oblique(t) for t in self._triangles], bool)
        self._large[oblique, :2] = False
        self._large[:, 2] &= ~oblique | (size[:, 2] < size[:, :2].min(axis=1))
        self._middle = self._boxes.sum(axis=1) // 2

    def middles(self, axis: int, thin: int) -> np.ndarray:
        """Planes through the middle of thin elements and of those that are no boxes."""
        size = (self._boxes[:, 1] - self._boxes[:, 0]).astype(float)
        wanted = (size[:, OTHER_AXES[axis]].prod(axis=1) >= self._least) & (size[:, axis] > 1)
        wanted &= np.where(self._solid_box, size[:, axis] <= thin, self._large[:, axis])
        return np.unique(self._middle[wanted, axis])

    def rectangles(self, axis: int, planes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rectangles inside the sections just below and just above planes.

        Args:
            axis: perpendicular to the planes.
            planes: coordinates, ascending, int64.

        Returns:
            Plane of each, shape (n,), and corners, shape (n, 2, 2), int64.
        """
        low, high = self._boxes[:, :, axis].T
        begin, end = np.searchsorted(planes, low), np.searchsorted(planes, high, "right")
        boxed = np.flatnonzero(self._solid_box)
        found = [places_of(begin[boxed], (end - begin)[boxed])]
        boxes = np.repeat(self._boxes[boxed][:, :, OTHER_AXES[axis]], (end - begin)[boxed], axis=0)
        cuts: list[Cut] = []
        served: list[np.ndarray] = []
        for element in np.flatnonzero(~self._solid_box & self._large[:, axis] & (begin < end)).tolist():
            ask()
            for cut, places in self._cuts(element, axis, np.arange(begin[element], end[element]), planes):
                cuts.append(cut)
                served.append(places)
        cut, sections = section_rectangles(cuts)
        starts = np.searchsorted(cut, np.arange(len(cuts) + 1))
        row = np.repeat(np.arange(len(cuts)), [len(places) for places in served])
        found.append(np.repeat(np.concatenate([found[0][:0], *served]), np.diff(starts)[row]))
        return np.concatenate(found), np.concatenate([boxes, sections[places_of(starts[row], np.diff(starts)[row])]])

    def _cuts(
        self, element: int, axis: int, places: np.ndarray, planes: np.ndarray
    ) -> Iterator[tuple[Cut, np.ndarray]]:
        """Sections of an element that is no box by some of the planes, and the places of the planes that each serves.

        What is cut, and whether it is a prism there, changes only where the element has a vertex: between two heights
        of vertices a prism has one section. Walls are cut by hundreds of planes.
        """
        triangles, middle = self._triangles[element], self._middle[element, axis]
        heights = np.unique(triangles[:, :, axis])
        below, above = places[planes[places] > heights[0]], places[planes[places] < heights[-1]]
        uppers = np.searchsorted(heights, planes[below]), np.searchsorted(heights, planes[above], "right")
        for upper in np.unique(np.concatenate(uppers)).tolist():
            cut = triangles[reaching(triangles, axis, heights[upper])]
            if len(cut) > SECTION_TRIANGLES:
                continue
            sides = below[uppers[0] == upper], above[uppers[1] == upper]
            if (_normals(cut)[:, axis] == 0).all():
                served = np.concatenate(sides)
                first = int(served.min())
                yield Cut(cut, axis, int(planes[first]), first in sides[0]), served
                continue
            for mine, under in zip(sides, (True, False), strict=True):
                at = mine[planes[mine] == middle]
                if len(at):
                    yield Cut(cut, axis, int(middle), under), at


def _stands_oblique(triangles: np.ndarray) -> bool:
    """Whether most upright faces of an element are on neither plan axis."""
    normals = _normals(triangles).astype(float)
    size = np.linalg.norm(normals, axis=1)
    upright = np.abs(normals[:, 2]) <= UPRIGHT * size
    oblique = upright & (np.abs(normals[:, :2]).min(axis=1) > UPRIGHT * size)
    return bool(size[oblique].sum() > 0.5 * size[upright].sum())


def _is_box(triangles: np.ndarray) -> bool:
    """Whether a closed element is its own bounding box."""
    if len(triangles) != 12:
        return False
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    corners = np.unique(triangles.reshape(-1, 3), axis=0)
    if len(corners) != 8 or not ((corners == low) | (corners == high)).all():
        return False
    faces = np.ptp(triangles, axis=1) == 0
    return bool((faces.sum(axis=1) == 1).all() and (faces.sum(axis=0) == 4).all())


def _normals(triangles: np.ndarray) -> np.ndarray:
    a, b = (triangles[:, i].astype(np.int64) - triangles[:, 0] for i in (1, 2))
    return np.cross(a, b)
