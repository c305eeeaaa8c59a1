"""Sampling: rays cast, guided and judged exactly."""
