"""Checkers of certificates: they import arithmetic and data, and nothing that finds a proof."""
