"""Levels of detail: chains, their error on the image, their benefit and cost, and which to draw."""
