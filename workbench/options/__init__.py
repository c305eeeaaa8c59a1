"""The options of every command, and their words."""
