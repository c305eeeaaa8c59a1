"""The order of objects in which sets of them are few runs: they come together on disk, and are coded in fewer bytes.

Objects are the columns of a matrix whose rows are the sets. Equal columns are one city, and a column of zeros is one
more: the tour is cut there, so that the sets have half as many runs as the closed tour is long, exactly. Source:
Chhugani et al. 2005, section 6.1, who sample neighbours of each column; here they are exact.
"""

import numpy as np

from ..data.ragged import owners_of
from ..data.runs import find_runs
from ..kernels.launch import CPU, Device
from ..kernels.tour import launch_near_columns, launch_tour

# Near columns of each that steps to a shorter tour are tried with.
NEAR = 12
# With more cities than this, all pairs are too many to look for the nearest one left: then more near ones are kept,
# and the tour goes on along a curve through space where all of them are taken.
MOST_CITIES, NEAR_OF_MANY = 20_000, 32
# Steps along each axis of the curve: 2 ** 10.
CURVE_BITS = 10


def tour_order(
    starts: np.ndarray, members: np.ndarray, places: np.ndarray, device: Device = CPU, most: int = MOST_CITIES
) -> np.ndarray:
    """Objects in an order in which sets of them are few runs.

    Args:
        starts: set s is members[starts[s]:starts[s + 1]], shape (sets + 1,), int.
        members: objects in the sets, each once in a set, int.
        places: a point of each object, in any unit: where to go on when there are very many, shape (objects, 3).
        device: where kernels run. The answer does not depend on it.
        most: cities up to which all pairs are looked at.

    Returns:
        Objects, each once, shape (objects,), int64; those in no set come last, and of objects in the same sets the
        lower number first.
    """
    city, columns = distinct_columns(starts, members, len(places))
    if columns.shape[1] < 2:
        return np.argsort(city == 0, kind="stable")
    many = columns.shape[1] > most
    near = launch_near_columns(columns, NEAR_OF_MANY if many else NEAR, device)
    jumps = np.zeros(0, int)
    if many:
        # The first object of each city speaks for it; that of zeros, which may have none, comes first.
        first = np.unique(city, return_index=True)[1][int((city == 0).any()) :]
        jumps = np.append(0, 1 + np.argsort(curve_places(places[first]), kind="stable"))
    tour = launch_tour(columns, near[:, : NEAR_OF_MANY if many else NEAR], jumps, device)
    rank = np.empty(len(tour), np.int64)
    # The tour begins with the zeros, which go to the end.
    rank[tour] = np.arange(len(tour)) - 1
    rank[0] = len(tour)
    return np.argsort(rank[city], kind="stable")


def distinct_columns(starts: np.ndarray, members: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The different columns of a matrix of sets.

    Returns:
        Column of each object, shape (count,), int64; and the columns, the first all zeros whether or not an object has
        it, shape (sets, columns), bool.
    """
    bits = np.zeros((len(starts) - 1, count + 1), bool)
    bits[owners_of(starts), np.asarray(members) + 1] = True
    keys = np.ascontiguousarray(np.packbits(bits, axis=0).T)
    if not keys.shape[1]:
        return np.zeros(count, np.int64), bits[:, :1]
    # Bytes in order are columns in order: the zeros come first.
    _, first, city = np.unique(keys.view(f"V{keys.shape[1]}").ravel(), return_index=True, return_inverse=True)
    return city.reshape(-1)[1:].astype(np.int64), bits[:, first]


def count_runs(starts: np.ndarray, members: np.ndarray, order: np.ndarray) -> int:
    """Runs of ones over all sets, where objects stand in an order."""
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    owner, there = owners_of(starts), rank[members]
    return len(find_runs(starts, there[np.lexsort((there, owner))]).first)


def curve_places(points: np.ndarray) -> np.ndarray:
    """How far along a Hilbert curve through their box points lie, shape (n,), int64. Source: Skilling 2004."""
    low, high = points.min(axis=0), points.max(axis=0)
    steps = (2**CURVE_BITS - 1) * (points - low) / np.where(high > low, high - low, 1)
    x = steps.astype(np.int64).T.copy()
    bit = 1 << (CURVE_BITS - 1)
    while bit > 1:
        for axis in range(3):
            set_here = (x[axis] & bit) > 0
            swap = np.where(set_here, 0, (x[0] ^ x[axis]) & (bit - 1))
            x[0] ^= np.where(set_here, bit - 1, swap)
            x[axis] ^= swap
        bit >>= 1
    x[1] ^= x[0]
    x[2] ^= x[1]
    turned = np.zeros_like(x[0])
    bit = 1 << (CURVE_BITS - 1)
    while bit > 1:
        turned ^= np.where((x[2] & bit) > 0, bit - 1, 0)
        bit >>= 1
    x ^= turned
    out = np.zeros(len(points), np.int64)
    for k in reversed(range(CURVE_BITS)):
        for axis in range(3):
            out = out << 1 | x[axis] >> k & 1
    return out
