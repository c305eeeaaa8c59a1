"""Packing a bake into the display database that a walkthrough reads."""
