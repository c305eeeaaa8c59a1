"""What a pack says of itself."""

import numpy as np

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
            *_depth_words(walk),
            "",
            table(("file", "bytes"), rows),
        ]
    )


def _depth_words(walk: WalkFolder) -> list[str]:
    """What depth meshes take and are off by, where there are some or might have been."""
    index, counts = walk.depth_meshes, walk.manifest["counts"]
    if not walk.manifest["depth_meshes"]:
        return []
    if not len(index):
        return ["depth meshes: none, as they pay in no view cell"]
    return [
        f"depth meshes: {len(index):,} of {counted(counts['view_cells'], 'view cell')}, "
        f"{index.faces.sum(axis=1).mean():,.0f} triangles and {index.sizes.sum() / len(index):,.0f} bytes a view cell; "
        f"cull boxes of {np.median(index.cull_boxes):.0f} m; no texel off by more than {index.errors.max():.2f}, "
        f"no level by more than {index.pixels.max():.2f} pixels"
    ]
