"""Cases and rows of `viewcell bench`: how work is timed, judged and set beside its baseline.

Every kernel's case comes from a module of `rows`. Work runs on one CPU thread or on the device named, and the clock
stops when the device is done.
"""

import contextlib
import ctypes
import gc
import math
import platform
import resource
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, astuple, dataclass, fields
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from ...kernels.launch import CPU, Device

# Runs at least of each work; short work is repeated until it has taken this long.
REPEATS, REPEATS_MOST, SHORT_S = 7, 99, 0.02
# A baseline is run as often, but no further once it has taken this long.
BASELINE_S = 0.5
# Kernels, where their cases are made, and how large, by suite. The unit is that of `Row.n`.
KERNELS = {
    "stab": "portals",
    "flood": "portals",
    "target": "portals",
    "shadow": "shadow",
    "coverage": "shadow",
    "backface": "objects",
    "shaft": "objects",
    "rays": "objects",
    "raster": "meshes",
    "deviation": "meshes",
    "select": "solvers",
    "tour": "sets",
    "runs": "sets",
    "eye": "frames",
    "lookahead": "frames",
    "reads": "frames",
    "projection_point": "solvers",
}
SIZES = {
    "quick": {
        "stab": (1_000, 10_000, 100_000),
        "flood": (36, 72, 144),
        "target": (36, 72, 144),
        "shadow": (1_000, 4_000, 16_000),
        "coverage": (100, 400, 1_600),
        "backface": (100, 1_000, 10_000),
        "shaft": (100, 300, 1_000),
        "rays": (1_000, 10_000, 100_000),
        "raster": (4_800, 19_200, 76_800),
        "deviation": (80, 320, 1_280),
        "select": (100, 1_000, 10_000),
        "tour": (500, 2_000, 8_000),
        "runs": (500, 2_000, 8_000),
        "eye": (100, 1_000, 10_000),
        "lookahead": (10, 100, 1_000),
        "reads": (10, 100, 1_000),
        "projection_point": (10, 100, 400),
    },
    "full": {
        "stab": (10_000, 100_000, 1_000_000),
        "flood": (72, 288, 1_152),
        "target": (36, 72, 144),
        "shadow": (4_000, 16_000, 64_000),
        "coverage": (400, 1_600, 6_400),
        "backface": (1_000, 10_000, 100_000),
        "shaft": (300, 1_000, 3_000),
        "rays": (10_000, 100_000, 1_000_000),
        "raster": (19_200, 76_800, 307_200),
        "deviation": (320, 1_280, 5_120),
        "select": (1_000, 10_000, 100_000),
        "tour": (2_000, 8_000, 20_000),
        "runs": (2_000, 8_000, 20_000),
        "eye": (1_000, 10_000, 100_000),
        "lookahead": (100, 1_000, 10_000),
        "reads": (100, 1_000, 10_000),
        "projection_point": (100, 400, 1_000),
    },
}


@dataclass(frozen=True)
class Errors:
    """How wrong an answer is, on the part that was judged; None where a measure does not apply.

    Attributes:
        wrong_hidden: things called hidden that the truth sees. Any is a bug.
        wrong_visible: things called visible, by a kernel that may say so, that the truth hides.
        unknown_pct: share without a verdict [%].
        overestimate: potential over truly seen; with sampled truth an upper bound.
        gap: proved relative distance from the optimum, or relative size lost against the exact answer.
        error: largest other error, in the unit that the case states.
    """

    wrong_hidden: int | None = None
    wrong_visible: int | None = None
    unknown_pct: float | None = None
    overestimate: float | None = None
    gap: float | None = None
    error: float | None = None


@dataclass(frozen=True)
class Case:
    """Work of one kernel at one size.

    Attributes:
        kernel: key of KERNELS.
        scene: what is worked on, and in brackets how much of it is judged.
        method: which of the kernel's ways.
        n: size.
        work: does it all once and returns the answer.
        judge: from an answer to its errors.
        baseline: name of the other way.
        reference: does `share` of the same work in that way.
        modules: Warp modules that the work needs.
        device: where the work runs, if not on the device named to `measure`.
    """

    kernel: str
    scene: str
    method: str
    n: int
    work: Callable[[], Any]
    judge: Callable[[Any], Errors]
    baseline: str
    reference: Callable[[], object]
    share: float
    modules: Sequence[str]
    device: str | None = None


@dataclass(frozen=True)
class Row:
    """A case measured. The fields are those of a row in JSON, None being null.

    Attributes:
        ms_median: of all runs but the first; least and most beside it.
        compile_ms: loading the modules, compiled first if Warp's kernel cache lacks them, and by how much the first run
            took longer than the median.
        ratio: time of the baseline for the same work over ours; below 1 we lose.
        peak_mb: growth of the process's resident memory in one run after the first, Warp's arrays on the CPU included;
            on a GPU that of the host.
    """

    kernel: str
    scene: str
    method: str
    device: Device
    n: int
    ms_median: float
    ms_min: float
    ms_max: float
    compile_ms: float
    wrong_hidden: int | None
    wrong_visible: int | None
    unknown_pct: float | None
    overestimate: float | None
    gap: float | None
    error: float | None
    baseline: str
    ratio: float
    peak_mb: float

    @property
    def key(self) -> tuple[str, str, str, str, int]:
        """What makes rows of two runs the same."""
        return self.kernel, self.scene, self.method, self.device, self.n


ROW_FIELDS = tuple(field.name for field in fields(Row))


@dataclass(frozen=True)
class Noise:
    """First and third quartile of a row's runs [ms]."""

    q1: float
    q3: float


def make_cases(kernel: str, n: int, device: Device) -> list[Case]:
    """Cases of a kernel at one size, on seeded work; several if the kernel has several ways."""
    module = import_module(f".rows.{KERNELS[kernel]}", __package__)
    return getattr(module, f"{kernel}_cases")(n, device)


def measure(case: Case, device: Device) -> tuple[Row, Noise]:
    """Time and judge one case.

    Raises:
        ValueError: its judge measures nothing.
    """
    start = time.perf_counter()
    for module in case.modules:
        wp.load_module(module, device=device.name)
    load_ms = 1e3 * (time.perf_counter() - start)
    first, answer = clock(case.work, device)
    errors = case.judge(answer)
    if all(value is None for value in astuple(errors)):
        raise ValueError(f"{case.kernel}: expected a judge that measures something")
    del answer
    with PeakMemory() as memory:
        clock(case.work, device)
    times = timed(case.work, device)
    median = statistics.median(times)
    slow = statistics.median(timed(case.reference, CPU, limit_s=BASELINE_S)) / case.share
    q1, _, q3 = statistics.quantiles(times, n=4)
    row = Row(
        kernel=case.kernel,
        scene=case.scene,
        method=case.method,
        device=case.device or device.name,
        n=case.n,
        ms_median=median,
        ms_min=min(times),
        ms_max=max(times),
        compile_ms=load_ms + max(0.0, first - median),
        **asdict(errors),
        baseline=case.baseline,
        ratio=slow / median,
        peak_mb=memory.megabytes,
    )
    return row, Noise(q1, q3)


def clock(work: Callable[[], Any], device: Device) -> tuple[float, Any]:
    """Milliseconds of one run, until the device is done, and its answer."""
    start = time.perf_counter()
    answer = work()
    wp.synchronize_device(device.name)
    return 1e3 * (time.perf_counter() - start), answer


def timed(work: Callable[[], object], device: Device, *, limit_s: float = math.inf) -> list[float]:
    """Milliseconds of REPEATS runs, of more if they are short, of fewer (one at least) if they reach the limit."""
    times: list[float] = []
    gc.collect()
    gc.disable()
    try:
        while len(times) < REPEATS_MOST:
            times.append(clock(work, device)[0])
            spent = sum(times) / 1e3
            if spent > limit_s or (len(times) >= REPEATS and spent > SHORT_S):
                break
    finally:
        gc.enable()
    return times


class PeakMemory:
    """Growth of the resident memory within a `with` block [MB].

    On Linux the kernel's high-water mark is reset first; elsewhere only growth beyond the process's own peak is seen.
    """

    megabytes: float

    def __enter__(self) -> "PeakMemory":
        gc.collect()
        # What the allocator holds back would be reused without growth.
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform.startswith("linux") else None
        if trim is not None:
            trim(0)
        with contextlib.suppress(OSError):
            Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
        self._before = _peak_mb()
        return self

    def __exit__(self, *_: object) -> None:
        self.megabytes = max(0.0, _peak_mb() - self._before)


def _peak_mb() -> float:
    """High-water mark of the resident memory [MB]."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except OSError:
        lines = []
    for line in lines:
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) * 1024 / 1e6
    unit = 1 if platform.system() == "Darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def machine(device: Device) -> str:
    """Processor, cores, system, Python, and a GPU if that is where kernels run."""
    found = [_processor(), f"{Device.wanted('cpu').threads} cores", platform.system()]
    found.append(f"Python {platform.python_version()}, Warp {wp.config.version}, NumPy {np.__version__}")
    if not device.is_cpu:
        found.append(wp.get_device(device.name).name)
    return ", ".join(found)


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
