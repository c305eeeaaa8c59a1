"""Where kernels run, and launching them over rows of work on CPU threads or a GPU."""

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import warp as wp

from ..data.errors import InputError
from ..data.progress import go_on, open_here
from ..data.scene import GRID_LIMIT

# Rows a CPU thread takes at a time: small enough to balance, large enough to hide the launch (about 50 us).
CHUNK = 1024
GPU_SLOTS = 8192

Work, Answer = TypeVar("Work"), TypeVar("Answer")


class _Lane(threading.local):
    """What a thread that works beside others may use: how many threads of its own, and until it is told to stop."""

    threads: int | None = None
    stopped: threading.Event | None = None


_LANE = _Lane()
# Modules are compiled one at a time.
_LOADING = threading.Lock()


@dataclass(frozen=True)
class Device:
    """Where kernels run; no answer depends on it.

    Attributes:
        name: Warp's name, such as "cpu" or "cuda:0".
        threads: of the CPU; a GPU has its own.
    """

    name: str = "cpu"
    threads: int = 1

    @classmethod
    def wanted(cls, name: str, threads: int | None = None) -> "Device":
        """The device of that name, with one thread per core unless told otherwise.

        Raises:
            InputError: Warp does not know it.
        """
        try:
            wp.get_device(name)
        except Exception as error:  # Warp raises several types for an unknown or absent device
            raise InputError(f"device: expected one that Warp knows, found {name!r} ({error})") from None
        # Cores this process may use, not those of the machine; not every system can tell.
        allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
        return cls(name, threads or allowed or 1)

    @property
    def threads_here(self) -> int:
        """CPU threads for work of the calling thread: its share, where it is one of several (`side_by_side`)."""
        return _LANE.threads or self.threads

    @property
    def is_cpu(self) -> bool:
        """Whether rows run on CPU threads."""
        return wp.get_device(self.name).is_cpu

    def array(self, values: np.ndarray, dtype: type) -> wp.array:
        """A copy on the device; vectors take the last axis."""
        scalar = getattr(dtype, "_wp_scalar_type_", dtype)
        host = np.int32 if scalar is int else wp.dtype_to_numpy(scalar)
        return wp.array(np.ascontiguousarray(values, host), dtype=dtype, device=self.name)

    def zeros(self, shape: int | tuple[int, ...], dtype: type) -> wp.array:
        """Zeros on the device."""
        return wp.zeros(shape, dtype=dtype, device=self.name)

    def corners(self, rows: np.ndarray) -> wp.array:
        """Corners in grid steps as vec3i.

        Raises:
            InputError: a coordinate beyond the grid (data/scene.py), where products of differences stop being exact.
        """
        check_coordinates(rows)
        return self.array(np.asarray(rows).reshape(-1, 3), wp.vec3i)

    def struct(self, kind: Callable[[], object], **columns: object) -> object:
        """A Warp struct: its arrays are copies of the columns, or zeros of a given shape; other fields are as given."""
        out = kind()
        for name, values in columns.items():
            dtype = getattr(kind.vars[name].type, "dtype", None)
            if isinstance(values, int | tuple) and dtype is not None:
                values = self.zeros(values, dtype)
            elif isinstance(values, np.ndarray) and dtype is not None:
                values = self.array(values, dtype)
            setattr(out, name, values)
        return out


CPU = Device()


def check_coordinates(values: np.ndarray) -> None:
    """Refuse coordinates beyond the grid with an InputError."""
    values = np.asarray(values)
    most = max(values.max(initial=0), -values.min(initial=0))
    if not most <= GRID_LIMIT:
        raise InputError(f"coordinates: expected at most {GRID_LIMIT} grid steps from the origin, found {most}")


def lanes(count: int, device: Device) -> int:
    """How many of so many pieces of work `side_by_side` does at a time."""
    return max(1, min(device.threads_here, count)) if device.is_cpu else 1


def side_by_side(do: Callable[[Work], Answer], work: Sequence[Work], device: Device) -> Iterator[tuple[int, Answer]]:
    """Do pieces of work that do not depend on each other, on CPU threads that share those of the device.

    What Python does between launches then goes on while others launch. Answers may not depend on it.

    Yields:
        Place and answer of each piece, as they are done. When the caller gives up, the others end with what they launch
        next.
    """
    count = lanes(len(work), device)
    if count == 1:
        yield from enumerate(map(do, work))
        return
    stopped, above, share = threading.Event(), open_here(), device.threads_here // count

    def begin() -> None:
        _LANE.threads, _LANE.stopped = share, stopped
        go_on(above)

    with ThreadPoolExecutor(count, initializer=begin) as pool:
        places = {pool.submit(do, piece): place for place, piece in enumerate(work)}
        try:
            for done in as_completed(places):
                yield places[done], done.result()
        finally:
            stopped.set()
            pool.shutdown(wait=False, cancel_futures=True)


def check_stopped() -> None:
    """End what this thread does if others have given up.

    Raises:
        KeyboardInterrupt: as in the thread that was interrupted.
    """
    if _LANE.stopped is not None and _LANE.stopped.is_set():
        raise KeyboardInterrupt


def load_kernels(module: wp.Module, device: Device) -> None:
    """Compile or load the kernels of a module, one module at a time, whichever thread asks."""
    # As a launch does: Module.load alone compiles a second variant on a CPU, for blocks of many threads.
    with _LOADING:
        wp.load_module(module, device=device.name)


@dataclass(frozen=True)
class Scratch:
    """What one slot needs: float64 values and integers."""

    values: int = 0
    integers: int = 0

    def arrays(self, slots: int, device: Device) -> list[wp.array]:
        """Scratch of some slots: values, then integers; a kind that no slot needs is left out."""
        kinds = ((self.values, wp.float64), (self.integers, int))
        return [device.zeros(max(1, size * slots), dtype) for size, dtype in kinds if size]


def launch_rows(
    kernel: wp.Kernel, count: int, inputs: Sequence[object], outputs: Sequence[object], device: Device
) -> None:
    """Launch a kernel, one of its threads per row.

    Its arguments are the inputs, `first`, and the outputs; its row is first + tid. Rows may not depend on each other.
    """

    def launch(first: int, last: int) -> None:
        wp.launch(kernel, dim=last - first, inputs=[*inputs, first], outputs=outputs, device=device.name)

    run_sliced(launch, count, kernel.module, device)


def launch_slots(
    kernel: wp.Kernel,
    count: int,
    inputs: Sequence[object],
    scratch: Scratch,
    outputs: Sequence[object],
    device: Device,
    *,
    chunk: int = CHUNK,
    gpu_chunk: int | None = None,
) -> None:
    """Launch a kernel whose threads are slots, each with scratch of its own, that share the rows.

    Its arguments are the inputs, `first`, `last`, `slots`, the kinds of scratch that there are, and the outputs; its
    rows are first + tid, first + tid + slots, ... below last. Rows may not depend on each other.

    Args:
        kernel: to launch.
        count: rows.
        inputs: before those.
        scratch: of one slot.
        outputs: after those.
        device: where to.
        chunk: rows that a CPU thread takes at a time, all of them in one slot.
        gpu_chunk: rows per launch on a GPU; all by default.
    """

    def launch(first: int, last: int, slots: int, *kinds: wp.array) -> None:
        wp.launch(kernel, slots, inputs=[*inputs, first, last, slots, *kinds], outputs=outputs, device=device.name)

    run_sliced(launch, count, kernel.module, device, scratch=scratch, chunk=chunk, gpu_chunk=gpu_chunk)


def run_sliced(
    launch: Callable[..., None],
    count: int,
    module: wp.Module,
    device: Device,
    *,
    scratch: Scratch | None = None,
    chunk: int = CHUNK,
    gpu_chunk: int | None = None,
) -> None:
    """Call `launch(first, last)`, or with scratch `launch(first, last, slots, *scratch)`, until all rows are done.

    On a GPU with many slots at once. On the CPU in chunks from several threads, one slot each: Warp runs a CPU launch
    on the calling thread and releases the GIL. Rows may not depend on each other, so the result does not depend on
    this.
    """
    if count == 0:
        return
    check_stopped()
    load_kernels(module, device)

    def slotted(slots: int) -> tuple[object, ...]:
        return () if scratch is None else (slots, *scratch.arrays(slots, device))

    if not device.is_cpu:
        step = min(gpu_chunk or count, count)
        mine = slotted(min(step, GPU_SLOTS))
        for first in range(0, count, step):
            launch(first, min(first + step, count), *mine)
        wp.synchronize_device(device.name)
        return
    threads = max(1, min(device.threads_here, -(-count // chunk)))
    starts = iter(range(0, count, chunk))
    lock = threading.Lock()

    def worker() -> None:
        mine = slotted(1)
        while True:
            with lock:
                first = next(starts, None)
            if first is None:
                return
            check_stopped()
            launch(first, min(first + chunk, count), *mine)

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
