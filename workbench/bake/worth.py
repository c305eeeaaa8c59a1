"""What a bake is worth: how much its view cells keep, and what makes that too much and what to do, a line each."""

import math
from typing import TYPE_CHECKING

import numpy as np

from ...data.graph import CellGraph
from ...data.kept import kept_shares, mean_kept
from ...data.leaks import cells_behind_cracks
from ...data.plural import counted
from ...data.prepared import PreparedModel
from ...data.room_cells import room_covers

if TYPE_CHECKING:
    from embreex.rtcore_scene import EmbreeScene

    from ...data.store.bake_folder import BakeFolder

# A bake that keeps a larger share of the model than this on average says so.
KEPT_MOST = 0.5
# Openings no wider than this may be meant by nobody [m].
CRACK_M = 0.05
# Rooms and cells that a warning names.
ROOMS_NAMED, LEAK_NAMED = 5, 12
LOOK = "viewcell inspect MODEL --picture plan.png"
PHASES = {
    "preparing": "while all that hides was prepared",
    "hiding": "before all that is hidden was found",
    "witnesses": "while witnesses were sought",
    "octree": "while the octree was refined",
}


def worth(
    model: PreparedModel | None,
    graph: CellGraph,
    pairs: tuple[np.ndarray, np.ndarray],
    facts: dict,
    seed: int = 0,
    *,
    eyes: bool = True,
    opaque: "EmbreeScene | None" = None,
) -> dict:
    """What the manifest says of a bake's worth: `kept`, `uncovered_rooms` and all `warnings`.

    Args:
        model: None for a bare graph, which has no objects to keep.
        graph: its cells.
        pairs: cell and object of each potential pair, shape (n,) each, int.
        facts: what the manifest says so far; its warnings come first.
        seed: of eyes and rays.
        eyes: whether to look from some, which takes long in a model of millions of triangles.
        opaque: as of `kept_by_eye`.
    """
    found, warnings = {}, list(facts.get("warnings", []))
    leak, budget = facts.get("leak_cells") or [], facts.get("budget")
    leaky = rooms = 0
    if model is not None:
        found["kept"] = kept_numbers(model, graph, pairs, seed, eyes=eyes, opaque=opaque)
        spaces, uncovered = model.scene.spaces, _uncovered_rooms(model, graph, facts)
        found["uncovered_rooms"], rooms = [room["name"] for room in uncovered], len(spaces)
        if spaces and graph.portal_count:
            leaky = int(cells_behind_cracks(model.scene, graph, CRACK_M).sum())
        warnings += _kept_words(found["kept"], _first_to_do(facts, bool(budget), bool(leak) or leaky > 0))
        warnings += _room_words(uncovered, rooms)
    warnings += _leak_words(leak, leaky, int(graph.inhabitable.sum()))
    warnings += _budget_words(budget)
    return found | {"warnings": warnings}


def told_worth(bake: "BakeFolder") -> tuple[dict | None, list[str]]:
    """What a bake keeps, None of a bare graph, and its warnings: as its manifest says, or found now if it does not."""
    manifest = bake.manifest
    if "kept" not in manifest and bake.scene is not None:
        pairs = tuple(bake.cell_to_object[name].to_numpy() for name in ("cell_id", "object_id"))
        manifest = manifest | worth(PreparedModel(bake.scene), bake.graph, pairs, manifest)
    return manifest.get("kept"), [str(text) for text in manifest.get("warnings", [])]


def kept_numbers(
    model: PreparedModel,
    graph: CellGraph,
    pairs: tuple[np.ndarray, np.ndarray],
    seed: int = 0,
    *,
    eyes: bool = True,
    opaque: "EmbreeScene | None" = None,
) -> dict:
    """Shares of objects and triangles kept, means by volume, and kept / eye, as JSON takes them.

    Args:
        model: the model.
        graph: its cells.
        pairs: cell and object of each potential pair, shape (n,) each, int.
        seed: of eyes and rays.
        eyes: as of `worth`.
        opaque: as of `kept_by_eye`.

    Returns:
        objects and triangles, from 0 to 1; and eye, None where no eye finds a place, or none looks: median and worst
        ratio of what a cell keeps to what an eye in it sees, the worst cell, the number of cells measured, and of eyes
        in each.
    """
    from ...verify.rays.eyes import kept_by_eye

    shares = kept_shares(graph.cell_count, *pairs, model.scene.triangle_counts)
    objects, triangles = (round(mean_kept(graph, share), 6) for share in shares)
    sample, eye = kept_by_eye(model.scene, model.closed, graph, pairs, seed, opaque) if eyes else None, None
    if sample is not None:
        ratio, cell = sample.ratios[sample.worst], int(sample.cells[sample.worst])
        eye = {"median": round(sample.median, 4), "worst": round(float(ratio), 4), "worst_cell": cell}
        eye |= {"cells": len(sample.cells), "eyes": sample.eyes}
    return {"objects": objects, "triangles": triangles, "eye": eye}


def _uncovered_rooms(model: PreparedModel, graph: CellGraph, facts: dict) -> list[dict]:
    """Rooms that view cells do not cover, as the manifest has them under `rooms`; found now if it has none."""
    rooms = facts.get("rooms")
    # Whoever gives view cells knows where they are not.
    if rooms is None and facts.get("inhabitable_because") not in ("given", "octree", "walkways"):
        rooms = [cover.entry for cover in room_covers(model.scene, graph, model.room_points)]
    return [room for room in rooms or [] if "why" in room]


def _first_to_do(facts: dict, budget: bool, leak: bool) -> str:
    """What is likeliest to make cells keep less."""
    if budget:
        return "the budget ended early: first give it more"
    if leak:
        return "the outside leaks in: first close that"
    if facts.get("inhabitable_because") == "given":
        return "smaller view cells keep less"
    if facts.get("inhabitable_because") == "walkways":
        return "such small cells keep little that no eye in them sees, if the model is not one open hall"
    if facts.get("inhabitable_because") == "octree":
        return "a smaller --cell-size or a larger --depth keeps less, if the model is not one open hall"
    return (
        f"{LOOK} shows whether doors were not told (--doors-by), cracks leak (--seal), walls stand off the axes "
        "(--yaw) or rooms are missing; --refine-kept 1.5 halves long cells; one open hall keeps what it shows"
    )


def _kept_words(kept: dict, do: str) -> list[str]:
    name = max(("objects", "triangles"), key=lambda name: kept[name])
    if kept[name] <= KEPT_MOST:
        return []
    return [f"a view cell keeps {100 * kept[name]:.0f} % of the {name} on average, so little is culled; {do}"]


def _room_words(uncovered: list[dict], rooms: int) -> list[str]:
    if not uncovered:
        return []
    shown = uncovered[:ROOMS_NAMED]
    named = ", ".join(f"{room['name']!r} ({100 * room['covered']:.0f} %: {room['why']})" for room in shown)
    more = f" and {len(uncovered) - ROOMS_NAMED:,} more" if len(uncovered) > ROOMS_NAMED else ""
    verb = "is" if len(uncovered) == 1 else "are"
    return [
        f"{len(uncovered):,} of {counted(rooms, 'room')} {verb} not covered by view cells, so not all that one sees "
        f"there is known: {named}{more}; --cells octree --method occluders looks from all that can be walked"
    ]


def _leak_words(leak: list[int], leaky: int, inhabitable: int) -> list[str]:
    words = []
    if leak:
        shown = ", ".join(str(cell) for cell in leak[:LEAK_NAMED]) + (", ..." if len(leak) > LEAK_NAMED else "")
        words.append(
            f"the outside leaks into the middle of the building, through cells {shown}; {LOOK} shows the way, "
            f"--seal {CRACK_M:g} closes cracks, --doors-by tells doors"
        )
    if leaky:
        words.append(
            f"through cracks alone the outside leaks into {leaky:,} of {counted(inhabitable, 'inhabitable cell')}; "
            f"{LOOK} shows them, --seal {CRACK_M:g} closes them"
        )
    return words


def _budget_words(budget: dict | None) -> list[str]:
    if not budget:
        return []
    do = "give it more"
    if budget["needed_s"] is not None:
        do = f"--budget {_rounded_up(budget['needed_s']):g} is about enough"
    if budget.get("minute") and budget["minute"] < budget["cells"]:
        do = f"another minute finishes about {budget['minute']:,} of those, {do}"
    verb = "is" if budget["pairs"] == 1 else "are"
    left = f"{counted(budget['pairs'], 'pair')} of {counted(budget['cells'], 'view cell')}"
    return [
        f"the budget of {budget['budget_s']:g} s ended early, {PHASES[budget['phase']]}: {left} {verb} "
        f"left undecided, and kept; {do}, and the same command goes on from here"
    ]


def _rounded_up(seconds: float) -> float:
    """A tenth more, to two digits."""
    step = 10.0 ** (math.floor(math.log10(max(seconds, 0.1))) - 1)
    return math.ceil(1.1 * seconds / step) * step
