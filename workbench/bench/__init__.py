"""Speed against error: every timing row carries its error columns."""
