"""Walk through a bake: paths, and a renderer in software."""
