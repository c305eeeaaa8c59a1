"""Shrunk occluders in rationals, written from the mathematics and not from the kernel. Twin of `kernels/shrink.py`."""

from fractions import Fraction

from ..arithmetic import Vector, clip, dot
from .umbra import Occluder

__all__ = ["shrunk"]


def shrunk(o: Occluder, v: Vector, depth: Fraction | None = None) -> list[list[Fraction]]:
    """The part of the outline for which all that lies behind it, seen from v, is in the umbra.

    Args:
        o: cell and outline.
        v: in front of the plane.
        depth: limit on h(x), in the scale of `normal`; None for none.
    """
    height = -o.depth(v)
    if o.planes is None or height <= 0:
        return []
    polygon = o.outline
    for m, c in o.planes:
        bound = dot(m, v) if depth is None else (c + depth / height * dot(m, v)) / (1 + depth / height)
        polygon = clip(polygon, m, max(c, bound)) if polygon else []
    return polygon
