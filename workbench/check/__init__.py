"""Check anybody's potentially visible sets."""
