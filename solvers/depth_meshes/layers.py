"""A depth image in layers without cliffs: no skin is stretched between what is near and what lies far behind it.

Texels hang together where the step between neighbours is small; such patches are dealt out to layers so that none is
near another of its layer. Each layer gets a mesh of its own, that shows the texels of the layer and nothing else, so
heights around a patch are free, and no triangles are spent on silhouettes. From the middle of the cell the picture is
the same; an eye elsewhere sees between two patches what is behind them, where one mesh would have a skin.

The paper (Aliaga et al. 1999, section 3.1) lets skins stretch: "no special treatment of discontinuities is used".
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...data.depth_meshes import NOTHING

# Patches of one layer are at least so many texels apart: what joins them holds no texel of either.
APART = 3


def layers_of(parallax: np.ndarray, shown: np.ndarray, step: float) -> np.ndarray:
    """Layer of each texel, from 0, NOTHING where nothing is shown, shape (height, width), uint8.

    Args:
        parallax: [texels], shape (height, width), float64.
        shown: same shape, bool.
        step: neighbours that differ by more are in patches of their own, unless others join them [texels].
    """
    if not shown.any():
        return np.full(shown.shape, NOTHING, np.uint8)
    patches, count = _patches(parallax, shown, step)
    colour = np.full(count, NOTHING - 1)
    beside = _near_pairs(patches)
    starts = np.searchsorted(beside[:, 0], np.arange(count + 1))
    # The largest patches first, of equals the first: small ones find a place among few layers.
    for patch in np.argsort(-np.bincount(patches[patches >= 0], minlength=count), kind="stable").tolist():
        taken = set(colour[beside[starts[patch] : starts[patch + 1], 1]].tolist())
        # Beyond all layers but one patches may touch; a skin between them is stretched then, and measured.
        colour[patch] = next((layer for layer in range(NOTHING - 1) if layer not in taken), NOTHING - 1)
    return np.where(patches >= 0, colour[patches], NOTHING).astype(np.uint8)


def _patches(parallax: np.ndarray, shown: np.ndarray, step: float) -> tuple[np.ndarray, int]:
    """Patch of each texel, -1 where nothing is shown, and how many there are."""
    places = np.arange(shown.size).reshape(shown.shape)
    ends = []
    for a, b in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        joined = shown[a] & shown[b] & (np.abs(parallax[a] - parallax[b]) <= step)
        ends.append(np.stack([places[a][joined], places[b][joined]]))
    row, column = np.concatenate(ends, axis=1)
    joins = coo_array((np.ones(len(row), bool), (row, column)), shape=(shown.size, shown.size))
    label = connected_components(joins, directed=False)[1].reshape(shown.shape)
    used, label[shown] = np.unique(label[shown], return_inverse=True)
    return np.where(shown, label, -1), len(used)


def _near_pairs(patches: np.ndarray) -> np.ndarray:
    """Pairs of patches with texels closer than APART along both axes, each way, ascending, shape (k, 2)."""
    found, (height, width) = [np.zeros((0, 2), np.int64)], patches.shape
    for down in range(APART):
        for along in range(-APART + 1, APART):
            if down == 0 and along <= 0:
                continue
            a = patches[: height - down, max(0, -along) : width - max(0, along)]
            b = patches[down:, max(0, along) : width - max(0, -along)]
            apart = (a != b) & (a >= 0) & (b >= 0)
            pairs = np.stack([a[apart], b[apart]], axis=1)
            found.append(np.unique(pairs, axis=0) if len(pairs) else pairs)
    pairs = np.concatenate(found)
    return np.unique(np.concatenate([pairs, pairs[:, ::-1]]), axis=0)
