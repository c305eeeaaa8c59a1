"""What an eye may see, looser but bounded: one rectangle of the screen for each cell, grown until nothing changes.

Source: Luebke and Georges 1995, "Portals and Mirrors: Simple, Fast Evaluation of Potentially Visible Sets"; here the
rectangles of all sequences that reach a cell are merged.
"""

import warp as wp

from .cone import CONE_SIZE, POLYGON_SIZE, SWAY, get, norm_bound, portal_in_cone, screen_cone, side_of
from .eye_marks import Eyes, EyeScene, Marks, axes_of, eye_of, has, mark_contents
from .graph import DeviceGraph
from .launch import Scratch

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# Values of a slot before its rectangles: a cone and two polygons.
RECTANGLES = wp.constant(CONE_SIZE + 2 * POLYGON_SIZE)


@wp.func
def on_screen(
    graph: DeviceGraph, portal: int, axis: int, eye: wp.vec3d, axes: wp.mat33d, frame: wp.vec4d, slack: f64,
    base: int, planes: int, work: wp.array[f64],
) -> wp.vec4d:  # fmt: skip
    """A rectangle of the screen (low x, low y, high x, high y) that holds a portal; low above high if it is off."""
    lo = wp.vec3d()
    hi = wp.vec3d()
    reach = wp.vec3d()
    for i in range(3):
        lo[i] = f64(graph.portal_lo[portal][i]) - eye[i]
        hi[i] = f64(graph.portal_hi[portal][i]) - eye[i]
        reach[i] = wp.max(wp.abs(lo[i]), wp.abs(hi[i]))
    left = portal_in_cone(work, base, planes, lo, hi, axis, base + CONE_SIZE, slack)
    out = wp.vec4d(f64(1.0e300), f64(1.0e300), -f64(1.0e300), -f64(1.0e300))
    loose = slack + SWAY * norm_bound(reach)
    for k in range(left[0]):
        p = axes * get(work, left[1] + 3 * k)
        if p[2] <= f64(2.0) * loose:
            return frame
        # A corner may be off by `loose` each way.
        near = p[2] - loose
        for i in range(2):
            off = loose * (f64(1.0) + wp.abs(p[i]) / near) / near
            out[i] = wp.min(out[i], p[i] / p[2] - off)
            out[i + 2] = wp.max(out[i + 2], p[i] / p[2] + off)
    return out


@wp.func
def grow(work: wp.array[f64], rectangle: int, wanted: wp.vec4d) -> bool:
    """Enlarge a rectangle to hold another; whether that changed it."""
    grown = bool(False)
    for i in range(2):
        if wanted[i] < work[rectangle + i]:
            work[rectangle + i] = wanted[i]
            grown = True
        if wanted[i + 2] > work[rectangle + i + 2]:
            work[rectangle + i + 2] = wanted[i + 2]
            grown = True
    return grown


@wp.func
def flood_screen(
    graph: DeviceGraph, scene: EyeScene, eyes: Eyes, row: int, source: int, base: int, ring: int, planes: int,
    work: wp.array[f64], queue: wp.array[int],
):  # fmt: skip
    """The rectangle of the screen through which each cell may be seen; low above high where it may not.

    Bounds are those of portals and of the screen, which are finitely many, so that growing ends.
    """
    eye = eye_of(eyes.views[row])
    axes = axes_of(eyes.views[row])
    cells = graph.cell_lo.shape[0]
    rectangles = base + RECTANGLES
    for cell in range(cells):
        queue[ring + cells + cell] = 0
        for i in range(2):
            work[rectangles + 4 * cell + i] = f64(1.0e300)
            work[rectangles + 4 * cell + i + 2] = -f64(1.0e300)
    grow(work, rectangles + 4 * source, eyes.frame)
    queue[ring] = source
    head = int(0)
    waiting = int(1)
    while waiting > 0:
        cell = queue[ring + head]
        head = (head + 1) % cells
        waiting -= 1
        queue[ring + cells + cell] = 0
        for k in range(graph.starts[cell], graph.starts[cell + 1]):
            entry = graph.entries[k]
            behind = entry[1]
            if has(scene.seen_cells, scene.rows[source], behind) and side_of(graph, entry, eye) >= 0:
                seen = on_screen(graph, entry[0], entry[2], eye, axes, eyes.frame, scene.slack, base, planes, work)
                for i in range(2):
                    seen[i] = wp.max(seen[i], work[rectangles + 4 * cell + i])
                    seen[i + 2] = wp.min(seen[i + 2], work[rectangles + 4 * cell + i + 2])
                if seen[0] <= seen[2] and seen[1] <= seen[3] and grow(work, rectangles + 4 * behind, seen):
                    if queue[ring + cells + behind] == 0:
                        queue[ring + cells + behind] = 1
                        queue[ring + (head + waiting) % cells] = behind
                        waiting += 1


@wp.kernel
def screen_rectangles(
    graph: DeviceGraph,
    scene: EyeScene,
    eyes: Eyes,
    first: int,
    last: int,
    slots: int,
    work: wp.array[f64],
    queue: wp.array[int],
    marks_out: Marks,
):
    """Marks of each eye by rectangles; no cell that holds one may have sets alone."""
    slot = wp.tid()
    row = first + slot
    cells = graph.cell_lo.shape[0]
    while row < last:
        view = eyes.views[row]
        base = slot * (RECTANGLES + 4 * cells)
        for k in range(eyes.holders[row], eyes.holders[row + 1]):
            source = eyes.holders[k]
            planes = screen_cone(work, base, axes_of(view), eyes.frame)
            flood_screen(graph, scene, eyes, row, source, base, slot * 2 * cells, planes, work, queue)
            for cell in range(cells):
                at = base + RECTANGLES + 4 * cell
                if work[at] <= work[at + 2] and work[at + 1] <= work[at + 3]:
                    rectangle = wp.vec4d(work[at], work[at + 1], work[at + 2], work[at + 3])
                    screen_cone(work, base, axes_of(view), rectangle)
                    mark_contents(graph, scene, eye_of(view), row, source, cell, base, planes, work, marks_out)
        row += slots


def rectangles_scratch(cells: int) -> Scratch:
    """What a slot of `screen_rectangles` needs: rectangles, the cells that wait, and whether each does."""
    return Scratch(values=RECTANGLES + 4 * cells, integers=2 * cells)
