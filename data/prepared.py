"""A model prepared for visibility: everything that hides in it and everything that may be hidden, each found once.

Occluders are, from the plainest to the most general: opaque rectangles of axial planes, which also cut cells; regions,
which merge them with sections of closed elements; patches, which are oblique. Glass is none of them. Every part is made
when it is first asked for; a scene does not change once it is read.
"""

import time
from collections.abc import Iterator
from functools import cached_property

import numpy as np

from .blockers import Blockers, find_blockers, join_blockers
from .curtains import find_curtains
from .exposed import exposed_faces
from .graph import CellGraph
from .occludees import Occludees, box_occludees, find_occludees
from .opaque import OpaquePlanes, carved_planes, opaque_planes
from .patches import Patches, copied_patches, find_patches, join_outlines, rectangle_outlines
from .patience import OutOfTime, within
from .regions import Regions, find_regions, join_regions
from .room_cells import find_room_points
from .scene import OPAQUE, Role, Scene
from .shapes import extents
from .skewed import find_sections, with_sections
from .solids import closed_elements

# Smaller pieces of furniture hide little and would fill the hierarchy of blockers.
BLOCKING_DETAIL_M2 = 0.1
# Oblique details of outlines, such as arches, are left out of what cuts cells with the boxes around them, if that loses
# no more than this in each.
CARVED_M2 = 1.0
# Closed elements with less are not cut at an angle.
CURTAIN_M2 = 1.0
# Oblique surfaces below this hide little, and are not made of triangles below the share.
PATCH_M2 = 1.0
PATCH_SHARE = 1 / 32
# Share of the time for what is plainest that pieces of objects may take.
PIECES_SHARE = 1 / 3


class PreparedModel:
    """What hides and what may be hidden in a scene, in grid steps.

    Attributes:
        scene: the model.
        whole: whether nothing has been left out for want of time.
    """

    def __init__(self, scene: Scene) -> None:
        """Nothing is computed yet."""
        self.scene, self.whole = scene, True

    @cached_property
    def closed(self) -> list[tuple[int, np.ndarray]]:
        """(object_id, triangles (m, 3, 3) int32) of each closed opaque element."""
        return closed_elements(self.scene)

    @cached_property
    def room_points(self) -> list[np.ndarray]:
        """Points of each room where eyes may be [grid steps], each of shape (n, 3), float64."""
        return find_room_points(self.scene, self.closed)

    @cached_property
    def large_closed(self) -> list[np.ndarray]:
        """Triangles of closed elements that are large enough to be cut at an angle."""
        least = CURTAIN_M2 / self.scene.grid_m**2
        bounds = self.scene.object_bounds()
        large = _flat_area(bounds[:, 1] - bounds[:, 0]) >= least
        return [triangles for object_id, triangles in self.closed if large[object_id]]

    def closed_of(self, role: Role) -> list[tuple[int, np.ndarray]]:
        """Those of one role."""
        wanted = self.scene.object_mask(role)
        return [(object_id, triangles) for object_id, triangles in self.closed if wanted[object_id]]

    @cached_property
    def surfaces(self) -> OpaquePlanes:
        """Opaque rectangles of occluders, on faces and inside walls that are nearly axial."""
        return with_sections(self._faces[0], self.sections)

    @cached_property
    def planes(self) -> OpaquePlanes:
        """Those that cut cells: with oblique details carved out, so that arches leave rectangles open."""
        return with_sections(self._faces[1], self.sections)

    @cached_property
    def _faces(self) -> tuple[OpaquePlanes, OpaquePlanes]:
        """Opaque rectangles of faces of occluders, and the same carved."""
        return carved_planes(self.scene.triangles(Role.OCCLUDER)[0], CARVED_M2 / self.scene.grid_m**2)

    @cached_property
    def sections(self) -> list[np.ndarray]:
        """Opaque rectangles inside closed occluders that are nearly axial: flat boxes of each axis."""
        return find_sections([t for _, t in self.closed_of(Role.OCCLUDER)], self.scene.grid_m)

    @cached_property
    def blocking_planes(self) -> OpaquePlanes:
        """Surfaces of occluders, carved or not, and the large ones of details (furniture): what blocks."""
        triangles, _ = self.scene.triangles(Role.DETAIL)
        least = BLOCKING_DETAIL_M2 / self.scene.grid_m**2
        boxes = []
        # Half of a large rectangle is a large triangle; the fans that close round tops are not worth looking at.
        large = opaque_planes(triangles[_flat_area(extents(triangles)) >= least], oblique_steps=1)
        for axis, (mine, others) in enumerate(zip(large.boxes, self.surfaces.boxes, strict=True)):
            both = np.concatenate([others, mine[_flat_area(mine[:, 1] - mine[:, 0]) >= least]])
            boxes.append(both[np.argsort(both[:, 0, axis], kind="stable")])
        return OpaquePlanes(boxes, self.surfaces.axial_area, self.surfaces.lost_area, self.surfaces.sliver)

    @cached_property
    def regions(self) -> Regions:
        """Opaque regions of axial planes, sections of closed elements among them."""
        return join_regions(self._region_parts())

    def _region_parts(self) -> Iterator[tuple[int, Regions]]:
        solids = ([triangles for _, triangles in self.closed_of(role)] for role in OPAQUE)
        yield from find_regions(self.blocking_planes, *solids, self.scene.grid_m)

    def make_plainest(self, seconds: float) -> bool:
        """Make occludees and regions in about so many seconds: whole objects and some regions, where that takes longer.

        Returns:
            Whether nothing was left out.
        """
        until, parts = time.perf_counter() + seconds, []
        if "occludees" not in vars(self):
            try:
                with within(PIECES_SHARE * seconds):
                    self.occludees = find_occludees(self.scene, exposed_faces(self.closed, self.scene.first_alike))
            except OutOfTime:
                self.occludees, self.whole = box_occludees(self.scene), False
        if "regions" not in vars(self):
            try:
                with within(until - time.perf_counter()):
                    parts.extend(self._region_parts())
            except OutOfTime:
                self.whole = False
            self.regions = join_regions(parts)
        return self.whole

    @cached_property
    def patches(self) -> Patches:
        """Oblique occluders: discs of opaque triangles."""
        corners, owners = self.scene.triangles()
        models, bounds = self.scene.first_alike, self.scene.object_bounds()
        least, opaque = PATCH_M2 / self.scene.grid_m**2, self.scene.object_mask(*OPAQUE)
        # The first opaque one of those that are alike; the others' patches are shifted.
        first = np.full(len(models), -1)
        first[models[opaque][::-1]] = np.flatnonzero(opaque)[::-1]
        models = np.where(opaque, first[models], -1)
        # The extent bounds the area, and most triangles of a large model are small ones of furniture and pipes.
        large = np.flatnonzero((models == np.arange(len(models)))[owners])
        large = large[_flat_area(extents(corners[large])) >= PATCH_SHARE * least]
        edges = (corners[large, 1:] - corners[large, :1]).astype(float)
        large = large[np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) >= 2 * PATCH_SHARE * least]
        found = find_patches(corners[large], owners[large], least_area=least)
        # Members are places among the large triangles of their owner; certificates want them among all of its.
        ahead, begin = np.searchsorted(owners[large], found.owner), self.scene.triangle_starts[found.owner]
        found.members = [large[a + held] - f for a, f, held in zip(ahead, begin, found.members, strict=True)]
        return copied_patches(found, models, bounds[:, 0])

    @cached_property
    def curtains(self) -> Blockers:
        """Upright rectangles at any angle, inside closed elements or on faces."""
        return self._curtains_within(np.inf)

    def make_curtains(self, seconds: float) -> bool:
        """Make the curtains unless that should take longer; returns whether they are made."""
        if "curtains" not in vars(self):
            try:
                self.curtains = self._curtains_within(seconds)
            except OutOfTime:
                return False
        return True

    def _curtains_within(self, seconds: float) -> Blockers:
        faces = self.scene.triangles(*OPAQUE)[0]
        return find_curtains(self.large_closed, faces, self.scene.grid_m, seconds=seconds)

    @cached_property
    def walls(self) -> Blockers:
        """What the search of lines may branch on: rectangles of regions, then curtains."""
        return join_blockers([self.regions.blockers, self.curtains])

    @cached_property
    def outlines(self) -> Patches:
        """Rectangles of regions and oblique patches alike, as convex outlines."""
        return join_outlines(rectangle_outlines(self.regions.boxes), self.patches)

    @cached_property
    def occludees(self) -> Occludees:
        """Objects and their pieces: what may be hidden."""
        return find_occludees(self.scene, exposed_faces(self.closed, self.scene.first_alike))

    @cached_property
    def whole_occludees(self) -> Occludees:
        """The same with faces that other elements cover: certificates are checked against all triangles."""
        return find_occludees(self.scene)

    def blockers(self, graph: CellGraph) -> Blockers:
        """What no sightline between live cells of a cell-and-portal graph of the model crosses."""
        return find_blockers(graph, self.blocking_planes)


def no_patches() -> Patches:
    """Patches of nothing."""
    return find_patches(np.zeros((0, 3, 3), np.int32), np.zeros(0, int), least_area=1.0)


def _flat_area(extent: np.ndarray) -> np.ndarray:
    """Area of the two longest sides of boxes with this extent, shape (n, 3), float64."""
    x, y, z = extent.T.astype(float)
    return np.maximum(np.maximum(x * y, y * z), z * x)
