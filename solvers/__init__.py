"""Solvers, one problem per file."""
