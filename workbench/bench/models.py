"""Whole models: each is baked and verified, time beside error.

Run `python -m viewcell.workbench.bench models MODEL... [--rays N]`; a MODEL is anything that `viewcell bake` takes.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from ...data.blockers import find_blockers
from ...data.prepared import PreparedModel
from ...data.store.bake_folder import BakeFolder
from ...data.verdict import Verdict
from ...kernels.blockers import blocker_tree
from ...kernels.launch import Device
from ...solvers.visibility.search import search_rounds
from ...verify.findings import Counts, VerifyResult
from ..bake.run import bake
from ..terminal import FAILED
from .timing import commit, print_head, print_row

RAYS = 1_000_000
HEAD = (
    "model",
    "cells",
    "inhabitable",
    "portals",
    "objects",
    "seconds by phase",
    "overestimate: cells, inhabitable",
    "cells, all",
    "objects",
    "unknown %: cells, inhabitable / all / objects",
    "kept %: objects / triangles",
    "kept / eye: median / worst",
    "undecided % of all pairs of cells",
    "rays",
    "wrong hidden",
    "rays per second",
    "of Embree's own",
    "witnesses confirmed, refuted",
    "commit",
)


def undecided_percent(made: BakeFolder) -> float:
    """Pairs (inhabitable cell, cell) that the target search gives up on, and that have no witness [% of all pairs]."""
    graph = made.graph
    blockers = find_blockers(graph) if made.scene is None else PreparedModel(made.scene).blockers(graph)
    table = made.cell_to_cell
    unknown = np.array([str(verdict) == "unknown" for verdict in table["verdict"].to_pylist()], bool)
    source, target = (table[name].to_numpy()[unknown] for name in ("cell_id", "reached_cell_id"))
    pairs = np.column_stack([source, target, np.zeros(len(source), int)])[source != target]
    given_up = search_rounds(blocker_tree(blockers), graph.cells, pairs, Device(threads=2)).verdict == Verdict.UNKNOWN
    return 100.0 * float(given_up.sum()) / (int(graph.inhabitable.sum()) * graph.cell_count)


def together(counts: list[Counts]) -> Counts:
    """Several classes as one."""
    return Counts("all", sum(c.potential for c in counts), sum(c.seen for c in counts), sum(c.by_rays for c in counts))


def _kept(kept: dict | None) -> list[str]:
    """What view cells keep, in two columns."""
    if kept is None:
        return ["-", "-"]
    eye = kept["eye"]
    shares = " / ".join(f"{100 * kept[name]:.1f}" for name in ("objects", "triangles"))
    return [shares, "-" if eye is None else f"{eye['median']:.2f} / {eye['worst']:.2f}"]


def columns(name: str, made: BakeFolder, result: VerifyResult) -> list[object]:
    """One row of the table."""
    facts, objects = made.manifest, result.counts[-1]
    cells = together(result.counts[:-1])
    classes = (result.counts[0], cells, objects)
    confirmed = result.cell_witnesses.confirmed + result.object_witnesses.confirmed
    return [
        name,
        *(int(facts["counts"].get(count, 0)) for count in ("cells", "inhabitable", "portals", "objects")),
        ", ".join(f"{phase} {seconds:.1f}" for phase, seconds in facts["seconds"].items()),
        *(c.columns()[2] for c in classes),
        " / ".join(f"{c.unknown_percent:.2f}" for c in classes),
        *_kept(facts.get("kept")),
        f"{undecided_percent(made):.4f}",
        result.rays,
        result.wrong_hidden,
        f"{result.rays_per_second:,.0f}",
        f"{result.rate_ratio:.0%}" if result.embree_rates else "-",
        f"{confirmed:,}, {result.refuted:,}",
        commit(),
    ]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of `run`."""
    parser.add_argument("models", nargs="+", type=Path, metavar="MODEL")
    parser.add_argument("--rays", type=int, default=RAYS)


def run(options: argparse.Namespace) -> int:
    """Print the table; fails if something forbidden was found. Returns the exit code."""
    print_head(HEAD)
    stood = True
    for model in options.models:
        with tempfile.TemporaryDirectory() as scratch:
            made = bake(model, Path(scratch) / f"{model.stem}.bake")
            result = made.verify(rays=options.rays)
            print_row(columns(model.name, made, result))
            stood &= result.ok
    return 0 if stood else FAILED
