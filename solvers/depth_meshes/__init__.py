"""Textured depth meshes: what lies far from a view cell as six images with depth, and how wrong they may be."""
