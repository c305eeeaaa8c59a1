"""What an eye may see: cells reached through portals, and objects in them, for many frames at a time.

The wedge: depth-first through the portals that rays from the eye leave a cell by, each narrowing a cone of directions.
Past 2,000 portals, or 64 in a row, the frame starts over with rectangles of the screen (kernels/eye_screen.py).

Source: Funkhouser et al. 1996, section 4.2.1 (eye-to-cell and eye-to-object visibility).
"""

import threading
from dataclasses import dataclass, field

import numpy as np
import warp as wp

from ..data.camera import CameraPath, Screen
from ..data.contents import cells_holding, contents
from ..data.errors import InputError
from ..data.graph import CellGraph
from ..data.ragged import starts_of
from .cone import CONE_SIZE, POLYGON_SIZE, narrow_cone, screen_cone, side_of
from .eye_marks import Eyes, EyeScene, Marks, axes_of, eye_of, has, mark, mark_contents, mark_set
from .eye_screen import rectangles_scratch, screen_rectangles
from .graph import DeviceGraph, device_graph
from .launch import CPU, Device, Scratch, check_stopped, launch_slots, load_kernels

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

f64 = wp.float64

# Portals in a row, and portals passed for one eye, before the wedge is given up.
MAX_DEPTH = wp.constant(64)
MAX_SEQUENCES = 2000
# Integers of a level: cell, next entry of its adjacency, planes.
FRAME = wp.constant(3)
# Values of a slot: cones of all levels, then two polygons.
SPARE = wp.constant((MAX_DEPTH + 1) * CONE_SIZE)
VALUES = wp.constant(SPARE + 2 * POLYGON_SIZE)
INTEGERS = wp.constant((MAX_DEPTH + 1) * FRAME)
# Tests are loosened by so much [m].
SLACK_M = 1.0e-7
# Words of marks, 4 bytes each, that one launch may write, and values of scratch that it may take on a GPU.
WORDS, ROOM = 2**25, 2**28


@wp.func
def on_stack(frames: wp.array[int], stack: int, depth: int, cell: int) -> bool:
    """Whether the sequence comes from a cell."""
    for k in range(depth + 1):
        if frames[stack + k * FRAME] == cell:
            return True
    return False


@wp.func
def search(
    graph: DeviceGraph, scene: EyeScene, eye: wp.vec3d, row: int, source: int, left: int, slot: int,
    planes: int, work: wp.array[f64], frames: wp.array[int], marks_out: Marks,
) -> int:  # fmt: skip
    """The wedge from one cell; how many portals it may still pass, or -1 if there were too many."""
    base = slot * VALUES
    stack = slot * INTEGERS
    room = int(left)
    depth = int(0)
    frames[stack] = source
    frames[stack + 1] = graph.starts[source]
    frames[stack + 2] = planes
    mark_contents(graph, scene, eye, row, source, source, base, planes, work, marks_out)
    while depth >= 0:
        at = stack + depth * FRAME
        cursor = frames[at + 1]
        if cursor == graph.starts[frames[at] + 1]:
            depth -= 1
        else:
            frames[at + 1] = cursor + 1
            entry = graph.entries[cursor]
            behind = entry[1]
            cone = base + depth * CONE_SIZE
            narrow = int(-1)
            if has(scene.seen_cells, scene.rows[source], behind):
                # Only rays along a portal's plane could come back.
                if side_of(graph, entry, eye) != 0 or not on_stack(frames, stack, depth, behind):
                    narrow = narrow_cone(
                        graph, entry, eye, scene.slack, work, cone, frames[at + 2], base + SPARE, cone + CONE_SIZE
                    )
            if narrow >= 0:
                room -= 1
                depth += 1
                if room < 0 or depth > MAX_DEPTH:
                    return -1
                frames[at + FRAME] = behind
                frames[at + FRAME + 1] = graph.starts[behind]
                frames[at + FRAME + 2] = narrow
                mark_contents(graph, scene, eye, row, source, behind, cone + CONE_SIZE, narrow, work, marks_out)
    return room


@wp.kernel
def _wedge(
    graph: DeviceGraph,
    scene: EyeScene,
    eyes: Eyes,
    first: int,
    last: int,
    slots: int,
    work: wp.array[f64],
    frames: wp.array[int],
    marks_out: Marks,
):
    slot = wp.tid()
    row = first + slot
    while row < last:
        eye = eye_of(eyes.views[row])
        base = slot * VALUES
        planes = screen_cone(work, base, axes_of(eyes.views[row]), eyes.frame)
        room = int(eyes.limit)
        if eyes.holders[row] == eyes.holders[row + 1]:
            mark_set(scene, eye, row, -1, base, planes, work, marks_out)
        for k in range(eyes.holders[row], eyes.holders[row + 1]):
            cell = eyes.holders[k]
            if cell >= scene.tiles:
                mark(marks_out.words, row, marks_out.cells + cell)
                mark_set(scene, eye, row, scene.rows[cell], base, planes, work, marks_out)
            elif room >= 0:
                room = search(graph, scene, eye, row, cell, room, slot, planes, work, frames, marks_out)
        marks_out.words[row, marks_out.passed] = eyes.limit - room
        if room < 0:
            marks_out.words[row, marks_out.passed] = -1
        row += slots


@dataclass
class _Prepared:
    """A launch for one eye on the CPU, and its arrays as NumPy sees them: to be filled, done again, and read."""

    launch: wp.Launch
    view: np.ndarray
    holders: np.ndarray
    words: np.ndarray


class _Kept(threading.local):
    """Prepared launches of a thread: arrays and structs that are made anew take longer than an eye does."""

    def __init__(self) -> None:
        self.launches: dict[tuple, _Prepared] = {}


@dataclass(frozen=True)
class EyeModel:
    """A model as eyes look into it; of `eye_model`.

    Attributes:
        graph: cells and portals.
        grid_m: grid step [m].
        objects: how many.
        scene: on a device.
        device_graph: likewise.
        device: that holds them.
        kept: launches for one eye, done again with other numbers.
    """

    graph: CellGraph
    grid_m: float
    objects: int
    scene: EyeScene
    device_graph: DeviceGraph
    device: Device
    kept: _Kept = field(default_factory=_Kept, repr=False, compare=False)


@dataclass(frozen=True)
class EyeAnswers:
    """What each of n eyes may see.

    Attributes:
        starts: objects of eye e are objects[starts[e]:starts[e + 1]], shape (n + 1,), int64.
        objects: ids, ascending, int32.
        cell_starts: the same of cells.
        cells: likewise.
        sequences: portals passed by the wedge, shape (n,), int32; -1 where it was given up for rectangles.
    """

    starts: np.ndarray
    objects: np.ndarray
    cell_starts: np.ndarray
    cells: np.ndarray
    sequences: np.ndarray


def eye_model(
    graph: CellGraph,
    boxes: np.ndarray,
    grid_m: float,
    potential: tuple[np.ndarray, np.ndarray] | None = None,
    device: Device = CPU,
) -> EyeModel:
    """Prepare a model for `launch_eye`.

    Args:
        graph: cells in grid steps; without portals only the sets say what is seen.
        boxes: of all objects [grid steps], shape (m, 2, 3), int; low above high for one that is nowhere.
        grid_m: grid step [m].
        potential: objects and cells that may be seen from anywhere in each inhabitable cell, shapes (cells, m) and
            (cells, cells), bool; rows of other cells are not looked at. None if nothing is known.
        device: where to.

    Raises:
        InputError: a shape that does not fit, or a coordinate beyond the grid.
    """
    count, cells = len(boxes), graph.cell_count
    rows, sets = np.full(cells, -1), (np.zeros((0, count), bool), np.zeros((0, cells), bool))
    if potential is not None:
        shapes, wanted = [part.shape for part in potential], [(cells, count), (cells, cells)]
        if shapes != wanted:
            raise InputError(f"potential: expected shapes {wanted}, found {shapes}")
        stands = np.flatnonzero(graph.inhabitable)
        rows[stands] = np.arange(len(stands))
        sets = tuple(part[stands] for part in potential)
    tiles = graph.tile_count if graph.portal_count else 0
    starts, objects = contents(graph.cells[:tiles], boxes)
    nowhere = (boxes[:, 0] > boxes[:, 1]).any(axis=1)
    scene = device.struct(
        EyeScene,
        starts=starts,
        objects=objects,
        box_lo=device.corners(np.where(nowhere[:, None], 1, boxes[:, 0])),
        box_hi=device.corners(np.where(nowhere[:, None], 0, boxes[:, 1])),
        tiles=tiles,
        rows=rows,
        seen_objects=_words(sets[0]),
        seen_cells=_words(sets[1]),
        slack=SLACK_M / grid_m,
    )
    return EyeModel(graph, grid_m, count, scene, device_graph(graph, device), device)


def launch_eye(model: EyeModel, path: CameraPath, screen: Screen, *, limit: int = MAX_SEQUENCES) -> EyeAnswers:
    """Objects and cells that the eye of each frame may see within its screen.

    Args:
        model: of `eye_model`; runs on its device.
        path: eyes [m] and directions of view.
        screen: its height, width and field of view bound what is seen; pixels do not.
        limit: portals passed for one eye before the wedge is given up for rectangles; 0 for rectangles at once.

    Returns:
        What may be seen. An object is left out only if no ray from the eye, within the screen and through portals,
        meets its box, or if the set of the eye's cell does not hold it. What is kept may be hidden: by other objects,
        or because boxes and cones are larger than what they stand for. An eye that no cell holds may see every object
        on its screen.

    Raises:
        InputError: an eye that is not finite.

    Source: Funkhouser et al. 1996, section 4.2.1.
    """
    points, counts = path.eyes / model.grid_m, (model.objects, model.graph.cell_count)
    if not np.isfinite(points).all():
        raise InputError("eyes: expected finite coordinates, found others")
    views = np.concatenate([path.axes(), points[:, None]], axis=1)
    half = np.array([screen.width, screen.height]) / 2 / screen.focal
    step, found = max(1, 32 * WORDS // max(1, sum(counts))), []
    for first in range(0, len(path), step):
        part = views[first : first + step]
        words = _looked(model, part, half, limit, _wedge, Scratch(VALUES, INTEGERS))
        over = np.flatnonzero(words[:, -1] < 0)
        if len(over):
            room = rectangles_scratch(model.graph.cell_count)
            words[over] = _looked(model, part[over], half, limit, screen_rectangles, room)
            words[over, -1] = -1
        found.append(words)
    own, all_words = _sizes(model)[0], sum(_sizes(model))
    return EyeAnswers(
        *_lists([words[:, :own] for words in found]),
        *_lists([words[:, own:all_words] for words in found]),
        np.concatenate([np.zeros(0, np.int32), *(words[:, -1] for words in found)]),
    )


def _sizes(model: EyeModel) -> list[int]:
    """Words for the marks of objects, and of cells."""
    return [max(1, -(-count // 32)) for count in (model.objects, model.graph.cell_count)]


def _looked(
    model: EyeModel, views: np.ndarray, half: np.ndarray, limit: int, kernel: wp.Kernel, scratch: Scratch
) -> np.ndarray:
    """Words of `Marks` that a kernel leaves for each view."""
    device, (own, others) = model.device, _sizes(model)
    starts, cells = cells_holding(model.graph, views[:, 3])
    holders = np.concatenate([starts + len(starts), cells])
    if len(views) == 1 and device.is_cpu:
        return _looked_once(model, views, holders, half, limit, kernel, scratch)
    eyes = device.struct(Eyes, views=views, frame=wp.vec4d(*-half, *half), holders=holders, limit=limit)
    marks = device.struct(Marks, words=(len(views), own + others + 1), cells=32 * own, passed=own + others)
    inputs, most = [model.device_graph, model.scene, eyes], max(1, ROOM // scratch.values)
    launch_slots(kernel, len(views), inputs, scratch, [marks], device, gpu_chunk=most)
    return marks.words.numpy()


def _looked_once(
    model: EyeModel,
    view: np.ndarray,
    holders: np.ndarray,
    half: np.ndarray,
    limit: int,
    kernel: wp.Kernel,
    scratch: Scratch,
) -> np.ndarray:
    """The same for one view on the CPU, by a launch that is kept."""
    check_stopped()
    key = kernel.key, *half.tolist(), limit
    kept = model.kept.launches.get(key)
    if kept is None or len(kept.holders) < len(holders):
        kept = _prepare(model, len(holders), half, limit, kernel, scratch)
        model.kept.launches[key] = kept
    kept.view[:], kept.holders[: len(holders)], kept.words[:] = view, holders, 0
    kept.launch.launch()
    return kept.words.copy()


def _prepare(
    model: EyeModel, room: int, half: np.ndarray, limit: int, kernel: wp.Kernel, scratch: Scratch
) -> _Prepared:
    """A launch with room for so many holders; its scratch is written before it is read, as by one row after another."""
    device, (own, others) = model.device, _sizes(model)
    load_kernels(kernel.module, device)
    frame = wp.vec4d(*-half, *half)
    eyes = device.struct(Eyes, views=np.zeros((1, 4, 3)), frame=frame, holders=np.zeros(room, int), limit=limit)
    marks = device.struct(Marks, words=(1, own + others + 1), cells=32 * own, passed=own + others)
    inputs = [model.device_graph, model.scene, eyes, 0, 1, 1, *scratch.arrays(1, device)]
    launch = wp.launch(kernel, 1, inputs=inputs, outputs=[marks], device=device.name, record_cmd=True)
    return _Prepared(launch, eyes.views.numpy(), eyes.holders.numpy(), marks.words.numpy())


def _lists(words: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Starts and numbers of the bits that are set in each row."""
    sizes, numbers = [np.zeros(0, np.int64)], [np.zeros(0, np.int32)]
    for part in words:
        if len(part) == 1:
            # Of one eye all bits together, in fewer calls.
            own = np.flatnonzero(np.unpackbits(part.astype("<i4").view(np.uint8), bitorder="little"))
            sizes.append(np.array([len(own)]))
            numbers.append(own.astype(np.int32))
            continue
        row, word = np.nonzero(part)
        bits = np.unpackbits(part[row, word].astype("<i4").view(np.uint8).reshape(-1, 4), axis=1, bitorder="little")
        place, bit = np.nonzero(bits)
        sizes.append(np.bincount(row[place], minlength=len(part)))
        numbers.append((32 * word[place] + bit).astype(np.int32))
    return starts_of(np.concatenate(sizes)), np.concatenate(numbers)


def _words(bits: np.ndarray) -> np.ndarray:
    """Rows of bits as words of 32 of them, shape (rows, words), int32; at least one word."""
    rows, count = bits.shape
    padded = np.zeros((rows, 32 * max(1, -(-count // 32))), bool)
    padded[:, :count] = bits
    return np.packbits(padded, axis=1, bitorder="little").view("<i4").astype(np.int32)
