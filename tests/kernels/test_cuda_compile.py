import importlib

import pytest
import warp as wp
from viewcell.workbench.bench.occupancy import modules

HOPPER = 90


@pytest.mark.slow
@pytest.mark.parametrize("name", modules())
def test_kernels_compile_for_cuda_without_a_gpu(name, tmp_path, monkeypatch):
    """Whether CUDA takes what is written; optimising it, most of the time, finds no mistake in it."""
    monkeypatch.setattr(wp.config, "optimization_level", 1)
    module = importlib.import_module(f"viewcell.kernels.{name}")
    wp.compile_aot_module(module, device=None, arch=HOPPER, module_dir=str(tmp_path))
    assert any(path.suffix in (".ptx", ".cubin") and path.stat().st_size > 1000 for path in tmp_path.rglob("*"))
