"""Two runs of the benchmark compared: what got slower or looser, and what is wrong that was not."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...data.errors import InputError
from .suite import ROW_FIELDS

# Less than this is no change, whatever the spread of the runs.
LEAST_RATIO = 1.10
# A measure is looser if it grows by more than this.
LOOSER = {"wrong_visible": 0, "unknown_pct": 0.01, "overestimate": 0.001, "gap": 1e-6, "error": 1e-6}
NUMBERS = ("ms_median", "ms_min", "ms_max", "wrong_hidden", *LOOSER)
KEY = ("kernel", "scene", "method", "device", "n")


@dataclass
class Comparison:
    """What changed for the worse, one line each; the worst first.

    Attributes:
        wrong: rows with more wrong-hidden than before, or new rows with any.
        slower: times beyond the noise of both runs.
        looser: errors that grew.
        missing: rows of the old run that the new one has not.
        machines: a warning if the machines differ.
    """

    wrong: list[str] = field(default_factory=list)
    slower: list[str] = field(default_factory=list)
    looser: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    machines: str = ""

    def text(self) -> str:
        """All of it, or that nothing changed for the worse."""
        lines = [self.machines] if self.machines else []
        for name in ("wrong", "slower", "looser", "missing"):
            lines += [f"{name}: {line}" for line in getattr(self, name)]
        if not (self.wrong or self.slower or self.looser or self.missing):
            lines.append("nothing slower or looser")
        return "\n".join(lines)


def load_bench(path: Path) -> dict[str, Any]:
    """A run as `viewcell bench --json` writes it.

    Raises:
        InputError: the file cannot be read, or holds something else.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: expected a file of viewcell bench --json, found {error.strerror}") from None
    except ValueError:
        raise InputError(f"{path}: expected a file of viewcell bench --json, found no JSON") from None
    if not isinstance(found, dict) or not isinstance(found.get("rows"), list):
        raise InputError(f"{path}: expected a file of viewcell bench --json, found no rows")
    for number, row in enumerate(found["rows"]):
        lacks = [name for name in ROW_FIELDS if not isinstance(row, dict) or name not in row]
        if lacks:
            raise InputError(f"{path}: expected {', '.join(ROW_FIELDS)} in row {number}, found no {', '.join(lacks)}")
        for name in NUMBERS:
            _check_number(path, number, name, row[name])
        if any(isinstance(row[name], dict | list) for name in KEY):
            raise InputError(f"{path}: expected text and a number in {', '.join(KEY)} of row {number}, found another")
    return found


def _check_number(path: Path, row: int, name: str, value: object) -> None:
    """Times are above 0, other numbers at least 0 or null."""
    timed = name.startswith("ms_")
    number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if not (number and (value > 0 if timed else value >= 0)) and not (value is None and not timed):
        least = "a number above 0" if timed else "a number, 0 or more, or null"
        raise InputError(f"{path}: expected {least} as {name} of row {row}, found {value!r}")


def compare(old: dict[str, Any], new: dict[str, Any], only: Sequence[str] = ()) -> Comparison:
    """What the new run does worse than the old; with `only`, old rows of other kernels are not missed.

    A row is slower if the ratio of its medians is at least 1.1 and beyond the product of the quartile ratios q3 / q1 of
    its runs (of most / least where a file has no quartiles).
    """
    out = Comparison()
    if old.get("machine") != new.get("machine"):
        out.machines = f"another machine, so that times do not compare: {old.get('machine')}"
    before = {_key(row): (row, spread) for row, spread in zip(old["rows"], _spreads(old), strict=True)}
    after = {_key(row): (row, spread) for row, spread in zip(new["rows"], _spreads(new), strict=True)}
    slower, looser = [], []
    for key, (row, spread) in after.items():
        was, spread_was = before.get(key, ({}, 1.0))
        if (row["wrong_hidden"] or 0) > (was.get("wrong_hidden") or 0):
            out.wrong.append(f"{_name(key)}: {row['wrong_hidden']} wrongly hidden")
        if not was:
            continue
        ratio = row["ms_median"] / was["ms_median"]
        if ratio >= LEAST_RATIO and ratio > spread * spread_was:
            times = f"{was['ms_median']:.3g} to {row['ms_median']:.3g} ms"
            slower.append((ratio, f"{_name(key)}: {ratio:.2f} x, {times}"))
        for name, least in LOOSER.items():
            one, two = was[name], row[name]
            if one is not None and two is not None and two - one > least:
                ratio = two / one if one else math.inf
                looser.append((ratio, f"{_name(key)}: {name} {ratio:.2f} x, {one:.4g} to {two:.4g}"))
    out.slower = [line for _, line in sorted(slower, reverse=True)]
    out.looser = [line for _, line in sorted(looser, reverse=True)]
    out.missing = [_name(key) for key in before if key not in after and (not only or key[0] in only)]
    return out


def _key(row: dict[str, Any]) -> tuple:
    return tuple(row[name] for name in KEY)


def _name(key: tuple) -> str:
    kernel, scene, method, device, n = key
    return f"{kernel} ({method}), {scene}, n = {n}, {device}"


def _spreads(run: dict[str, Any]) -> list[float]:
    """Ratio q3 / q1 of each row's runs."""
    rows, noise = run["rows"], run.get("noise")
    try:
        return [float(one["q3"]) / float(one["q1"]) for _, one in zip(rows, noise, strict=True)]
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        return [row["ms_max"] / row["ms_min"] for row in rows]
