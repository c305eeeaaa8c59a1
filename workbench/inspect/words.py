"""An inspection in the words of those who model buildings: one screen, and a warning with its price and its cure."""

from collections import Counter
from collections.abc import Iterator
from textwrap import wrap

from ...data.plausible import implausible
from ...data.plural import counted
from ...data.scene import Role
from ..summary import KINDS, wall_words
from .cells import CRACKS_M
from .inspection import Inspection, Warning

WIDTH, INDENT = 112, 14
KINDS_SHOWN, TOLD_SHOWN, SKIPPED_SHOWN, NAMED = 5, 4, 3, 2
# Shares of upright faces off the main axes, and of opaque objects that are open, that are worth a word.
TURNED_SHARE, OPEN_SHARE = 0.1, 0.05
# Walls as near to an axis as this are meant to stand along it.
NEARLY_DEG = 0.5

# What is wrong, what it costs, and what to do.
Words = tuple[str, str, str]


def lines(found: Inspection) -> list[str]:
    """The screen, line by line."""
    scene, cells = found.scene, found.cells
    size = " x ".join(f"{x:,.1f}" for x in found.size_m)
    shift = ", ".join(f"{x:,.0f}" for x in scene.origin)
    turn = f" and turned back by {scene.yaw_deg:g} degrees" if scene.yaw_deg else ""
    moved = 1e3 * scene.max_snap_m()
    count, inhabitable, portals = cells.counts
    rows = [
        ("model", scene.source or "scene"),
        ("size", f"{size} m; moved by ({shift}) m{turn}; the grid moves no corner by more than {moved:.2g} mm"),
        ("unit", f"{scene.unit}: {found.unit_because}"),
        ("objects", _objects(found)),
        ("kinds", _counted(_by_kind(found.kinds), KINDS_SHOWN)),
        ("glass, doors", _counted(found.told, TOLD_SHOWN) or "none"),
        ("rooms", _rooms(found)),
        ("walls run", _directions(found)),
        ("walls stand", _walls_stand(found)),
        ("faces", _faces(found)),
        ("surfaces", _surfaces(found)),
        ("doubled", _doubled(found)),
        ("cells", f"{count:,}, {inhabitable:,} of them to stand in ({cells.because}); {portals:,} portals"
         if cells.graph is not None else cells.because),
        ("cracks", _cracks(found)),
        ("bake", _bake(found)),
    ]  # fmt: skip
    if found.differences is not None:
        rows.append(("second reader", "agrees" if not found.differences else f"{len(found.differences):,} differences"))
    out = [line for name, text in rows for line in wrapped(name, text)]
    out += [line for text in (found.differences or [])[:SKIPPED_SHOWN] for line in wrapped("", text)]
    for name, parts in (("skipped", scene.skipped), ("noted", scene.notes)):
        for number, part in enumerate(parts[:SKIPPED_SHOWN]):
            head = f"{name} {len(parts):,}" if number == 0 else ""
            out += wrapped(head, f"{part['what']}: {part['why']}")
        if len(parts) > SKIPPED_SHOWN:
            out.append(f"{'':14}... (--json lists all)")
    out.append("")
    if not found.warnings:
        return [*out, "fit to bake"]
    out.append("fit to bake, but" if found.ok else "not fit to bake")
    for warning in found.warnings:
        out += [line for name, text in (("-", warning.what), ("  costs", warning.costs), ("  do", warning.do))
                for line in wrapped(name, text, 9 if name != "-" else 2)]  # fmt: skip
    return out


def wrapped(name: str, text: str, indent: int = INDENT) -> list[str]:
    """A name and a text beside it, in lines no longer than a screen is wide."""
    return wrap(f"{name:<{indent}}{' '.join(text.split())}", WIDTH, subsequent_indent=" " * indent)


def _objects(found: Inspection) -> str:
    by_role = Counter()
    for (_, role), count in found.kinds.items():
        by_role[role] += count
    words = {Role.OCCLUDER: "occluders", Role.DETAIL: "furniture and details", Role.TRANSPARENT: "transparent"}
    parts = ", ".join(f"{by_role[role]:,} {word}" for role, word in words.items())
    return f"{len(found.scene.objects):,}: {parts}; {int(found.scene.triangle_counts.sum()):,} triangles"


def _by_kind(kinds: Counter) -> Counter:
    out: Counter = Counter()
    for (kind, _), count in kinds.items():
        out[kind] += count
    return out


def _counted(counter: Counter, most: int) -> str:
    shown = ", ".join(f"{count:,} {name}" for name, count in counter.most_common(most))
    rest = sum(counter.values()) - sum(count for _, count in counter.most_common(most))
    return shown + (f", {rest:,} others" if rest else "")


def _rooms(found: Inspection) -> str:
    lost = [part for part in found.scene.skipped if part["what"].startswith("IfcSpace") or "room" in part["why"]]
    text = f"{len(found.scene.spaces):,} with a body" if found.scene.spaces else "the model has none with a body"
    return text + (f", {len(lost):,} without" if lost else "")


def _directions(found: Inspection) -> str:
    ways = found.directions
    if ways is None:
        return "nothing upright is opaque"
    text = f"{100 * ways.axial:.1f} % of their area exactly along x or y"
    if ways.yaw > 0:
        off = min(ways.yaw_deg, 90.0 - ways.yaw_deg)
        turn = "less than a degree off that" if off <= NEARLY_DEG else f"turned by about {ways.yaw_deg:g} degrees"
        text += f", {100 * ways.yaw:.1f} % {turn}, {100 * ways.other:.1f} % otherwise"
    return text


def _walls_stand(found: Inspection) -> str:
    shares = zip(wall_words(), found.faces.wall_shares, strict=True)
    text = ", ".join(f"{100 * share:.1f} % {word}" for word, share in shares if share > 0)
    return text or "nothing upright occludes"


def _faces(found: Inspection) -> str:
    faces = found.faces
    kinds = zip(KINDS, faces.counts, faces.shares, strict=True)
    text = ", ".join(f"{count:,} {kind} ({100 * share:.1f} %)" for kind, count, share in kinds)
    if faces.elements:
        text += f"; {counted(faces.elements, 'non-axial element')} in {counted(faces.clusters, 'cluster')}"
    return text


def _surfaces(found: Inspection) -> str:
    faces = found.surfaces
    text = f"{faces.closed:,} closed opaque objects, {len(faces.open):,} open"
    turned = sum(one.turned for one in faces.open)
    if turned:
        text += f" ({turned:,} only by faces that are turned the wrong way)"
    if faces.inverted:
        text += f"; {len(faces.inverted):,} look inwards"
    return text


def _doubled(found: Inspection) -> str:
    faces = found.surfaces
    copies = sum(len(ids) - 1 for ids in faces.twins)
    parts = [f"{counted(faces.repeated, 'triangle')} within an object", counted(copies, "whole object")]
    if faces.overlaps is None:
        parts.append("coplanar faces not looked for in so large a model")
    else:
        area = sum(m2 for _, _, m2 in faces.overlaps)
        parts.append(f"{area:,.1f} m2 of coplanar faces of {counted(len(faces.overlaps), 'pair')} of objects")
    return ", ".join(parts)


def _cracks(found: Inspection) -> str:
    if found.cells.graph is None:
        return "not looked for in so large a model"
    counts = []
    for width in CRACKS_M:
        narrow = [crack for crack in found.cells.cracks if crack.width_m <= width]
        into = sum(crack.rooms for crack in narrow)
        counts.append(f"{len(narrow):,} openings up to {100 * width:g} cm wide, {into:,} of them of rooms")
    return "; ".join(counts)


def _bake(found: Inspection) -> str:
    seconds = found.cells.bake_s
    if seconds is None:
        return "not tried"
    span = f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"
    return f"about {span} on one core, guessed from a few cells; cutting took {found.cells.seconds:.1f} s"


def warnings(found: Inspection) -> list[Warning]:
    """What a user should know before a bake, what costs most first."""
    told = [*_reading(found), *_walls(found), *_rooms_and_gaps(found)]
    return [Warning(*words) for words in told]


def _reading(found: Inspection) -> Iterator[Words]:
    """What may not be as the file means it."""
    scene, cells = found.scene, found.cells
    if cells.graph is not None and not cells.graph.inhabitable.any():
        yield (
            "nowhere to stand was found",
            "there is nothing to bake",
            "add rooms (IfcSpace), or give bake --cells a table",
        )
    if found.differences:
        yield (
            f"a second reader finds {counted(len(found.differences), 'difference')}: {found.differences[0]}",
            "what is read is not what is written, and every answer is about what is read",
            "report the file; do not trust a bake of it",
        )
    if found.stray:
        name, away = found.stray[0]
        yield (
            f"{counted(len(found.stray), 'part')} far from the rest: {name!r}, by {away:,.0f} m",
            "large coordinates leave less room on the grid, and cells reach all the way",
            f"leave it out if it is no part of the building: --leave-out '{name}'",
        )
    # What has no area on the grid is nowhere missed, and what was left out was meant to be.
    lost = [part for part in scene.skipped if not any(word in part["why"] for word in ("no area", "as asked"))]
    if lost:
        yield (
            f"{counted(len(lost), 'part')} of the file not in the model: {lost[0]['what']}",
            "what is missing hides nothing, so more is called visible; it is never drawn",
            "look at all with --json, and mend those that should be walls",
        )
    for fault in implausible(scene):
        yield (
            f"as it is read, {fault.what}",
            "distances, storeys, cell sizes and levels of detail are off if it is read wrong",
            fault.do,
        )


def _walls(found: Inspection) -> Iterator[Words]:
    """What is wrong with surfaces."""
    faces, ways = found.surfaces, found.directions
    if ways is not None and 1.0 - ways.axial > TURNED_SHARE:
        turned = ways.yaw > TURNED_SHARE
        yield (
            f"{100 * (1 - ways.axial):.0f} % of the walls run along neither x nor y",
            "they cut no cells: rooms behind them share cells, and more stays unknown",
            "export with the building's own north" if turned else "expect looser sets, or bake with --cells octree",
        )
    if len(faces.open) > OPEN_SHARE * (faces.closed + len(faces.open)):
        named = ", ".join(repr(found.name(one.object_id)) for one in faces.open[:NAMED])
        yield (
            f"{counted(len(faces.open), 'opaque object')} open, such as {named}",
            "an open object hides by its faces only, not by its inside",
            "export solids instead of surfaces",
        )
    if faces.inverted:
        yield (
            f"{counted(len(faces.inverted), 'closed object')} looking inwards, as {found.name(faces.inverted[0])!r}",
            "nothing here, where both sides of a face hide; other programs may not draw them",
            "turn their faces round",
        )
    if faces.twins:
        copies = sum(len(ids) - 1 for ids in faces.twins)
        yield (
            f"{counted(copies, 'object')} there twice, such as {found.name(faces.twins[0][0])!r}",
            "both are drawn; which one is in front is a matter of chance",
            "delete the copies",
        )


def _rooms_and_gaps(found: Inspection) -> Iterator[Words]:
    """What is wrong with rooms."""
    cells = found.cells
    if cells.leak:
        box = cells.graph.cells[cells.leak[len(cells.leak) // 2]].mean(axis=0) * found.scene.grid_m
        place = ", ".join(f"{x:.1f}" for x in box)
        yield (
            f"the outside leaks into the middle of the building, through {len(cells.leak):,} cells, by ({place})",
            "rooms cannot be told from the outside: every roomy cell counts as a place to stand",
            "close the gap, or name rooms (IfcSpace); --picture shows the way",
        )
    into = [crack for crack in cells.cracks if crack.rooms]
    if into:
        place = ", ".join(f"{x:.2f}" for x in into[0].box.mean(axis=0))
        size = f"{1e3 * into[0].width_m:.0f} mm by {into[0].length_m:.1f} m at ({place})"
        near = f", near {into[0].between[0]!r}" if into[0].between else ""
        yield (
            f"{counted(len(into), 'crack')} up to {100 * CRACKS_M[-1]:g} cm wide into rooms: {size}{near}",
            "one sees through them, and a bake keeps what is seen; more cells, and more time",
            f"if they are not meant: bake with --seal {CRACKS_M[-1]:g}",
        )
