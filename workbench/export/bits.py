"""Sets as a bit matrix behind a head that C reads without a parser; `viewcell_bits.h` beside it does so."""

import struct
from importlib.resources import files

import numpy as np

from ...data.store.bake_folder import BakeFolder
from .sets import view_sets

MAGIC, FORMAT = b"VIEWCELL", 1
HEADER = "viewcell_bits.h"
# As the C header has it, little-endian: 88 bytes, so that doubles stay where a compiler wants them.
CELL = np.dtype([("plan", "<f8", (4, 2)), ("bottom", "<f8"), ("top", "<f8"), ("cell_id", "<i4"), ("zero", "<i4")])


def sets_as_bits(bake: BakeFolder) -> bytes:
    """A head of 24 bytes, 88 bytes for each view cell, and for each a row of bits: 1 where an object may be visible.

    The head is the magic word, then format, view cells, objects and bytes of a row, uint32 each. Object o is bit o % 8
    of byte o // 8 of its row; rows are padded to 8 bytes. Everything is little-endian.

    Raises:
        InputError: the bake is of a bare cell graph.
    """
    sets = view_sets(bake)
    stride = -(-sets.object_count // 64) * 8
    cells = np.zeros(len(sets.cells), CELL)
    cells["plan"], cells["cell_id"] = sets.plans, sets.cells
    cells["bottom"], cells["top"] = sets.heights.T
    bits = np.zeros((len(cells), stride), np.uint8)
    row = np.zeros(stride * 8, bool)
    for number in range(len(cells)):
        row[:] = False
        row[sets.of(number)] = True
        bits[number] = np.packbits(row, bitorder="little")
    head = struct.pack("<8s4I", MAGIC, FORMAT, len(cells), sets.object_count, stride)
    return head + cells.tobytes() + bits.tobytes()


def c_header() -> bytes:
    """The C header that reads the file."""
    return files(__package__).joinpath(HEADER).read_bytes()
