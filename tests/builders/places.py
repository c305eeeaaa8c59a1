"""Where things are: the repository, the cases that it holds, and the models beside it."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HARD_CASES = ROOT / "data" / "hard_cases"
SHARED = ROOT.parent / "shared"
