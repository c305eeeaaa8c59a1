"""The cell-and-portal graph on a device, and what every search over it shares."""

import numpy as np
import warp as wp

from ..data.graph import CellGraph
from .launch import CPU, Device

f64 = wp.float64


@wp.struct
class DeviceGraph:
    """Cells, portals and adjacency as Warp arrays, in grid steps.

    `entries` row: (portal, cell behind it, axis, octant mask); bit o of the mask is set when a line whose direction
    lies in octant o can cross that way. Bit i of an octant is set when direction component i is negative.
    """

    cell_lo: wp.array[wp.vec3i]
    cell_hi: wp.array[wp.vec3i]
    portal_lo: wp.array[wp.vec3i]
    portal_hi: wp.array[wp.vec3i]
    starts: wp.array[int]
    entries: wp.array[wp.vec4i]


def device_graph(graph: CellGraph, device: Device = CPU) -> DeviceGraph:
    """Copy the graph to a device."""
    starts, pairs = graph.adjacency()
    here = np.repeat(np.arange(graph.cell_count), np.diff(starts))
    axis = graph.portal_axis[pairs[:, 0]].astype(np.int32)
    forward = graph.portal_cells[pairs[:, 0], 0] == here
    octants = np.arange(8)
    negative = (octants[None, :] >> axis[:, None]) & 1
    mask = ((negative == (~forward[:, None]).astype(np.int64)) << octants).sum(axis=1)
    return device.struct(
        DeviceGraph,
        cell_lo=device.corners(graph.cells[:, 0]),
        cell_hi=device.corners(graph.cells[:, 1]),
        portal_lo=device.corners(graph.portals[:, 0]),
        portal_hi=device.corners(graph.portals[:, 1]),
        starts=starts,
        entries=np.column_stack([pairs, axis, mask]),
    )


@wp.func
def reflect_low(lo: wp.vec3i, hi: wp.vec3i, octant: int) -> wp.vec3d:
    """Low corner of a box after the axes on which the octant is negative were mirrored."""
    out = wp.vec3d()
    for i in range(3):
        out[i] = f64(lo[i])
        if ((octant >> i) & 1) == 1:
            out[i] = -f64(hi[i])
    return out


@wp.func
def reflect_high(lo: wp.vec3i, hi: wp.vec3i, octant: int) -> wp.vec3d:
    """High corner of a box after the axes on which the octant is negative were mirrored."""
    out = wp.vec3d()
    for i in range(3):
        out[i] = f64(hi[i])
        if ((octant >> i) & 1) == 1:
            out[i] = -f64(lo[i])
    return out
