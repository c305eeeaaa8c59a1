"""Write a bake for engines: its sets, its model, and both together."""
