"""The benchmark as a command: runs the suite, prints one table, writes it down, compares it with an earlier run."""

import json
import os
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ...data.errors import InputError
from ...data.progress import phase, shown
from ...data.version import __version__
from ...kernels.launch import Device
from ..summary import table
from . import suite as suites
from .growth import Growth, growth_steps, run_growth
from .rows.portals import graph_cases
from .suite import KERNELS, Noise, Row, machine, make_cases, measure
from .timing import commit

HEAD = (
    "kernel",
    "scene (judged)",
    "n",
    "ms",
    "min-max",
    "load ms",
    "hid!",
    "vis!",
    "unk %",
    "over",
    "gap",
    "error",
    "baseline",
    "ratio",
    "MB",
)
LEGEND = (
    "ms: median of 7 or more, one CPU thread (projection_point: as many as JAX takes). load ms: what the first run "
    "takes more.\nhid!, vis!: wrongly hidden, wrongly visible. over: potential / seen. ratio: baseline / ours, below 1 "
    "we lose. MB: memory of a run."
)
NONE = "-"
SCENE_WIDTH = 24


@dataclass
class BenchResult:
    """Rows of one run, with the noise of each, and growth where it was asked for."""

    suite: str
    device: str
    rows: list[Row] = field(default_factory=list)
    noise: list[Noise] = field(default_factory=list)
    growth: list[Growth] = field(default_factory=list)

    @property
    def wrong_hidden(self) -> int:
        """Things hidden that the truth sees, over all rows."""
        return sum(row.wrong_hidden or 0 for row in self.rows)

    def text(self) -> str:
        """Tables for people, at most 160 columns wide."""
        lines = [f"suite {self.suite} on {self.device}, commit {commit()}", LEGEND, "", table(HEAD, self._columns())]
        if self.growth:
            head = ("kernel", "scene", "against", "sizes", "ms", "exponent")
            lines += ["", table(head, [_growth_columns(one) for one in self.growth])]
        return "\n".join(lines)

    def _columns(self) -> list[tuple]:
        return [
            (
                row.kernel if row.method == "kernel" else f"{row.kernel} {row.method}",
                row.scene if len(row.scene) <= SCENE_WIDTH else row.scene[: SCENE_WIDTH - 3] + "...",
                row.n,
                _short(row.ms_median),
                f"{_short(row.ms_min)}-{_short(row.ms_max)}",
                _short(row.compile_ms),
                *(NONE if value is None else value for value in (row.wrong_hidden, row.wrong_visible)),
                *(NONE if value is None else f"{value:.2f}" for value in (row.unknown_pct, row.overestimate)),
                *(NONE if value is None else f"{value:.0e}" for value in (row.gap, row.error)),
                row.baseline,
                _short(row.ratio),
                _short(row.peak_mb),
            )
            for row in self.rows
        ]

    def json(self) -> dict[str, Any]:
        """What `--json` writes."""
        return {
            "machine": machine(Device(self.device)),
            "commit": commit(),
            "version": __version__,
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
            "suite": self.suite,
            "rows": [asdict(row) for row in self.rows],
            "noise": [asdict(one) for one in self.noise],
            "growth": [asdict(one) for one in self.growth],
        }


def _short(value: float) -> str:
    """Three digits at most, and no exponent."""
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}" if value >= 0.1 else f"{value:.3f}"


def _growth_columns(one: Growth) -> tuple[str, ...]:
    error = "" if one.standard_error is None else f" +- {one.standard_error:.2f}"
    return (
        one.kernel,
        one.scene,
        one.against,
        f"{one.sizes[0]:,}-{one.sizes[-1]:,}",
        f"{_short(one.ms[0])}-{_short(one.ms[-1])}",
        f"{one.exponent:.2f}{error}",
    )


def bench(
    *,
    suite: str = "quick",
    device: str = "cpu",
    only: Sequence[str] = (),
    graphs: str | Path | None = None,
    progress: bool = False,
) -> BenchResult:
    """Measure and judge kernels and solvers on fixed, seeded work.

    Args:
        suite: "quick", under 90 s on two cores, or "full": larger sizes, and how cost grows.
        device: Warp device.
        only: kernels, all by default; then growth is left out.
        graphs: a folder of cells and portals, or a folder of such, to flood too.
        progress: show a bar.

    Raises:
        InputError: a name that does not exist, or graphs that cannot be read.
    """
    if suite not in suites.SIZES:
        raise InputError(f"suite: expected {' or '.join(suites.SIZES)}, found {suite!r}")
    unknown = [name for name in only if name not in KERNELS]
    if unknown:
        raise InputError(f"only: expected names among {', '.join(KERNELS)}, found {', '.join(map(repr, unknown))}")
    where = Device.wanted(device, 1)
    result = BenchResult(suite, device)
    work = [(kernel, n) for kernel in KERNELS if not only or kernel in only for n in suites.SIZES[suite][kernel]]
    given = graph_cases(Path(graphs), where) if graphs is not None else []
    grows = suite == "full" and not only
    steps = len(work) + len(given) + (growth_steps() if grows else 0)
    with shown(progress), phase("bench", steps, "case") as bar:
        for kernel, n in work:
            bar.note = kernel
            _add(result, [measure(case, where) for case in make_cases(kernel, n, where)])
            bar.update()
        for case in given:
            _add(result, [measure(case, where)])
            bar.update()
        if grows:
            for curves in run_growth(where, bar.update):
                result.growth += curves
    return result


def _add(result: BenchResult, measured: list[tuple[Row, Noise]]) -> None:
    for row, noise in measured:
        result.rows.append(row)
        result.noise.append(noise)


def check_writable(out: Path) -> None:
    """Refuse a file that could not be written after minutes of work.

    Raises:
        InputError: its folder does not exist or cannot be written, or it is a folder.
    """
    if out.is_dir() or not out.parent.is_dir() or not os.access(out.parent, os.W_OK):
        raise InputError(f"{out}: expected a file to write in a folder that exists, found none")


def write_bench(found: dict[str, Any], out: Path) -> None:
    """Write a run as JSON, whole or not at all."""
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=f".{out.name}.") as scratch:
        part = Path(scratch) / "bench.json"
        part.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        os.replace(part, out)
