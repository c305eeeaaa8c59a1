"""A finished bake in a few lines, for people."""

from itertools import pairwise
from typing import TYPE_CHECKING

from ..data.plural import counted

if TYPE_CHECKING:
    from ..data.carving import Faces
    from ..data.store.bake_folder import BakeFolder

SKIPPED_SHOWN = 3
KINDS = ("axial", "semi-axial", "non-axial")


def summary(bake: "BakeFolder") -> str:
    """Counts, potential and seen pairs, seconds, and what was left out."""
    from ..verify.findings import count_pairs

    counts, facts = bake.manifest["counts"], bake.manifest
    because = facts.get("inhabitable_because", "as its cells table says")
    lines = [
        f"{counted(counts['cells'], 'cell')}, {counts['inhabitable']:,} inhabitable ({because})",
        f"{counted(counts['portals'], 'portal')}, {counted(counts['objects'], 'object')}",
    ]
    if facts.get("yaw_deg"):
        lines.append(
            f"turned back by {facts['yaw_deg']:g} degrees, so that most walls stand along the axes (--yaw 0: not)"
        )
    lines += [f"warning: {text}" for text in facts.get("warnings", [])]
    rows = [(c.name, *c.columns()) for c in count_pairs(bake)]
    lines += ["", table(("seen from inhabitable cells", "potential", "seen", "overestimate", "unknown"), rows), ""]
    if facts.get("kept"):
        lines += [*kept_lines(facts["kept"]), ""]
    if counts.get("potential_triangles"):
        share = 100.0 * counts["back_facing_triangles"] / counts["potential_triangles"]
        lines += [f"{share:.1f} % of the triangles in these sets face away from all of their cell", ""]
    if "closed_cracks" in counts:
        lines += [
            f"{counted(counts['closed_cracks'], 'crack')} closed; that alone hides "
            f"{counted(counts['leak_cell_pairs'], 'pair')} of cells "
            f"and {counts['leak_object_pairs']:,} of cells and objects, listed in leaks.parquet",
            "",
        ]
    if "proofs" in counts:
        lines += [_certificates(bake), ""]
    lines.append("seconds: " + ", ".join(f"{name} {value:.1f}" for name, value in facts["seconds"].items()))
    return "\n".join(lines + _skipped(facts.get("skipped", [])))


def kept_lines(kept: dict) -> list[str]:
    """What view cells keep, as the manifest has it, in a line or two."""
    lines = [
        f"kept by a view cell on average: {100 * kept['objects']:.1f} % of the objects, "
        f"{100 * kept['triangles']:.1f} % of the triangles"
    ]
    if eye := kept["eye"]:
        lines.append(
            f"kept / eye: {eye['median']:.2f} in the median, {eye['worst']:.2f} at worst (cell {eye['worst_cell']}); "
            f"{_eyes(eye)}"
        )
    return lines


def _eyes(eye: dict) -> str:
    return f"{counted(eye['eyes'], 'random eye')} in each of {counted(eye['cells'], 'cell')}"


def kept_rows(kept: dict) -> list[tuple[str, str]]:
    """The same as names and values."""
    rows = [(f"{name}, mean by volume", f"{100 * kept[name]:.1f} %") for name in ("objects", "triangles")]
    if eye := kept["eye"]:
        rows += [("kept / eye, median", f"{eye['median']:.2f}")]
        rows += [(f"kept / eye, worst (cell {eye['worst_cell']})", f"{eye['worst']:.2f}")]
        rows += [("random eyes", f"{eye['eyes']} in each of {counted(eye['cells'], 'cell')}")]
    return rows


def wall_words() -> list[str]:
    """What the shares of `Faces.walls_m2` are of."""
    from ..data.carving import BANDS

    near = [f"{low + 1} to {high} grid steps off" for low, high in pairwise(BANDS)]
    return ["exactly along an axis", *near, f"over {BANDS[-1]} off", "oblique or curved"]


def face_rows(faces: "Faces") -> list[tuple[str, str]]:
    """Faces of occluders by how they stand, as names and values."""
    rows = [
        (f"{kind} faces", f"{count:,}, {100 * share:.1f} % of their area")
        for kind, count, share in zip(KINDS, faces.counts, faces.shares, strict=True)
    ]
    rows.append(("non-axial elements, clusters", f"{faces.elements:,}, {faces.clusters:,}"))
    walls = zip(wall_words(), faces.wall_shares, strict=True)
    return rows + [(f"walls {word}", f"{100 * share:.1f} %") for word, share in walls]


def _certificates(bake: "BakeFolder") -> str:
    """Number of proofs, their size on disk, and what it took to write them down."""
    from ..data.store.certificates import TABLES

    count, seconds = bake.manifest["counts"]["proofs"], bake.manifest["certificate_s"]
    size = sum((bake.folder / f"{name}.parquet").stat().st_size for name in TABLES)
    each = max(count, 1)
    return (
        f"{counted(count, 'proof')}, a proof {size / each:,.0f} bytes and {1e6 * seconds / each:,.0f} us to write down"
    )


def _skipped(skipped: list[dict[str, str]]) -> list[str]:
    if not skipped:
        return []
    lines = [f"skipped {len(skipped):,}:"]
    lines += [
        f"  {' '.join(part['what'].split())}: {' '.join(part['why'].split())}" for part in skipped[:SKIPPED_SHOWN]
    ]
    if len(skipped) > SKIPPED_SHOWN:
        lines.append("  ... (all of them are in manifest.json)")
    return lines


def table(head: tuple[str, ...], rows: list[tuple]) -> str:
    """Rows in columns: the first to the left, the others, numbers, to the right."""
    cells = [head, *([f"{value:,}" if isinstance(value, int) else str(value) for value in row] for row in rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(head))]
    lines = []
    for row in cells:
        padded = [text.rjust(width) for text, width in zip(row[1:], widths[1:], strict=True)]
        lines.append("  ".join([row[0].ljust(widths[0]), *padded]))
    return "\n".join(lines)
