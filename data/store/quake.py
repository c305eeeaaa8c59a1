"""Compiled Quake maps: the leaves and portals of a .prt file, the potentially visible sets of a .bsp, and back.

A *leaf* is a convex cell, a *winding* the polygon of a portal between two leaves. Formats: the PRT1 text that the map
compilers write for their visibility stage, and the binary spaces of versions 29, 30, BSP2 and 2PSB. Coordinates are the
map's own units; in a cell graph 1 unit is UNIT_STEPS grid steps.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..graph import OTHER_AXES, CellGraph
from ..ragged import starts_of
from ..scene import GRID_LIMIT
from .graph_folder import check_graph

UNIT_STEPS = 32
# Leaf boxes in a .bsp are rounded to whole units, and some compilers widen them by one.
BOX_SLACK = 2.0
VISIBILITY, LEAVES, MODELS = 4, 10, 14
LUMPS = 15
# Bytes of a leaf, and how its box is stored, by version.
LAYOUTS = {
    struct.pack("<i", 29): (28, "<6h"),
    struct.pack("<i", 30): (28, "<6h"),
    b"BSP2": (44, "<6f"),
    b"2PSB": (32, "<6h"),
}
MODEL_BYTES, MODEL_VISLEAFS = 64, 52


@dataclass(frozen=True)
class LeafPortals:
    """Leaves joined by polygons.

    Attributes:
        leaf_count: number of leaves; those without a portal stand alone.
        leaves: the two leaves of each portal, shape (portals, 2), int32.
        starts: corners of portal p are corners[starts[p]:starts[p + 1]], shape (portals + 1,), int64.
        corners: [map units], shape (n, 3), float64.
    """

    leaf_count: int
    leaves: np.ndarray
    starts: np.ndarray
    corners: np.ndarray


@dataclass(frozen=True)
class CompiledSets:
    """What a .bsp says of its leaves.

    Attributes:
        boxes: of each leaf [map units], shape (leaves, 2, 3), float64, rounded outwards by the compiler.
        potential: shape (leaves, leaves), bool, each leaf in its own set; rows of leaves without a set are full.
        without: leaves that have no set, from which everything counts as visible.
    """

    boxes: np.ndarray
    potential: np.ndarray
    without: int


def read_prt(path: str | Path) -> LeafPortals:
    """The leaves and portals of a PRT1 file.

    Raises:
        InputError: it is missing, truncated, of another kind (detail brushes make PRT2), or names leaves that are not
            there.
    """
    path = Path(path)
    lines = _text(path).split("\n")
    if lines[0].strip() != "PRT1":
        raise InputError(f"{path}: expected the first line PRT1, found {lines[0].strip()[:20]!r}")
    counts = [_count(lines, row, path) for row in (1, 2)]
    portals = [line for line in lines[3:] if line.strip()]
    if len(portals) != counts[1]:
        raise InputError(f"{path}: expected {counts[1]:,} portals, found {len(portals):,}")
    leaves, sizes, corners = np.zeros((counts[1], 2), np.int32), np.zeros(counts[1], np.int64), []
    for row, line in enumerate(portals):
        head, _, tail = line.partition("(")
        try:
            size, a, b = (int(word) for word in head.split())
            values = [float(word) for word in tail.replace("(", " ").replace(")", " ").split()]
        except ValueError:
            raise InputError(f"{path}, line {row + 4}: expected a portal, found {line.strip()[:40]!r}") from None
        if size < 3 or len(values) != 3 * size or not np.isfinite(values).all():
            found = f"{len(values) / 3:g} corners of {size}"
            raise InputError(f"{path}, line {row + 4}: expected at least 3 corners, each of 3 numbers, found {found}")
        if not (0 <= a < counts[0] and 0 <= b < counts[0] and a != b):
            where = f"{path}, line {row + 4}"
            raise InputError(f"{where}: expected two leaves from 0 to {counts[0] - 1}, found {a} and {b}")
        leaves[row], sizes[row] = (a, b), size
        corners += values
    starts = starts_of(sizes)
    return LeafPortals(counts[0], leaves, starts, np.array(corners, np.float64).reshape(-1, 3))


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii")
    except OSError as error:
        raise InputError(f"{path}: expected a readable file, found {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: expected a PRT1 text file, found binary data") from None


def _count(lines: list[str], row: int, path: Path) -> int:
    """A count in a line of its own."""
    text = lines[row].strip() if row < len(lines) else "the end of the file"
    if not text.isdigit() or (row == 1 and int(text) == 0):
        what = "leaves" if row == 1 else "portals"
        raise InputError(f"{path}, line {row + 1}: expected the number of {what}, found {text[:20]!r}")
    return int(text)


def write_prt(graph: CellGraph, path: str | Path) -> None:
    """Write a cell graph as PRT1, cells as leaves in their order, 1 unit = UNIT_STEPS grid steps.

    Windings run so that by the right-hand rule they face the first of their leaves, as the compilers write them.
    """
    lines = ["PRT1", str(graph.cell_count), str(graph.portal_count)]
    for (low, high), axis, box in zip(graph.portal_cells, graph.portal_axis, graph.portals, strict=True):
        u, v = OTHER_AXES[axis]
        corners = np.repeat(box[:1].astype(np.float64) / UNIT_STEPS, 4, axis=0)
        # From u to v is a right turn about the y axis.
        order = ((0, 0), (1, 0), (1, 1), (0, 1)) if axis == 1 else ((0, 0), (0, 1), (1, 1), (1, 0))
        for corner, (i, j) in zip(corners, order, strict=True):
            corner[u], corner[v] = box[i, u] / UNIT_STEPS, box[j, v] / UNIT_STEPS
        points = " ".join("(" + " ".join(f"{c:.17g}" for c in corner) + " )" for corner in corners)
        lines.append(f"4 {low} {high} {points}")
    Path(path).write_text("\n".join(lines) + "\n", encoding="ascii")


def is_axial(portals: LeafPortals) -> bool:
    """Whether every winding, on the grid, fills an axial rectangle."""
    return bool(_rectangles(portals)[1].all())


def _rectangles(portals: LeafPortals) -> tuple[np.ndarray, np.ndarray]:
    """Box of each winding [grid steps], shape (portals, 2, 3), and whether the winding fills it as a rectangle."""
    steps = np.round(portals.corners * UNIT_STEPS)
    boxes = np.empty((len(portals.leaves), 2, 3), np.int64)
    axial = np.zeros(len(boxes), bool)
    for row in range(len(boxes)):
        corners = steps[portals.starts[row] : portals.starts[row + 1]]
        boxes[row] = corners.min(axis=0), corners.max(axis=0)
        size = boxes[row, 1] - boxes[row, 0]
        flat = np.flatnonzero(size == 0)
        if len(flat) >= 1:
            u, v = OTHER_AXES[flat[0]]
            x, y = (corners[:, (u, v)] - corners[0, (u, v)]).T
            twice = abs(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()))
            axial[row] = len(flat) > 1 or twice == 2 * size[u] * size[v]
    return boxes, axial


def axial_graph(portals: LeafPortals, where: str) -> CellGraph:
    """The cell graph of an axial map: each leaf the least box about its windings.

    Lines through windings do not depend on how far a leaf reaches beyond them. A leaf all of whose windings lie in one
    plane gets a thickness of one grid step; one without windings stands apart from the map. Windings without area on
    the grid are left out.

    Raises:
        InputError: a winding is no axial rectangle, the map is too large for the grid, or leaves overlap.
    """
    boxes, axial = _rectangles(portals)
    if not axial.all():
        raise InputError(f"{where}: expected axial windings, found portal {int((~axial).argmax())} oblique")
    if len(boxes) and np.abs(boxes).max() > GRID_LIMIT - UNIT_STEPS * (portals.leaf_count + 2):
        raise InputError(f"{where}: expected coordinates within {GRID_LIMIT // UNIT_STEPS:,} units, found larger ones")
    keep = ((boxes[:, 1] > boxes[:, 0]).sum(axis=1)) == 2
    boxes, ends = boxes[keep], portals.leaves[keep].astype(np.int64)
    axis = (boxes[:, 1] > boxes[:, 0]).argmin(axis=1)
    cells = np.empty((portals.leaf_count, 2, 3), np.int64)
    cells[:, 0], cells[:, 1] = GRID_LIMIT, -GRID_LIMIT
    for side in (0, 1):
        np.minimum.at(cells[:, 0], ends[:, side], boxes[:, 0])
        np.maximum.at(cells[:, 1], ends[:, side], boxes[:, 1])
    _stand_apart(cells, int(boxes.max(initial=0)))
    low = _low_sides(cells, ends, axis, boxes)
    ends = np.where(low[:, None], ends, ends[:, ::-1])
    for (a, b), along, box in zip(ends, axis, boxes, strict=True):
        for cell, side in ((a, 0), (b, 1)):
            if cells[cell, 0, along] == cells[cell, 1, along]:
                cells[cell, side, along] = box[0, along] + (1 if side else -1)
    count = portals.leaf_count
    names = np.full(count, "", object)
    graph = CellGraph(
        cells.astype(np.int32), np.ones(count, bool), names, ends.astype(np.int32), axis.astype(np.int8),
        boxes.astype(np.int32),
    )  # fmt: skip
    check_graph(graph, where)
    return graph


def _stand_apart(cells: np.ndarray, beyond: int) -> None:
    """Give leaves without windings boxes of one unit, in a row beyond the map."""
    alone = np.flatnonzero((cells[:, 1] < cells[:, 0]).any(axis=1))
    for place, cell in enumerate(alone):
        cells[cell, 0] = beyond + UNIT_STEPS * (place + 1)
        cells[cell, 1] = cells[cell, 0] + UNIT_STEPS // 2


def _low_sides(cells: np.ndarray, ends: np.ndarray, axis: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Whether the first leaf of each portal is on its low side, shape (portals,), bool.

    Told by where the leaves' boxes reach; where both are flat, either answer is right.
    """
    row = np.arange(len(axis))
    plane = boxes[row, 0, axis]
    reach = [cells[ends[:, side], :, axis].sum(axis=1) - 2 * plane for side in (0, 1)]
    return reach[0] < reach[1]


def read_bsp(path: str | Path) -> CompiledSets:
    """The leaf boxes and run-length coded sets of a compiled map.

    Raises:
        InputError: it is missing, truncated, of an unknown version, or holds no sets.
    """
    path = Path(path)
    data = compiled_map(path)
    leaf_bytes, box_format = LAYOUTS[data[:4]]
    leaves, visibility, models = (lump(data, number, path) for number in (LEAVES, VISIBILITY, MODELS))
    if len(models) < MODEL_BYTES or len(leaves) < leaf_bytes:
        raise InputError(f"{path}: expected leaves and a model, found {len(leaves)} and {len(models)} bytes of them")
    count = struct.unpack_from("<i", models, MODEL_VISLEAFS)[0]
    if not 0 < count < len(leaves) // leaf_bytes:
        raise InputError(f"{path}: expected at most {len(leaves) // leaf_bytes - 1} visible leaves, found {count}")
    if not len(visibility):
        raise InputError(f"{path}: expected potentially visible sets, found none (a map that was not run through vis)")
    boxes, potential, without = np.empty((count, 2, 3)), np.zeros((count, count), bool), 0
    for leaf in range(count):
        # Leaf 0 is all that is solid.
        place = (leaf + 1) * leaf_bytes
        offset = struct.unpack_from("<i", leaves, place + 4)[0]
        boxes[leaf] = np.reshape(struct.unpack_from(box_format, leaves, place + 8), (2, 3))
        if offset < 0:
            potential[leaf], without = True, without + 1
        else:
            potential[leaf] = _decoded(visibility, offset, count, f"{path}, leaf {leaf + 1}")
    np.fill_diagonal(potential, True)
    return CompiledSets(boxes, potential, without)


def compiled_map(path: Path) -> bytes:
    """All of a compiled map.

    Raises:
        InputError: it cannot be read, or is of an unknown version.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: expected a readable file, found {error.strerror}") from None
    if data[:4] not in LAYOUTS:
        raise InputError(f"{path}: expected a .bsp of version 29, 30, BSP2 or 2PSB, found {data[:4]!r}")
    return data


def lump(data: bytes, number: int, path: Path) -> bytes:
    """A part of a compiled map, by its place in the directory.

    Raises:
        InputError: it reaches past the end of the file.
    """
    if len(data) < 4 + 8 * LUMPS:
        raise InputError(f"{path}: expected a directory of {LUMPS} parts, found the end of the file")
    offset, size = struct.unpack_from("<2i", data, 4 + 8 * number)
    if offset < 0 or size < 0 or offset + size > len(data):
        raise InputError(f"{path}: expected {size:,} bytes at {offset:,}, found the end of the file at {len(data):,}")
    return data[offset : offset + size]


def _decoded(visibility: bytes, offset: int, count: int, where: str) -> np.ndarray:
    """A run-length coded row: a zero byte is followed by how many there are."""
    wanted, row = (count + 7) // 8, bytearray()
    while len(row) < wanted:
        if offset >= len(visibility):
            raise InputError(f"{where}: expected {wanted} bytes of a set, found its end after {len(row)}")
        if visibility[offset]:
            row.append(visibility[offset])
            offset += 1
            continue
        run = visibility[offset + 1] if offset + 1 < len(visibility) else 0
        if not run:
            raise InputError(f"{where}: expected a run of zeros, found none after {len(row)} bytes")
        row += bytes(run)
        offset += 2
    return np.unpackbits(np.frombuffer(bytes(row[:wanted]), np.uint8), bitorder="little")[:count].astype(bool)


def check_belongs(portals: LeafPortals, sets: CompiledSets, where: str) -> None:
    """Raise unless the windings lie in the boxes of their leaves.

    Raises:
        InputError: the two files are of different maps.
    """
    if portals.leaf_count != len(sets.boxes):
        raise InputError(f"{where}: expected {len(sets.boxes):,} leaves as in the .bsp, found {portals.leaf_count:,}")
    owner = np.repeat(np.arange(len(portals.leaves)), np.diff(portals.starts))
    for side in (0, 1):
        box = sets.boxes[portals.leaves[owner, side]]
        off = (portals.corners < box[:, 0] - BOX_SLACK) | (portals.corners > box[:, 1] + BOX_SLACK)
        if off.any():
            row = int(owner[off.any(axis=1).argmax()])
            leaf = int(portals.leaves[row, side])
            found = f"portal {row} outside leaf {leaf}"
            raise InputError(f"{where}: expected portals of the map in the .bsp, found {found}")
