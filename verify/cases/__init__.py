"""Cases on the edge of a verdict, as text files."""
