"""Warp kernels, one geometric idea a file; one source for CPU and GPU."""
