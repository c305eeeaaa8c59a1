"""The cell-and-portal graph: boxes that tile space, joined by axial rectangles.

Source: Funkhouser et al. 1996, section 3.1 (cells, portals, adjacency graph).
"""

from dataclasses import dataclass, replace

import numpy as np

from .plans import NO_PLANS, Plans

OTHER_AXES = np.array([[1, 2], [0, 2], [0, 1]])


def flat_boxes(rectangles: np.ndarray, axes: int | np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Rectangles of axial planes as boxes without thickness.

    Args:
        rectangles: low and high corners (u, v), shape (n, 2, 2).
        axes: perpendicular to their planes: one for all, or shape (n,).
        planes: coordinate of each plane, shape (n,).

    Returns:
        Shape (n, 2, 3), of the dtype of `planes`.
    """
    boxes = np.repeat(planes, 6).reshape(-1, 2, 3)
    uv = np.broadcast_to(OTHER_AXES[axes].reshape(-1, 1, 2), rectangles.shape)
    np.put_along_axis(boxes, uv, rectangles, axis=2)
    return boxes


@dataclass
class CellGraph:
    """Cells, portals and the opaque rest of the cells' faces, all in grid steps.

    Attributes:
        cells: boxes (low, high corner), shape (cells, 2, 3), int32. They never overlap.
        inhabitable: cells an observer may stand in, shape (cells,), bool.
        cell_names: shape (cells,), str.
        portal_cells: (low side, high side) cell of each portal, shape (portals, 2), int32.
        portal_axis: the axis that the portal is perpendicular to, shape (portals,), int8.
        portals: flat boxes (low, high corner), shape (portals, 2, 3), int32; low == high on `portal_axis`.
        plans: of view cells that stand at an angle, or follow a room, beside the cells that tile space: they come last,
            have no portals, may overlap everything, and only objects are claimed to be visible from them.
    """

    cells: np.ndarray
    inhabitable: np.ndarray
    cell_names: np.ndarray
    portal_cells: np.ndarray
    portal_axis: np.ndarray
    portals: np.ndarray
    plans: Plans = NO_PLANS

    @property
    def tile_count(self) -> int:
        """Number of cells that tile space: those without a plan, which come first."""
        return self.cell_count - len(self.plans.rows)

    @property
    def tiles(self) -> "CellGraph":
        """The same without view cells that have a plan."""
        n = self.tile_count
        return replace(
            self, cells=self.cells[:n], inhabitable=self.inhabitable[:n], cell_names=self.cell_names[:n], plans=NO_PLANS
        )

    @property
    def cell_count(self) -> int:
        """Number of cells."""
        return len(self.cells)

    @property
    def portal_count(self) -> int:
        """Number of portals."""
        return len(self.portals)

    @property
    def portal_sides(self) -> np.ndarray:
        """Shorter and longer side of each portal [grid steps], shape (portals, 2), int32."""
        # Across its axis it is flat.
        return np.sort(self.portals[:, 1] - self.portals[:, 0], axis=1)[:, 1:]

    def with_portals(self, chosen: np.ndarray) -> "CellGraph":
        """The same cells with some of the portals: indices or a mask."""
        kept = self.portal_cells[chosen], self.portal_axis[chosen], self.portals[chosen]
        return CellGraph(self.cells, self.inhabitable, self.cell_names, *kept, self.plans)

    def adjacency(self) -> tuple[np.ndarray, np.ndarray]:
        """Portals of each cell, as rows of a compressed table.

        Returns:
            starts, shape (cells + 1,), int32, and entries, shape (2 portals, 2), int32: (portal, cell behind it) of
            cell c are entries[starts[c]:starts[c + 1]], ascending by portal.
        """
        here = self.portal_cells.T.ravel()
        there = self.portal_cells[:, ::-1].T.ravel()
        portal = np.tile(np.arange(self.portal_count), 2)
        order = np.lexsort((portal, here))
        starts = np.searchsorted(here[order], np.arange(self.cell_count + 1))
        return starts.astype(np.int32), np.column_stack([portal[order], there[order]]).astype(np.int32)
