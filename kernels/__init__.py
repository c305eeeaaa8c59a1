"""Warp kernels, one geometric idea per file; one source for CPU and GPU."""
