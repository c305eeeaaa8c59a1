"""What commands with --json say: one schema for all, told in docs/json.md."""

import json
import math
from typing import TYPE_CHECKING

import numpy as np

from ..data.version import __version__

if TYPE_CHECKING:
    from ..verify.check_result import CheckResult, WrongPair
    from ..verify.findings import Counts, VerifyResult
    from .baked import Bake

# Of the head that all commands share. It grows when a name goes or changes its meaning, not when one comes.
SCHEMA = 1


def as_json(command: str, code: int, result: dict | None = None, error: str | None = None) -> str:
    """A command's result, or the line that it complains with.

    Args:
        command: its name.
        code: its exit code.
        result: what it found; None where it failed before.
        error: why it failed.
    """
    head = {"schema": SCHEMA, "viewcell": __version__, "command": command, "ok": code == 0, "exit_code": code}
    head |= {"result": result} if error is None else {"error": error}
    return json.dumps(_finite(head), indent=1, ensure_ascii=False, allow_nan=False)


def bake_result(bake: "Bake", fresh: bool) -> dict:
    """Of `viewcell bake`: where it is, whether it was written now, and the manifest's account of it."""
    from ..verify.findings import count_pairs

    named = ("source", "yaw_deg", "counts", "kept", "seconds", "warnings", "skipped", "budget", "rooms")
    return {
        "folder": str(bake.folder),
        "written": fresh,
        "pairs": [_pairs(counts) for counts in count_pairs(bake)],
        **{name: bake.manifest[name] for name in named if name in bake.manifest},
    }


def verify_result(result: "VerifyResult") -> dict:
    """Of `viewcell verify`: the counts of its tables."""
    witnesses = {"cells": result.cell_witnesses, "objects": result.object_witnesses}
    proofs = result.certificates
    return {
        "wrong_hidden": result.wrong_hidden,
        "pair": result.pair or None,
        "case": None if result.case is None else str(result.case),
        "rays": result.rays,
        "cell_rays": result.cell_rays,
        "guided_rays": result.guided_rays,
        "rays_per_second": round(result.rays_per_second),
        "grazes": result.grazes,
        "leaks": result.leaks,
        "blocked": result.blocked,
        "dark_cells": result.dark_cells,
        "witnesses": {
            kind: {"confirmed": found.confirmed, "refuted": found.refuted, "examples": list(found.examples)}
            for kind, found in witnesses.items()
        },
        "certificates": None if proofs is None else {"text": proofs.line(), "failed": proofs.failed},
        "pairs": [_pairs(counts) | {"seen_by_rays": counts.by_rays} for counts in result.counts],
        "seconds": result.seconds,
    }


def check_result(result: "CheckResult") -> dict:
    """Of `viewcell check`: every wrong-hidden pair with its sightline, and totals by kind of target."""
    totals = {kind: [int(part.sum()) for part in result.by_cell(kind)] for kind in result.claimed}
    return {
        "exact": result.exact,
        "view_cells": len(result.sources),
        "rays": result.rays,
        "grazes": result.grazes,
        "blocked": result.blocked,
        "confidence": result.confidence_line(),
        "targets": {
            kind: {"claimed": claimed, "seen": seen, "wrong_hidden": wrong}
            for kind, (claimed, seen, wrong) in totals.items()
        },
        "wrong_hidden": [_wrong(result, pair) for pair in result.wrong],
        "notes": result.notes,
        "seconds": result.seconds,
    }


def _wrong(result: "CheckResult", pair: "WrongPair") -> dict:
    start, end = result.sightline(pair)
    return {
        "kind": pair.kind,
        "cell_id": result.cell_ids[pair.cell],
        "target_id": pair.target if pair.kind == "object" else result.cell_ids[pair.target],
        "from": start.tolist(),
        "to": end.tolist(),
        "text": result.describe(pair),
    }


def _pairs(counts: "Counts") -> dict:
    return {
        "targets": counts.name,
        "potential": counts.potential,
        "seen": counts.seen,
        "overestimate": counts.overestimate,
        "unknown": counts.potential - counts.seen,
    }


def _finite(value: object) -> object:
    """A value as JSON has it: numbers of NumPy as such, and null for those that are none or not finite."""
    if isinstance(value, dict):
        return {str(name): _finite(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
