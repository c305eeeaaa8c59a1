"""Reading what CUDA's assembler says of kernels, and what a multiprocessor holds of them."""

import pytest
from viewcell.data.errors import InputError
from viewcell.workbench.bench import occupancy
from viewcell.workbench.bench.__main__ import main

SAID = """ptxas info    : 0 bytes gmem
ptxas info    : Compiling entry function '_second_0123abcd_cuda_kernel_forward' for 'sm_90'
ptxas info    : Function properties for _second_0123abcd_cuda_kernel_forward
    9296 bytes stack frame, 12 bytes spill stores, 16 bytes spill loads
ptxas info    : Used 149 registers, used 0 barriers, 9296 bytes cumulative stack size, 1024 bytes smem
ptxas info    : Compiling entry function '_first_89ab0123_cuda_kernel_forward' for 'sm_90'
ptxas info    : Function properties for _first_89ab0123_cuda_kernel_forward
    0 bytes stack frame, 0 bytes spill stores, 0 bytes spill loads
ptxas info    : Used 32 registers, used 0 barriers, 1024 bytes smem
"""


def test_every_kernel_is_read():
    first, second = occupancy.parse("clip", SAID)
    assert first == occupancy.Report("clip", "_first", 32, 0, 0)
    assert second == occupancy.Report("clip", "_second", 149, 9296, 12)
    assert occupancy.parse("clip", "") == []


@pytest.mark.parametrize(
    ("registers", "warps"), [(16, 64), (32, 64), (33, 48), (64, 32), (65, 24), (128, 16), (149, 8)]
)
def test_warps_are_those_of_the_occupancy_calculator(registers, warps):
    """NVIDIA's table for compute capability 9.0 and blocks of 256 threads."""
    assert occupancy.Report("", "", registers, 0, 0).warps == warps


def test_what_limits_is_told():
    first, second = occupancy.parse("clip", SAID)
    assert first.limits == "neither"
    assert second.limits == "registers; local memory, 9.1 x the L1 cache"
    assert occupancy.table([second]).splitlines()[-1].startswith("| `clip._second` | 149 | 9,296 | 12 | 8 | registers;")


def test_files_with_kernels_are_found():
    assert {"target", "hierarchy", "aim"} <= set(occupancy.modules()) and "launch" not in occupancy.modules()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--ptxas", "/none/ptxas"], "--ptxas: expected CUDA's assembler, found nothing at '/none/ptxas'"),
        (["--ptxas", "python3", "--only", "none"], "--only: expected files with kernels (aim, backface"),
    ],
)
def test_what_cannot_be_is_one_line(options, said, capsys):
    assert main(["occupancy", *options]) == 2
    out = capsys.readouterr()
    assert said in out.err and not out.out


def test_an_assembler_that_is_too_old_is_one_line(tmp_path, monkeypatch):
    def compiled(module, **options):
        path = tmp_path / "a.ptx"
        path.write_bytes(b".version 99.0\0")
        return [path]

    old = tmp_path / "ptxas"
    old.write_text("#!/bin/sh\necho 'fatal: Unsupported .version 99.0' >&2\nexit 1\n")
    old.chmod(0o755)
    monkeypatch.setattr("warp.compile_aot_module", compiled)
    with pytest.raises(
        InputError, match=r"expected an assembler that takes clip, found: fatal: Unsupported .version 99.0"
    ):
        occupancy.report_of("clip", 90, str(old))
