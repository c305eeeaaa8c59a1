"""Finished work of a bake as one Arrow file per block: named arrays, each a row of its table.

| column | |
|---|---|
| name | of the array |
| dtype | as NumPy writes it, little-endian |
| shape | list<int64> |
| values | binary: the array's bytes in C order |
"""

import os
from pathlib import Path

import numpy as np
import pyarrow as pa

SCHEMA = pa.schema(
    [("name", pa.string()), ("dtype", pa.string()), ("shape", pa.list_(pa.int64())), ("values", pa.large_binary())]
)


def write_block(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write arrays; they appear whole or not at all."""
    rows = [(name, np.ascontiguousarray(array)) for name, array in arrays.items()]
    columns = [[name for name, _ in rows], [array.dtype.str for _, array in rows]]
    columns += [[list(array.shape) for _, array in rows], [array.tobytes() for _, array in rows]]
    temporary = path.with_name(f"{path.name}.writing")
    with pa.OSFile(str(temporary), "wb") as sink, pa.ipc.new_file(sink, SCHEMA) as writer:
        writer.write_table(pa.table(columns, schema=SCHEMA))
    os.replace(temporary, path)


def read_block(path: Path) -> dict[str, np.ndarray] | None:
    """The arrays of a block; None if it is missing or damaged, and has to be made again."""
    try:
        with pa.OSFile(str(path), "rb") as source:
            rows = pa.ipc.open_file(source).read_all().to_pylist()
        return {row["name"]: np.frombuffer(row["values"], row["dtype"]).reshape(row["shape"]).copy() for row in rows}
    except (OSError, pa.ArrowException, ValueError, TypeError, KeyError):
        return None
