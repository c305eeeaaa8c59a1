"""Triangles of IFC products: which of their representations are bodies, and what ifcopenshell makes of them."""

import os
import re
from collections import defaultdict
from collections.abc import Hashable, Iterable
from dataclasses import dataclass

import numpy as np

from ..progress import phase

# Of these identifiers the first that a product has is its body, all of that name together; then any unknown one.
BODIES = ("body", "body-fallback", "facetation", "surface")
NO_BODIES = frozenset(
    "annotation axis boundary boundingbox box centerline centreline clearance cog direction footprint lighting path "
    "plan plan2d profile reference row sketch surveypoints symbol text walkingline".split()
)
NO_BODY_TYPES = frozenset(
    "annotation2d boundingbox curve curve2d curve3d fillarea geometriccurveset lightsource point pointcloud text "
    "vertex edge path".split()
)
NO_BODY_CONTEXTS = ("plan", "annotation", "sketch")
TRANSPARENCY = 0.05
# What a face without a style looks like beside faces that have one.
UNSTYLED = (179, 179, 179, 255)


@dataclass(frozen=True)
class Shape:
    """A product's triangles.

    Attributes:
        key: equal for products that share the triangles and their colours.
        vertices: [m], in the product's own frame, shape (n, 3), float64.
        faces: shape (m, 3), int32.
        transform: product's frame to the model's, shape (4, 4), float64.
        colours: shape (m, 4), uint8, as in `Mesh`; None where no face has a style.
        glazed: whether some face lets light pass. To call a part-glazed object transparent hides nothing wrongly.
    """

    key: Hashable
    vertices: np.ndarray
    faces: np.ndarray
    transform: np.ndarray
    colours: np.ndarray | None
    glazed: bool

    def placed(self) -> np.ndarray:
        """Vertices in the model's frame [m]."""
        return self.vertices @ self.transform[:3, :3].T + self.transform[:3, 3]


def keep_bodies(products: Iterable) -> dict[int, str]:
    """Take from products, in memory, the representations that are no bodies; one without items stops the iterator.

    Returns:
        Why a product has no body, for each that had a representation and now has none, by its number in the file.
    """
    lost, known = {}, {}
    for product in products:
        shape = product.Representation
        if shape is None:
            continue
        if shape.id() not in known:
            known[shape.id()] = _keep(shape)
        if known[shape.id()]:
            lost[product.id()] = known[shape.id()]
            product.Representation = None
    return lost


def _keep(shape: object) -> str:
    """Leave a product's shape its bodies; or say why it has none."""
    every = list(shape.Representations or ())
    bodies = [one for one in every if _is_body(one)]
    filled = [one for one in bodies if _is_filled(one)]
    if not filled:
        if bodies:
            return "its body has no items"
        names = sorted({one.RepresentationIdentifier or one.RepresentationType or "unnamed" for one in every})
        return f"no body, only {' and '.join(names)}" if names else "no representation"
    rank = min(map(_rank, filled))
    kept = [one for one in filled if _rank(one) == rank]
    if kept != every:
        shape.Representations = kept
    return ""


def _is_body(representation: object) -> bool:
    context = representation.ContextOfItems
    return (
        _plain(representation.RepresentationIdentifier) not in NO_BODIES
        and _plain(representation.RepresentationType) not in NO_BODY_TYPES
        and _plain(context and context.ContextType) not in NO_BODY_CONTEXTS
    )


def _rank(representation: object) -> int:
    name = _plain(representation.RepresentationIdentifier)
    return BODIES.index(name) if name in BODIES else len(BODIES)


def _plain(text: str | None) -> str:
    return (text or "").strip().lower()


def _is_filled(representation: object) -> bool:
    """Whether a representation has an item that is no copy of nothing."""
    return any(not item.is_a("IfcMappedItem") or _leads_somewhere(item) for item in representation.Items or ())


def _leads_somewhere(item: object) -> bool:
    source = item.MappingSource
    return source is not None and source.MappedRepresentation is not None and _is_filled(source.MappedRepresentation)


def shapes_of(ifc: object, **selection: list) -> dict[int, Shape]:
    """Triangulated products by their numbers in the file, in the order of these.

    Args:
        ifc: the file.
        selection: `include` or `exclude`, and the products.
    """
    import ifcopenshell.geom

    if not selection.get("include", True):
        return {}
    iterator = ifcopenshell.geom.iterator(_settings(), ifc, os.cpu_count() or 1, **selection)
    found = defaultdict(list)
    with phase("geometry", 100, "%") as bar:
        more = iterator.initialize()
        while more:
            piece = iterator.get()
            found[piece.id].append(piece)
            more = iterator.next()
            bar.reach(iterator.progress())
    return {number: _shape(found[number]) for number in sorted(found)}


def shape_alone(product: object, representation: object | None = None) -> Shape | None:
    """A product's shape made by itself, which one that the iterator passes over may have; None if it has none."""
    import ifcopenshell.geom

    try:
        return _shape([ifcopenshell.geom.create_shape(_settings(), product, representation)])
    except RuntimeError:
        return None


def _settings() -> object:
    import ifcopenshell.geom

    settings = ifcopenshell.geom.settings()
    settings.set("weld-vertices", True)
    # A colour that stands for a missing one is none.
    settings.set("apply-default-materials", False)
    settings.set("keep-bounding-boxes", True)
    return settings


def _shape(pieces: list) -> Shape:
    """The pieces, one for each body of a product and in any order, as one shape."""
    pieces = sorted(pieces, key=lambda piece: [int(number) for number in re.findall(r"\d+", piece.geometry.id)])
    vertices, faces, colours, offset = [], [], [], 0
    for piece in pieces:
        vertices.append(np.array(piece.geometry.verts, np.float64).reshape(-1, 3))
        faces.append(np.array(piece.geometry.faces, np.int32).reshape(-1, 3) + np.int32(offset))
        colours.append(_colours(piece.geometry, len(faces[-1])))
        offset += len(vertices[-1])
    transform = np.array(pieces[0].transformation.matrix, np.float64).reshape(4, 4).T
    painted = np.concatenate(colours)
    styled = bool((painted[:, 3] >= 0).any())
    levels = [
        piece.geometry.materials[i].transparency for piece in pieces for i in {*piece.geometry.material_ids} if i >= 0
    ]
    painted[painted[:, 3] < 0] = UNSTYLED
    return Shape(
        key=(tuple(piece.geometry.id for piece in pieces), painted.tobytes() if styled else b""),
        vertices=np.concatenate(vertices),
        faces=np.concatenate(faces),
        transform=transform,
        colours=painted.astype(np.uint8) if styled else None,
        glazed=any(level is not None and level > TRANSPARENCY for level in levels),
    )


def _colours(geometry: object, count: int) -> np.ndarray:
    """Red, green, blue and opacity of each face, shape (count, 4), int16; -1 where it has no style."""
    palette = np.full((len(geometry.materials) + 1, 4), -1, np.int16)
    for row, material in zip(palette, geometry.materials, strict=False):
        opacity = 1.0 if material.transparency is None or np.isnan(material.transparency) else 1 - material.transparency
        channels = np.nan_to_num([*material.diffuse.components, opacity])
        row[:] = np.round(255 * np.clip(channels, 0, 1))
    return palette[np.array(geometry.material_ids, np.int64).reshape(count)]
