"""What eyes look at and what they see: scene, cameras, and marks, as bits of words."""

import warp as wp

from .cone import misses_box
from .graph import DeviceGraph

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64


View = wp.types.matrix(shape=(4, 3), dtype=wp.float64)


@wp.struct
class EyeScene:
    """What there is to be seen, in grid steps.

    Objects of cell c are objects[starts[c]:starts[c + 1]]. Cells from `tiles` on have none, nor portals; from there
    the sets alone say what is seen. Row rows[c] of the sets, bits in words of 32, is what cell c may see; -1: anything.
    """

    starts: wp.array[int]
    objects: wp.array[int]
    box_lo: wp.array[wp.vec3i]
    box_hi: wp.array[wp.vec3i]
    tiles: int
    rows: wp.array[int]
    seen_objects: wp.array2d[int]
    seen_cells: wp.array2d[int]
    slack: f64


@wp.struct
class Eyes:
    """Cameras, the cells that hold them, and how many portals may be passed for one.

    A view has the rows right, up, forward and the eye [grid steps]; the frame is the screen at distance 1 as (low x,
    low y, high x, high y). The cells of eye e are holders[holders[e]:holders[e + 1]].
    """

    views: wp.array[View]
    frame: wp.vec4d
    holders: wp.array[int]
    limit: int


@wp.struct
class Marks:
    """What each eye sees, a row of words of 32 bits: objects, from bit `cells` on cells.

    Word `passed` is how many portals were passed for it, -1 for too many. All in one array, for an array that is made
    costs as much as an eye.
    """

    words: wp.array2d[int]
    cells: int
    passed: int


@wp.func
def has(bits: wp.array2d[int], row: int, number: int) -> bool:
    """Whether a bit is set; every one is in row -1."""
    if row < 0:
        return True
    return ((bits[row, number >> 5] >> (number & 31)) & 1) == 1


@wp.func
def mark(bits: wp.array2d[int], row: int, number: int):
    """Set a bit."""
    bits[row, number >> 5] = bits[row, number >> 5] | (1 << (number & 31))


@wp.func
def eye_of(view: View) -> wp.vec3d:
    """Where the eye is."""
    return wp.vec3d(view[3, 0], view[3, 1], view[3, 2])


@wp.func
def axes_of(view: View) -> wp.mat33d:
    """Right, up and forward."""
    out = wp.mat33d()
    for i in range(3):
        for j in range(3):
            out[i, j] = view[i, j]
    return out


@wp.func
def mark_object(
    scene: EyeScene, row: int, number: int, lo: wp.vec3d, hi: wp.vec3d, cone: int, planes: int, work: wp.array[f64],
    marks_out: Marks,
):  # fmt: skip
    """Mark an object of which a cone may hold something."""
    if lo[0] <= hi[0] and lo[1] <= hi[1] and lo[2] <= hi[2]:
        if not misses_box(work, cone, planes, lo, hi, scene.slack):
            mark(marks_out.words, row, number)


@wp.func
def mark_contents(
    graph: DeviceGraph, scene: EyeScene, eye: wp.vec3d, row: int, source: int, cell: int, cone: int, planes: int,
    work: wp.array[f64], marks_out: Marks,
):  # fmt: skip
    """Mark the objects that a cone may meet in a cell."""
    mark(marks_out.words, row, marks_out.cells + cell)
    cell_lo = graph.cell_lo[cell]
    cell_hi = graph.cell_hi[cell]
    for k in range(scene.starts[cell], scene.starts[cell + 1]):
        number = scene.objects[k]
        if not has(marks_out.words, row, number) and has(scene.seen_objects, scene.rows[source], number):
            lo = wp.vec3d()
            hi = wp.vec3d()
            for i in range(3):
                lo[i] = f64(wp.max(cell_lo[i], scene.box_lo[number][i])) - eye[i]
                hi[i] = f64(wp.min(cell_hi[i], scene.box_hi[number][i])) - eye[i]
            mark_object(scene, row, number, lo, hi, cone, planes, work, marks_out)


@wp.func
def mark_set(
    scene: EyeScene, eye: wp.vec3d, row: int, set_row: int, cone: int, planes: int, work: wp.array[f64],
    marks_out: Marks,
):  # fmt: skip
    """Mark the objects of a set that a cone may meet anywhere."""
    for number in range(scene.box_lo.shape[0]):
        if has(scene.seen_objects, set_row, number):
            lo = wp.vec3d()
            hi = wp.vec3d()
            for i in range(3):
                lo[i] = f64(scene.box_lo[number][i]) - eye[i]
                hi[i] = f64(scene.box_hi[number][i]) - eye[i]
            mark_object(scene, row, number, lo, hi, cone, planes, work, marks_out)
