"""Trace sightlines through the cell-and-portal graph: the cells entered and the portals crossed, in order."""

import numpy as np
import warp as wp

from ..data.ragged import starts_of
from .graph import DeviceGraph
from .launch import CPU, Device, launch_rows

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# A crossing closer than this to a portal's edge [grid steps] is not called a crossing: float64 could not be sure.
EDGE_MARGIN = wp.constant(wp.float64(1.0e-6))
MAX_STEPS = wp.constant(1024)


@wp.func
def crossing_portal(graph: DeviceGraph, cell: int, axis: int, forward: bool, point: wp.vec3d) -> wp.vec2i:
    """The portal through which a line leaves a cell at `point` of its face, and the cell behind; or (-1, -1)."""
    u = int((axis + 1) % 3)
    v = int((axis + 2) % 3)
    for k in range(graph.starts[cell], graph.starts[cell + 1]):
        entry = graph.entries[k]
        if entry[2] == axis and (((entry[3] >> 0) & 1) == 1) == forward:
            lo = graph.portal_lo[entry[0]]
            hi = graph.portal_hi[entry[0]]
            if (
                point[u] > f64(lo[u]) + EDGE_MARGIN
                and point[u] < f64(hi[u]) - EDGE_MARGIN
                and point[v] > f64(lo[v]) + EDGE_MARGIN
                and point[v] < f64(hi[v]) - EDGE_MARGIN
            ):
                return wp.vec2i(entry[0], entry[1])
    return wp.vec2i(-1, -1)


@wp.kernel
def _trace(
    graph: DeviceGraph,
    sources: wp.array[int],
    origins: wp.array[wp.vec3d],
    ends: wp.array[wp.vec3d],
    spots: wp.array[wp.int64],
    first: int,
    steps_out: wp.array[int],
    reached_out: wp.array[int],
    portals_out: wp.array[int],
):
    row = first + wp.tid()
    cell = int(sources[row])
    p = origins[row]
    d = ends[row] - p
    steps = int(0)
    going = bool(True)
    while going:
        leave = f64(1.0)
        axis = int(-1)
        for i in range(3):
            t = f64(2.0)
            if d[i] > f64(0.0):
                t = (f64(graph.cell_hi[cell][i]) - p[i]) / d[i]
            if d[i] < f64(0.0):
                t = (f64(graph.cell_lo[cell][i]) - p[i]) / d[i]
            if t < leave:
                leave = t
                axis = i
        if axis < 0:
            going = False
        else:
            step = crossing_portal(graph, cell, axis, d[axis] > f64(0.0), p + d * leave)
            cell = step[1]
            if step[0] >= 0 and portals_out.shape[0] > 0:
                portals_out[spots[row] + wp.int64(steps)] = step[0]
            steps += 1
            if cell < 0 or steps == MAX_STEPS:
                cell = -1
                going = False
    steps_out[row] = steps
    reached_out[row] = cell


def launch_trace(
    graph: DeviceGraph,
    sources: np.ndarray,
    origins: np.ndarray,
    ends: np.ndarray,
    *,
    record: bool = True,
    device: Device = CPU,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Portals that each segment crosses on its way.

    Args:
        graph: on the same device.
        sources: cell that holds each origin, shape (n,), int.
        origins: [grid steps], shape (n, 3), float64.
        ends: likewise.
        record: list the portals; without it only the cells are wanted, in half the time.
        device: that holds the graph.

    Returns:
        The cell that holds each end, -1 where the line met a wall or a portal's edge; starts, shape (n + 1,), int64;
        and the portals of row r at starts[r]:starts[r + 1], int32 (undefined where it met one).
    """
    count = len(sources)
    rays = [device.array(sources, int), *(device.array(x, wp.vec3d) for x in (origins, ends))]
    steps, reached = device.zeros(count, int), device.zeros(count, int)

    def run(spots: np.ndarray, total: int) -> wp.array:
        portals = device.zeros(total, int)
        inputs = [graph, *rays, device.array(spots, wp.int64)]
        launch_rows(_trace, count, inputs, [steps, reached, portals], device)
        return portals

    run(np.zeros(count, np.int64), 0)
    starts = starts_of(steps.numpy())
    if not record:
        return reached.numpy(), starts, np.zeros(0, np.int32)
    portals = run(starts[:-1], int(starts[-1]))
    return reached.numpy(), starts, portals.numpy()
