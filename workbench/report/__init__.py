"""Look at a bake: plans, sets, numbers, one HTML page."""
