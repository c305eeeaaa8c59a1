"""Bake: a model in, potentially visible sets out."""
