"""A bare cell graph of four rooms on disk, and what tests of the command line ask of folders."""

import hashlib

import pyarrow as pa
import pyarrow.parquet as pq

# Three rooms in a row and one round the corner, which the first does not see.
CELLS = [[0, 0, 0, 4, 4, 3], [4, 0, 0, 8, 4, 3], [8, 0, 0, 12, 4, 3], [8, 4, 0, 12, 8, 3]]
PORTALS = [(0, 1, 0, 4, 1, 1.25, 0, 2), (1, 2, 0, 8, 1, 1.25, 0, 2), (2, 3, 1, 4, 11.5, 12, 0, 2)]


def write_graph(folder, cells=CELLS, portals=PORTALS, cell_ids=None, drop=""):
    """A folder with cells.parquet and portals.parquet [m]."""
    folder.mkdir(parents=True, exist_ok=True)
    names = ("min_x", "min_y", "min_z", "max_x", "max_y", "max_z")
    columns = {"cell_id": list(range(len(cells))) if cell_ids is None else cell_ids}
    columns |= {name: [cell[i] for cell in cells] for i, name in enumerate(names)}
    names = ("cell_a", "cell_b", "axis", "coordinate", "min_u", "max_u", "min_v", "max_v")
    more = {"portal_id": list(range(len(portals)))} | {n: [p[i] for p in portals] for i, n in enumerate(names)}
    for name, table in (("cells", columns), ("portals", more)):
        pq.write_table(pa.table({k: v for k, v in table.items() if k != drop}), folder / f"{name}.parquet")
    return folder


def hashes(folder):
    """Digest of each file in a folder."""
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.iterdir())}
