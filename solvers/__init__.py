"""Solvers, one problem a file."""
