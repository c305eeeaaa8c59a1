"""Run the hard cases of data/hard_cases through every kernel on every device, and count what came of them.

A kernel is right if it says what the file says, or if it can prove hidden only and says nothing of what is visible. It
withholds if it leaves the question open, or cannot hide what is hidden: loose, but safe. Anything else is wrong: a
visible thing hidden, or a line of sight that is none.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import warp as wp

from ...kernels.launch import Device
from ...verify.cases.hard_cases import FOLDER, HardCases, load_hard_cases
from .kernels import KERNELS
from .outcomes import Outcome


@dataclass(frozen=True)
class Row:
    """One kernel on one device.

    Attributes:
        kernel: a public launch function, or the bake by a method.
        device: Warp device.
        right: cases answered as they should be.
        withheld: names of cases that were left open, or of hidden ones that were kept: loose, but safe.
        wrong: names of cases that were answered wrongly.
    """

    kernel: str
    device: str
    right: int
    withheld: tuple[str, ...]
    wrong: tuple[str, ...]

    @property
    def cases(self) -> int:
        """Cases that the kernel was asked."""
        return self.right + len(self.withheld) + len(self.wrong)


def run_hard_cases(
    devices: Iterable[str] | None = None, folder: str | Path = FOLDER, kernels: Iterable[str] | None = None
) -> list[Row]:
    """Put every hard case to every kernel that it concerns.

    Args:
        devices: Warp devices; by default the CPU, and the first GPU if there is one.
        folder: of the case files.
        kernels: names in `KERNELS`; all by default.

    Raises:
        InputError: a case file is malformed, or a device unknown.
    """
    cases = load_hard_cases(folder)
    names = ["cpu", *(d.alias for d in wp.get_cuda_devices()[:1])] if devices is None else list(devices)
    where = [Device.wanted(name, 1) for name in names]
    return [_row(kernel, device, cases) for kernel in kernels or KERNELS for device in where]


def hard_cases_table(rows: list[Row]) -> str:
    """Rows as a Markdown table, and the names of what was answered wrongly."""
    lines = ["| kernel | device | cases | right | withheld | wrong |", "|---|---|---:|---:|---:|---:|"]
    lines += [f"| {r.kernel} | {r.device} | {r.cases} | {r.right} | {len(r.withheld)} | {len(r.wrong)} |" for r in rows]
    lines += [f"wrong: {r.kernel} on {r.device}: {name}" for r in rows for name in r.wrong]
    return "\n".join(lines)


def _row(kernel: str, device: Device, cases: HardCases) -> Row:
    found: dict[Outcome, list[str]] = {outcome: [] for outcome in Outcome}
    for name, outcome in KERNELS[kernel](cases, device):
        found[outcome].append(name)
    withheld, wrong = tuple(found[Outcome.WITHHELD]), tuple(found[Outcome.WRONG])
    return Row(kernel, device.name, len(found[Outcome.RIGHT]), withheld, wrong)
