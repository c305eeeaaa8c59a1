"""A face of a view cell's far side as an item of a display database: a PNG and its meshes.

Little-endian: texels, layers and bytes of the PNG, uint32; of each layer its vertices and triangles, uint32, and error
[texels], float32; the PNG; the meshes, compressed by zlib.

The PNG has a pixel for each texel, top row first: red + 256 green is 1 + the rank among the cell's far objects, 0 for
none, and blue the layer. Meshes are columns of uint32, those of all layers one after another: along the rows of texels
the step from vertex to vertex of a layer, the first from 0; the step of their heights in PARALLAX_STEP, 2 s for s >= 0
and -2 s - 1 below; the step of the triangles' first vertices; from there to the second, and to the third. Of each
column the low bytes come first, then the next ones.
"""

import io
import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from PIL import Image

from ..depth_meshes import NOTHING, PARALLAX_STEP, DepthMesh, FarSide
from ..errors import InputError
from ..ragged import owners_of, starts_of

RANKS_MOST = 2**16 - 1


@dataclass(frozen=True)
class FaceItem:
    """A face as it is stored.

    Attributes:
        ranks: of the object that each texel shows among the cell's far objects, -1 for none, (texels, texels), int32.
        layers: of each texel, NOTHING where nothing is shown, uint8.
        meshes: of each layer.
    """

    ranks: np.ndarray
    layers: np.ndarray
    meshes: tuple[DepthMesh, ...]


def encode_face(side: FarSide, face: int) -> bytes:
    """One face of a far side.

    Raises:
        InputError: more far objects than ranks.
    """
    if len(side.far) > RANKS_MOST:
        raise InputError(f"depth meshes: expected at most {RANKS_MOST:,} objects on them, found {len(side.far):,}")
    meshes, ids = side.meshes[face], side.ids[face]
    ranks = np.where(ids < 0, 0, np.searchsorted(side.far, ids) + 1)
    picture = np.stack([ranks & 255, ranks >> 8, side.layers[face]], axis=-1).astype(np.uint8)
    png = io.BytesIO()
    Image.fromarray(picture).save(png, "PNG", optimize=True)
    head = [np.array([len(ids), len(meshes), png.tell()], "<u4").tobytes()]
    head += [np.array([len(m.pixels), len(m.triangles)], "<u4").tobytes() + np.float32(m.error) for m in meshes]
    places = [m.pixels[:, 1].astype(np.int64) * len(ids) + m.pixels[:, 0] for m in meshes]
    heights = [np.round(m.parallax.astype(np.float64) / PARALLAX_STEP).astype(np.int64) for m in meshes]
    corners = [m.triangles.astype(np.int64) for m in meshes]
    columns = [
        _steps(places),
        _folded(_steps(heights)),
        _steps([c[:, 0] for c in corners]),
        *(np.concatenate([np.zeros(0, np.int64), *(c[:, k] - c[:, 0] for c in corners)]) for k in (1, 2)),
    ]
    planes = b"".join(np.ascontiguousarray(c.astype("<u4").view(np.uint8).reshape(-1, 4).T).tobytes() for c in columns)
    return b"".join([*head, png.getvalue(), zlib.compress(planes, 9)])


def decode_face(data: bytes, where: str) -> FaceItem:
    """A face from its bytes.

    Args:
        data: as of `encode_face`.
        where: for complaints.

    Raises:
        InputError: they are none, cut short or altered so that anything in them names what is not there.
    """
    try:
        texels, layers, size = np.frombuffer(data, "<u4", 3).astype(np.int64).tolist()
        head = np.frombuffer(data, "<u4", 3 * layers, 12).reshape(layers, 3)
        (vertices, triangles), errors = head[:, :2].T.astype(np.int64), head[:, 2].copy().view("<f4")
        first = 12 + 12 * layers
        # Pillow says all of these of damaged files.
        with Image.open(io.BytesIO(data[first : first + size]), formats=["PNG"]) as image:
            picture = np.asarray(image).astype(np.int32)
        planes = np.frombuffer(zlib.decompress(data[first + size :]), np.uint8)
    except (ValueError, OSError, SyntaxError, zlib.error, struct.error, Image.DecompressionBombError):
        raise InputError(f"{where}: expected a face of depth meshes, found other bytes") from None
    sizes = np.array([vertices.sum()] * 2 + [triangles.sum()] * 3)
    if picture.shape != (texels, texels, 3) or len(planes) != 4 * sizes.sum():
        raise InputError(f"{where}: expected {texels} texels a side and {sizes[0]:,} vertices, found others")
    ends = starts_of(4 * sizes)
    columns = [
        np.ascontiguousarray(planes[a:b].reshape(4, -1).T).view("<u4").ravel().astype(np.int64)
        for a, b in pairwise(ends)
    ]
    vertex_starts, triangle_starts = starts_of(vertices), starts_of(triangles)
    places, begins = _sums(columns[0], vertex_starts), _sums(columns[2], triangle_starts)
    heights = _sums(np.where(columns[1] & 1, -(columns[1] >> 1) - 1, columns[1] >> 1), vertex_starts)
    corners = np.column_stack([begins, begins + columns[3], begins + columns[4]])
    # Altered bytes may come to anything: sums of 32 bits each do not overflow 64.
    if (places >= texels**2).any() or (corners >= vertices[owners_of(triangle_starts)][:, None]).any():
        raise InputError(f"{where}: expected vertices on the image and triangles of them, found others")
    ranks, shown = picture[..., 0] + 256 * picture[..., 1] - 1, picture[..., 2]
    if (np.where(ranks < 0, NOTHING, shown) != shown).any() or (shown[ranks >= 0] >= layers).any():
        raise InputError(f"{where}: expected texels of {layers} layers, found others")
    pixels = np.column_stack([places % texels, places // texels]).astype(np.uint16)
    meshes = tuple(
        DepthMesh(
            pixels[a:b],
            (heights[a:b] * PARALLAX_STEP).astype(np.float32),
            corners[c:d].astype(np.uint32),
            float(error),
        )
        for a, b, c, d, error in zip(
            vertex_starts[:-1], vertex_starts[1:], triangle_starts[:-1], triangle_starts[1:], errors, strict=True
        )
    )
    return FaceItem(ranks, shown.astype(np.uint8), meshes)


def _steps(lists: Iterable[np.ndarray]) -> np.ndarray:
    """From each number of a list to the next, the first from 0."""
    return np.concatenate([np.zeros(0, np.int64), *(np.diff(one, prepend=0) for one in lists)])


def _sums(steps: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """The numbers again."""
    total = np.append(0, np.cumsum(steps))
    return total[1:] - np.repeat(total[starts[:-1]], np.diff(starts))


def _folded(numbers: np.ndarray) -> np.ndarray:
    """Whole numbers as such from 0, the small ones first."""
    return np.where(numbers < 0, -2 * numbers - 1, 2 * numbers)
