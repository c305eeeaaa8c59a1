"""What the benchmarks share: the commit they ran on, a median with its range, rows of a table."""

import statistics
import subprocess
from collections.abc import Sequence
from pathlib import Path


def commit() -> str:
    """Short name of the checked-out commit, or - outside a clone."""
    here = Path(__file__).resolve().parent
    found = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=here, capture_output=True, text=True, check=False
    )
    return found.stdout.strip() or "-"


def median_range(values: Sequence[float]) -> str:
    """Median (least-most)."""
    return f"{statistics.median(values):,.3f} ({min(values):,.3f}-{max(values):,.3f})"


def print_row(columns: Sequence[object]) -> None:
    """One row of a Markdown table, at once."""
    print("| " + " | ".join(f"{c:,}" if isinstance(c, int) else str(c) for c in columns) + " |", flush=True)


def print_head(columns: Sequence[str]) -> None:
    """The head of a Markdown table."""
    print_row(columns)
    print("|" + "---|" * len(columns), flush=True)
