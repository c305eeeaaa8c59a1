"""Whether curtains are real, exactly: upright rectangles over two plan points that are opaque throughout.

The plane of a curtain is made a coordinate plane in whole numbers: along it, out of it and up. Then a curtain is a
rectangle of an axial plane, and what covers it are the triangles of that plane and the sections of closed elements just
beside it (verify/proofs/opaque.py).
"""

import numpy as np

from .opaque import Cover, OpaqueSurfaces, closed, covered, enters, flat_boundary, section


def is_opaque(surfaces: OpaqueSurfaces, ends: list[list[int]], low: int, high: int) -> bool:
    """Whether an upright rectangle is opaque to sightlines from outside solids.

    Args:
        surfaces: of the model.
        ends: plan points of its sides [grid steps].
        low: height of its lower edge.
        high: of its upper edge.
    """
    (ax, ay), (bx, by) = ends
    x, y = bx - ax, by - ay
    length = x * x + y * y
    if not length or low >= high:
        return False
    polygon = [(0, low), (length, low), (length, high), (0, high)]
    box = np.array([[min(ax, bx), min(ay, by), low], [max(ax, bx), max(ay, by), high]])
    flat, covers = [], []
    for part in surfaces.reaching(box):
        t = part - np.array([ax, ay, 0])
        # Along the rectangle, out of its plane, up: below 2**53.
        turned = np.stack([t[..., 0] * x + t[..., 1] * y, t[..., 1] * x - t[..., 0] * y, t[..., 2]], axis=-1)
        flat.append(turned[(turned[..., 1] == 0).all(axis=1)])
        if closed(part):
            covers += [Cover(section(turned, 1, 0, below=below)) for below in (True, False)]
    if flat:
        covers.append(Cover(flat_boundary(np.concatenate(flat)[:, :, [0, 2]])))
    return covered(polygon, [(cover, [e for e in cover.edges if enters(e, polygon)]) for cover in covers])
