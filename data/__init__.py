"""The model and the display database: scene, readers, synthetic buildings, subdivision, portals, bake folder."""
