"""Rows of the benchmark, one file for each kind of work."""
