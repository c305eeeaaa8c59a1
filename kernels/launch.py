"""Launching kernels that loop over work items with a scratch slot each, on CPU threads or a GPU."""

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..data.errors import InputError
from ..data.scene import GRID_LIMIT

# Items a CPU thread takes at a time: small enough to balance, large enough to hide the launch (about 50 us).
CHUNK = 1024
GPU_SLOTS = 8192


@dataclass(frozen=True)
class SlotSizes:
    """Scratch that one slot needs: float64 values and integers."""

    values: int
    integers: int


def thread_count(threads: int | None) -> int:
    """The given number of threads, or one a core."""
    # Cores this process may use, not those of the machine; not every system can tell.
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return threads or allowed or 1


def check_device(device: str) -> None:
    """Refuse a device that Warp does not know with an InputError."""
    try:
        wp.get_device(device)
    except Exception as error:  # Warp raises several types for an unknown or absent device
        raise InputError(f"device: expected one that Warp knows, found {device!r} ({error})") from None


def vectors(rows: np.ndarray, device: str) -> wp.array:
    """Corners in grid steps, three integers each, as a Warp array of vec3i.

    Raises:
        InputError: a coordinate beyond the grid (data/scene.py), where products of differences stop being exact.
    """
    check_coordinates(rows)
    return triples(rows, device)


def triples(rows: np.ndarray, device: str) -> wp.array:
    """Rows of any three integers, and boxes of a hierarchy, whose empty ones lie beyond the grid, as vec3i."""
    return wp.array(np.ascontiguousarray(rows, np.int32).reshape(-1, 3), dtype=wp.vec3i, device=device)


def check_coordinates(values: np.ndarray) -> None:
    """Refuse coordinates beyond the grid with an InputError."""
    values = np.asarray(values)
    most = max(values.max(initial=0), -values.min(initial=0))
    if not most <= GRID_LIMIT:
        raise InputError(f"coordinates: expected at most {GRID_LIMIT} grid steps from the origin, found {most}")


def run_sliced(
    launch: Callable[[int, int, int, wp.array, wp.array], None],
    count: int,
    sizes: SlotSizes,
    *,
    module: str,
    threads: int = 1,
    device: str = "cpu",
    chunk: int = CHUNK,
) -> None:
    """Call `launch(first, last, slots, scratch, frames)` until all items are done.

    On a GPU with many slots at once. On the CPU in chunks from `threads` threads, one slot each: Warp runs a CPU launch
    on the calling thread and releases the GIL. Items may not depend on each other, so the result does not depend on
    this.
    """
    if count == 0:
        return
    wp.load_module(module, device=device)
    if not wp.get_device(device).is_cpu:
        step = count if chunk == CHUNK else chunk
        slots = min(step, GPU_SLOTS)
        scratch = scratch_for(sizes, slots, device)
        for first in range(0, count, step):
            launch(first, min(first + step, count), slots, *scratch)
        wp.synchronize_device(device)
        return
    threads = max(1, min(threads, -(-count // chunk)))
    starts = iter(range(0, count, chunk))
    lock = threading.Lock()

    def worker() -> None:
        scratch = scratch_for(sizes, 1, device)
        while True:
            with lock:
                first = next(starts, None)
            if first is None:
                return
            launch(first, min(first + chunk, count), 1, *scratch)

    if threads == 1:
        worker()
        return
    with ThreadPoolExecutor(threads) as pool:
        try:
            for done in [pool.submit(worker) for _ in range(threads)]:
                done.result()
        finally:
            # After Ctrl-C or an error the workers end with the chunk they are in.
            with lock:
                starts = iter(())


def scratch_for(sizes: SlotSizes, slots: int, device: str) -> tuple[wp.array, wp.array]:
    """Scratch of some slots: float64 values and integers."""
    return (
        wp.zeros(sizes.values * slots, dtype=wp.float64, device=device),
        wp.zeros(max(1, sizes.integers * slots), dtype=int, device=device),
    )
