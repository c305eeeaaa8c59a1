"""Warp kernels, one geometric idea per file; one source for CPU and GPU."""

from ..data.silence import start_warp

start_warp()
