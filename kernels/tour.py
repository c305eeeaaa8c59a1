"""An order of columns of bits in which neighbours differ little: a short closed tour under the Hamming distance.

Put in the order of a tour that is cut open at a column of zeros, the rows of the matrix have half as many runs of ones
as the tour is long: each run begins and ends with one difference. The tour goes from each city to the nearest one that
is left, and is then improved, edge by edge of lists of near cities, by 2-opt (two edges are exchanged) and Or-opt (up
to three cities are put elsewhere, either way round), until no such step is left. Cities wait in a queue and leave it
when nothing about them improves ("don't-look bits").

Sources: Chhugani et al. 2005, section 6.1, for the question; Bentley 1992, "Fast algorithms for geometric traveling
salesman problems", and Or 1976 for the steps. Distances are exact, ties go to the lower number: the tour is the same
everywhere. Columns are words of 63 bits, so that signed arithmetic on them is plain.
"""

import numpy as np
import warp as wp

from ..data.errors import InputError
from .launch import CPU, Device, launch_rows

wp.set_module_options({"enable_backward": False})

i64 = wp.int64

# Bits of a word that are used.
WORD = wp.constant(63)
# Cities that Or-opt puts elsewhere at a time, at most.
SEGMENT = wp.constant(3)
# Cities that one launch looks at while it improves: a second or so, after which Ctrl-C is heard.
LOOKS = 20_000

# Halves, quarters and bytes of a word that are counted side by side.
ODD = wp.constant(wp.int64(0x5555555555555555))
PAIRS = wp.constant(wp.int64(0x3333333333333333))
NIBBLES = wp.constant(wp.int64(0x0F0F0F0F0F0F0F0F))


@wp.struct
class Columns:
    """Columns of bits, one a row of words; and the nearest of each, nearest first, -1 where there are fewer."""

    words: wp.array2d[wp.int64]
    near: wp.array2d[int]


@wp.struct
class Tour:
    """Cities in order, the place of each, those that wait (a ring), and who is in it.

    `state` has the queue's first place, how many wait, and how far along `jumps` all are in the tour.
    """

    order: wp.array[int]
    place: wp.array[int]
    queue: wp.array[int]
    queued: wp.array[int]
    state: wp.array[int]


@wp.func
def ones(word: wp.int64) -> int:
    """Bits that are set in a word of 63."""
    pairs = word - ((word >> i64(1)) & ODD)
    nibbles = (pairs & PAIRS) + ((pairs >> i64(2)) & PAIRS)
    octets = (nibbles + (nibbles >> i64(4))) & NIBBLES
    # Sums stay below 64: no octet spills into the next.
    octets = octets + (octets >> i64(8))
    octets = octets + (octets >> i64(16))
    octets = octets + (octets >> i64(32))
    return int(octets & i64(127))


@wp.func
def distance(words: wp.array2d[wp.int64], a: int, b: int) -> int:
    """Bits in which two columns differ."""
    found = int(0)
    for k in range(words.shape[1]):
        found += ones(words[a, k] ^ words[b, k])
    return found


@wp.kernel
def _near(words: wp.array2d[wp.int64], first: int, near_out: wp.array2d[int]):
    row = first + wp.tid()
    room = near_out.shape[1]
    held = int(0)
    worst = int(0)
    for other in range(words.shape[0]):
        if other != row:
            far = distance(words, row, other)
            if held < room or far < worst:
                held = wp.min(held + 1, room)
                # From the back: of equals the lower number, which came before, stays before.
                k = int(held - 1)
                moving = bool(True)
                while k > 0 and moving:
                    before = near_out[row, k - 1]
                    moving = distance(words, row, before) > far
                    if moving:
                        near_out[row, k] = before
                        k -= 1
                near_out[row, k] = other
                worst = distance(words, row, near_out[row, held - 1])


@wp.func
def nearest_left(columns: Columns, jumps: wp.array[int], tour: Tour, here: int) -> int:
    """The nearest city that is not in the tour: of the list of near ones, else of all, or the next one of `jumps`."""
    found = int(-1)
    for k in range(columns.near.shape[1]):
        other = columns.near[here, k]
        if found < 0 and other >= 0:
            if tour.place[other] < 0:
                found = other
    if found < 0 and jumps.shape[0] > 0:
        at = tour.state[2]
        while tour.place[jumps[at]] >= 0:
            at += 1
        tour.state[2] = at
        found = jumps[at]
    elif found < 0:
        best = int(WORD * columns.words.shape[1] + 1)
        for other in range(columns.words.shape[0]):
            if tour.place[other] < 0:
                far = distance(columns.words, here, other)
                if far < best:
                    best = far
                    found = other
    return found


@wp.kernel
def _seed(columns: Columns, jumps: wp.array[int], first: int, tour_out: Tour):
    count = columns.words.shape[0]
    here = int(0)
    for step in range(count):
        if step > 0:
            here = nearest_left(columns, jumps, tour_out, here)
        tour_out.order[step] = here
        tour_out.place[here] = step
        tour_out.queue[step] = here
        tour_out.queued[here] = 1
    tour_out.state[0] = 0
    tour_out.state[1] = count


@wp.func
def beside(tour: Tour, city: int, step: int) -> int:
    """The city so many places after another; before it, if negative."""
    count = tour.order.shape[0]
    at = tour.place[city] + step
    if at >= count:
        at -= count
    if at < 0:
        at += count
    return tour.order[at]


@wp.func
def wait(tour: Tour, city: int):
    """Put a city into the queue, unless it is there."""
    if tour.queued[city] == 0:
        count = tour.order.shape[0]
        at = tour.state[0] + tour.state[1]
        if at >= count:
            at -= count
        tour.queue[at] = city
        tour.queued[city] = 1
        tour.state[1] = tour.state[1] + 1


@wp.func
def reverse(tour: Tour, a: int, b: int):
    """Turn the part from a on to b round, or all the rest if that is shorter: the closed tour is the same."""
    count = tour.order.shape[0]
    low = tour.place[a]
    high = tour.place[b]
    inner = high - low
    if inner < 0:
        inner += count
    inner += 1
    if 2 * inner > count:
        inner = count - inner
        swapped = low
        low = high + 1
        high = swapped - 1
        if low >= count:
            low -= count
        if high < 0:
            high += count
    for _swap in range(inner / 2):
        x = tour.order[low]
        y = tour.order[high]
        tour.order[low] = y
        tour.place[y] = low
        tour.order[high] = x
        tour.place[x] = high
        low += 1
        high -= 1
        if low >= count:
            low -= count
        if high < 0:
            high += count


@wp.func
def exchange(tour: Tour, a: int, b: int, c: int, d: int):
    """Put edges a c and b d in place of a b and c d, b after a as d after c, either way round."""
    if beside(tour, a, 1) == b:
        reverse(tour, b, c)
    else:
        reverse(tour, a, d)


@wp.func
def two_opt(columns: Columns, tour: Tour, a: int, way: int) -> bool:
    """Exchange the edge from a on, and one of a near city, if that shortens the tour. Whether it did."""
    b = beside(tour, a, way)
    removed = distance(columns.words, a, b)
    for k in range(columns.near.shape[1]):
        c = columns.near[a, k]
        if c < 0:
            break
        added = distance(columns.words, a, c)
        # Lists begin with the nearest: what follows gains nothing either.
        if added >= removed:
            break
        d = beside(tour, c, way)
        if removed + distance(columns.words, c, d) > added + distance(columns.words, b, d):
            exchange(tour, a, b, c, d)
            wait(tour, a)
            wait(tour, b)
            wait(tour, c)
            wait(tour, d)
            return True
    return False


@wp.func
def or_opt(columns: Columns, tour: Tour, a: int, way: int, length: int) -> bool:
    """Put so many cities, from a on, beside a city near to a, if that shortens the tour. Whether it did."""
    count = tour.order.shape[0]
    p = beside(tour, a, -way)
    end = beside(tour, a, way * (length - 1))
    n = beside(tour, end, way)
    removed = distance(columns.words, p, a)
    freed = removed + distance(columns.words, end, n) - distance(columns.words, p, n)
    for k in range(2 * columns.near.shape[1]):
        c = columns.near[a, k / 2]
        if c < 0:
            break
        added = distance(columns.words, a, c)
        if added >= removed:
            break
        # How far along c lies: it must be beyond the cities that move.
        ahead = (tour.place[c] - tour.place[a]) * way
        if ahead < 0:
            ahead += count
        turn = way * (1 - 2 * (k % 2))
        e = beside(tour, c, turn)
        # Nor may the place be the gap that they leave.
        gap = (c == n and e == end) or (c == p and e == a)
        gain = freed + distance(columns.words, c, e) - added - distance(columns.words, end, e)
        if gain > 0 and ahead >= length and not gap:
            if turn == way:
                # p [a .. end] n .. c e: to p n .. c [a .. end] e
                exchange(tour, p, a, c, e)
                exchange(tour, p, c, n, end)
                exchange(tour, c, end, a, e)
            else:
                # p [a .. end] n .. e c: to p n .. e [end .. a] c
                exchange(tour, p, a, e, c)
                exchange(tour, p, e, n, end)
            wait(tour, p)
            wait(tour, a)
            wait(tour, end)
            wait(tour, n)
            wait(tour, c)
            wait(tour, e)
            return True
    return False


@wp.kernel
def _improve(columns: Columns, looks: int, first: int, tour_out: Tour):
    count = columns.words.shape[0]
    looked = int(0)
    while looked < looks and tour_out.state[1] > 0:
        looked += 1
        head = tour_out.state[0]
        city = tour_out.queue[head]
        tour_out.queued[city] = 0
        tour_out.state[0] = (head + 1) % count
        tour_out.state[1] = tour_out.state[1] - 1
        done = bool(False)
        for step in range(2 * (1 + SEGMENT)):
            way = 1 - 2 * (step % 2)
            length = step / 2
            if not done and length == 0:
                done = two_opt(columns, tour_out, city, way)
            elif not done and length <= count - 3:
                done = or_opt(columns, tour_out, city, way, length)


def launch_near_columns(bits: np.ndarray, most: int, device: Device = CPU) -> np.ndarray:
    """The columns of a matrix that differ least from each.

    Args:
        bits: the matrix, shape (rows, columns), bool.
        most: how many for each.
        device: where to.

    Returns:
        Numbers of columns, the nearest first, of equals the lower number, shape (columns, most), int32; -1 where there
        are fewer others.
    """
    words = device.array(packed(bits), wp.int64)
    near = wp.full((len(words), most), -1, dtype=int, device=device.name)
    launch_rows(_near, len(words), [words], [near], device)
    return near.numpy()


def launch_tour(bits: np.ndarray, near: np.ndarray, jumps: np.ndarray, device: Device = CPU) -> np.ndarray:
    """A short closed tour through the columns of a matrix under the Hamming distance.

    Args:
        bits: the matrix, shape (rows, columns), bool.
        near: of `launch_near_columns`, at least one for each column; more make it shorter.
        jumps: where to go on when all near ones are in the tour: columns in any order, the first one left is taken;
            empty for the nearest of all, which takes time squared.
        device: where to; one thread does it.

    Returns:
        The columns in the order of the tour, from column 0 on, shape (columns,), int32. No shorter one is found by
        2-opt and Or-opt steps along the edges to near columns.

    Raises:
        InputError: lists or jumps that are not of these columns.
    """
    count = bits.shape[1]
    if near.shape[0] != count or (near >= count).any() or (near < -1).any():
        raise InputError(f"near: expected a row of columns below {count} for each, found {near.shape}")
    if len(jumps) and not np.array_equal(np.sort(jumps), np.arange(count)):
        raise InputError(f"jumps: expected each of {count} columns once, found others")
    if not count:
        return np.zeros(0, np.int32)
    columns = device.struct(Columns, words=packed(bits), near=near)
    tour = device.struct(Tour, order=count, place=np.full(count, -1), queue=count, queued=count, state=3)
    launch_rows(_seed, 1, [columns, device.array(jumps, int)], [tour], device)
    while tour.state.numpy()[1] > 0:
        launch_rows(_improve, 1, [columns, LOOKS], [tour], device)
    order = tour.order.numpy()
    return np.roll(order, -int(np.flatnonzero(order == 0)[0]))


def packed(bits: np.ndarray) -> np.ndarray:
    """Columns of bits as words of 63 of them, shape (columns, words), int64; at least one word."""
    rows, columns = bits.shape
    count = max(1, -(-rows // WORD))
    out = np.zeros((columns, count), np.int64)
    for row in range(rows):
        out[:, row // WORD] |= bits[row].astype(np.int64) << (row % WORD)
    return out
