"""What a pack says of itself."""

from ...data.plural import counted
from ...data.store.walk_folder import GEOMETRY, WalkFolder, column_bytes
from ..summary import table


def pack_text(walk: WalkFolder) -> str:
    """Sizes by part, and what the order of objects is worth."""
    counts, order, files = (walk.manifest[name] for name in ("counts", "order", "files"))
    sets = column_bytes(walk, "potential")
    masks = counts["view_cells"] * -(-counts["objects"] // 8)
    fewer = 100 * (1 - order["runs"] / max(1, order["runs_at_random"]))
    rows = [(name, f"{told['bytes']:,}") for name, told in files.items()]
    return "\n".join(
        [
            f"{counted(counts['objects'], 'object')} in {counted(counts['items'], 'item')} of {GEOMETRY}"
            f"{', flattened' if walk.manifest['flattened'] else ''}",
            f"{counted(counts['view_cells'], 'view cell')}: {counts['potential']:,} pairs, {counts['unknown']:,} of "
            f"them unknown, in {order['runs']:,} runs, {fewer:.1f} % fewer than in random order",
            f"sets: {sets:,} bytes, {sets / max(1, counts['view_cells']):.0f} a view cell, "
            f"{masks / sets:.1f} x smaller than bitmasks",
            "",
            table(("file", "bytes"), rows),
        ]
    )
