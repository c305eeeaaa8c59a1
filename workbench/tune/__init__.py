"""Tune projection points and levels of detail on a user's own model."""
