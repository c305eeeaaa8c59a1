"""What each kernel takes of a GPU, as the compiler reports: registers, local memory, occupancy; no GPU is needed."""

import argparse
import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from ...data.errors import InputError
from ...data.progress import track

# Threads of a block, as Warp launches them, and what a multiprocessor of compute capability 9.0 has. Source: CUDA C++
# Programming Guide, technical specifications; registers are given to warps in lots of 256.
BLOCK, WARP, MOST_WARPS, REGISTERS, LOT = 256, 32, 64, 65_536, 256
L1_BYTES = 256 * 1024


@dataclass(frozen=True)
class Report:
    """What the assembler says of a kernel.

    Attributes:
        module: file in kernels/.
        kernel: its name there.
        registers: of a thread.
        local: bytes of local memory of a thread: what has no place in registers, vectors that are indexed above all.
        spilled: bytes stored there because registers ran out.
    """

    module: str
    kernel: str
    registers: int
    local: int
    spilled: int

    @property
    def warps(self) -> int:
        """Warps that a multiprocessor holds, as registers allow."""
        each = -(-self.registers * WARP // LOT) * LOT
        in_block = BLOCK // WARP
        return min(MOST_WARPS, REGISTERS // (each * in_block) * in_block)

    @property
    def limits(self) -> str:
        """What would hold it up first."""
        found = []
        if self.warps < MOST_WARPS:
            found.append("registers")
        if self.local * self.warps * WARP > L1_BYTES:
            found.append(f"local memory, {self.local * self.warps * WARP / L1_BYTES:.1f} x the L1 cache")
        return "; ".join(found) or "neither"


def parse(module: str, text: str) -> list[Report]:
    """Reports of all kernels in what `ptxas -v` prints, ordered by name."""
    pattern = (
        r"Compiling entry function '(\w+?)_[0-9a-f]{8}_cuda_kernel_forward'.*?"
        r"(\d+) bytes stack frame, (\d+) bytes spill stores.*?Used (\d+) registers"
    )
    found = [
        Report(module, name, int(registers), int(local), int(spilled))
        for name, local, spilled, registers in re.findall(pattern, text, re.DOTALL)
    ]
    return sorted(found, key=lambda report: report.kernel)


def table(reports: list[Report]) -> str:
    """The reports as Markdown."""
    lines = [
        "| kernel | registers | local memory [B] | spilled [B] | warps of 64 | limited by |",
        "|---|---|---|---|---|---|",
    ]
    for r in reports:
        lines.append(
            f"| `{r.module}.{r.kernel}` | {r.registers} | {r.local:,} | {r.spilled} | {r.warps} | {r.limits} |"
        )
    return "\n".join(lines)


def modules() -> list[str]:
    """Files in kernels/ that define a kernel, ordered."""
    folder = Path(__file__).parents[2] / "kernels"
    return sorted(path.stem for path in folder.glob("*.py") if "\n@wp.kernel" in path.read_text(encoding="utf-8"))


def report_of(name: str, arch: int, ptxas: str) -> list[Report]:
    """Compile a file of kernels for an architecture, such as 90, and read what the assembler says.

    Raises:
        InputError: the assembler does not take it; it may be older than Warp's compiler.
    """
    import warp as wp

    module = import_module(f"...kernels.{name}", __package__)
    with tempfile.TemporaryDirectory() as folder:
        (path,) = wp.compile_aot_module(module, device=None, arch=arch, module_dir=folder, use_ptx=True)
        # Warp ends the text with a zero, which the assembler does not expect.
        clean = Path(folder) / "clean.ptx"
        clean.write_bytes(Path(path).read_bytes().rstrip(b"\0"))
        asked = [ptxas, f"-arch=sm_{arch}", "-v", str(clean), "-o", str(Path(folder) / "out.cubin")]
        said = subprocess.run(asked, capture_output=True, text=True, check=False)
    if said.returncode:
        raise InputError(
            f"{ptxas}: expected an assembler that takes {name}, found: {said.stderr.strip().splitlines()[0]}"
        )
    return parse(name, said.stderr + said.stdout)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--arch", type=int, default=90, help="compute capability, 90 (H100, H200) by default")
    parser.add_argument(
        "--ptxas", default="ptxas", help="CUDA's assembler, as in the package nvidia-cuda-nvcc; ptxas by default"
    )
    parser.add_argument("--only", nargs="+", metavar="FILE", help="files in kernels/, all by default")


def run(options: argparse.Namespace) -> int:
    """Compile, read, print the table."""
    ptxas = shutil.which(options.ptxas)
    if ptxas is None:
        raise InputError(f"--ptxas: expected CUDA's assembler, found nothing at {options.ptxas!r}")
    if unknown := sorted(set(options.only or ()) - set(modules())):
        raise InputError(f"--only: expected files with kernels ({', '.join(modules())}), found {', '.join(unknown)}")
    found = []
    for name in track(options.only or modules(), "kernels", "file"):
        found += report_of(name, options.arch, ptxas)
    print(table(found))
    return 0
