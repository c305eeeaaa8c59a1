"""Synthetic buildings, seeded and of any size."""
