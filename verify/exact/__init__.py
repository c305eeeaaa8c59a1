"""Exact twins, one for each kernel, under its stem: rationals and integers, no code of kernels or solvers."""
