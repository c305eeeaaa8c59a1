"""Curves of time against error."""
