"""IFC files once more: product by product, body by body, without the iterator that the reader takes its shapes from."""

import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from zipfile import ZipFile, is_zipfile

import numpy as np

from ...data.errors import InputError
from ...data.scene import Definition, Instance, Mesh, Role, Scene
from .referee import Found, differences
from .step_words import StepWords
from .words import word_differences

NO_THINGS = (
    "IfcAnnotation IfcFeatureElement IfcGrid IfcPort IfcSpatialElement IfcSpatialStructureElement IfcStructuralItem "
    "IfcVirtualElement"
).split()
# A product's body is all its representations of the first of these names that it has any of.
BODY_NAMES = ("body", "body-fallback", "facetation", "surface")
OTHER_NAMES = (
    "annotation axis boundary box clearance cog footprint lighting plan profile reference row surveypoints walkingline"
).split()
FLAT_KINDS = ("curve2d", "curve3d", "boundingbox", "annotation2d", "geometriccurveset", "point", "pointcloud")
STARRED = re.compile(rb"=\s*(?:IFC\w+\s*\(\s*'[\w$]{22}'|IFCPRODUCTDEFINITIONSHAPE\s*\()[^;]*;", re.IGNORECASE)
# Less than this nobody can have on a grid of about a millimetre [m2].
NO_AREA = 1e-12


def differences_ifc(scene: Scene, path: Path) -> list[str]:
    """What a scene has otherwise than its file: objects and rooms lost, extra, moved, altered, or called otherwise.

    Args:
        scene: as read from the file, nothing left out.
        path: the .ifc file.

    Raises:
        InputError: the file cannot be opened.
    """
    things = differences(scene, found_ifc(path))
    things += [f"room {line}" for line in differences(_of_rooms(scene), found_ifc(path, rooms=True))]
    words = StepWords(_content(path))
    return things + word_differences(scene, words.objects(), words.rooms())


def found_ifc(path: Path, rooms: bool = False) -> Iterator[Found]:
    """Objects of an .ifc or .ifczip file by their GUIDs, or its rooms by their names.

    Raises:
        InputError: the file cannot be opened.
    """
    ifc = _open(path)  # its products do not keep it alive
    for product in ifc.by_type("IfcProduct"):
        if product.is_a("IfcSpace") != rooms:
            continue
        if rooms or product.is_a("IfcSite") or not any(map(product.is_a, NO_THINGS)):
            found = _found(product, rooms)
            if found is not None:
                yield found


def _content(path: Path) -> bytes:
    if not is_zipfile(path):
        return path.read_bytes()
    with ZipFile(path) as archive:
        return archive.read(next(name for name in archive.namelist() if name.lower().endswith(".ifc")))


def _open(path: Path) -> object:
    import ifcopenshell

    content = _content(path)
    head, rest = content[:4096], content[4096:]
    for old in (b"IFC2X_FINAL", b"IFC2X2_FINAL"):
        head = head.replace(b"'" + old + b"'", b"'IFC2X3'").replace(b"'" + old.lower() + b"'", b"'IFC2X3'")
    # Some write * where $ is meant, in entities that have a GUID and in the shapes of products.
    rest = STARRED.sub(lambda found: re.sub(rb"(?<=[,(])\*(?=[,)])", b"$", found[0]), rest)
    try:
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "model.ifc"
            copy.write_bytes(head + rest)
            return ifcopenshell.open(str(copy))
    except Exception as error:  # whatever the parser raises
        raise InputError(f"{path}: expected an IFC file, found {' '.join(str(error).split())}") from None


def _found(product: object, is_room: bool) -> Found | None:
    """A product as one object or room; None if it has no surface."""
    pieces = [corners for body in _bodies(product, is_room) if len(corners := _corners(product, body))]
    if not pieces:
        return None
    corners = np.concatenate(pieces)
    sides = corners[:, 1:] - corners[:, :1]
    area = float(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum() / 2)
    if area < NO_AREA:
        return None
    points = corners.reshape(-1, 3)
    key = (product.Name or product.GlobalId) if is_room else product.GlobalId
    return Found(key, np.array([points.min(axis=0), points.max(axis=0)]), area)


def _bodies(product: object, is_room: bool) -> list:
    every = product.Representation.Representations if product.Representation is not None else ()
    boxes = [one for one in every or () if _low(one.RepresentationIdentifier) == "box"]
    solid = [
        one
        for one in every or ()
        if one.Items
        and _low(one.RepresentationType) not in FLAT_KINDS
        and _low(one.ContextOfItems.ContextType) not in ("plan", "annotation")
    ]
    for name in BODY_NAMES:
        if bodies := [one for one in solid if _low(one.RepresentationIdentifier) == name]:
            return bodies
    unknown = [one for one in solid if _low(one.RepresentationIdentifier) not in OTHER_NAMES]
    return unknown or (boxes if is_room else [])


def _low(text: str | None) -> str:
    return (text or "").lower()


def _corners(product: object, body: object) -> np.ndarray:
    """Corners of the triangles of one body [m], shape (n, 3, 3), in the file's frame; none if none can be made."""
    import ifcopenshell.geom

    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    settings.set("keep-bounding-boxes", True)
    try:
        shape = ifcopenshell.geom.create_shape(settings, product, body).geometry
    except RuntimeError:
        return np.zeros((0, 3, 3))
    return np.array(shape.verts, float).reshape(-1, 3)[np.array(shape.faces, int).reshape(-1, 3)]


def _of_rooms(scene: Scene) -> Scene:
    """The rooms of a scene as its objects."""
    shapes = [Definition(space.name, (Mesh(space.vertices, space.faces),)) for space in scene.spaces]
    placed = [Instance(shape.name, "", i, np.eye(4), Role.DETAIL) for i, shape in enumerate(shapes)]
    return Scene(shapes, placed, origin=scene.origin, yaw_deg=scene.yaw_deg, grid_m=scene.grid_m)
