"""IFC files, through ifcopenshell.

Products are sorted by GlobalId, because the geometry threads deliver them in any order. Products that share one
geometry share one definition.
"""

import os
import re
import tempfile
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..scene import Scene, Space
from .assemble import Model, Part, assemble
from .roles import RoleRules

# The geometry of these is no surface that anything could stand before.
NOT_OBJECTS = ("IfcOpeningElement", "IfcAnnotation", "IfcGrid", "IfcVirtualElement", "IfcSpatialElement")
NOT_OBJECTS_2X3 = ("IfcFeatureElement", "IfcSpatialStructureElement", "IfcPort", "IfcStructuralItem")
OLD_SCHEMA = re.compile(rb"(FILE_SCHEMA\s*\(\s*\(\s*')(IFC2X_FINAL|IFC2X2_FINAL|IFC2X2|IFC2X)(')", re.IGNORECASE)
STAR = re.compile(r"[(,]\*[,)]")
TRANSPARENCY = 0.05


def read_ifc(path: Path, model: Model, roles: RoleRules) -> Scene:
    """Scene of an IFC2x, IFC2x3, IFC4 or IFC4x3 file.

    Args:
        path: the file; it is never written to.
        model: source, sha256 and grid step; filled in here.
        roles: what is glass, a door, or left out.

    Raises:
        InputError: the file is no IFC file, or holds nothing opaque that can be read.
    """
    ifc = _open(path)
    model.unit = _unit(ifc)
    _mend_stars(ifc, model)
    shapes = {shape.guid: shape for shape in _shapes(ifc, exclude=("IfcOpeningElement", "IfcAnnotation", "IfcGrid"))}
    products = {product.GlobalId: product for product in ifc.by_type("IfcProduct")}
    for guid in sorted(shapes):
        _take(products[guid], shapes[guid], model, roles)
    _note_failures(ifc, shapes, model)
    _find_openings(ifc, shapes, model)
    return assemble(model)


def _open(path: Path) -> object:
    import ifcopenshell

    try:
        content = path.read_bytes()
        # Old headers are refused by name only; entities of IFC2x are read as those of IFC2x3.
        mended = OLD_SCHEMA.sub(rb"\1IFC2X3\3", content[:65536], count=1) + content[65536:]
        if not content.lstrip()[:13].upper().startswith(b"ISO-10303-21"):
            raise InputError(f"{path}: expected an IFC file (ISO-10303-21), found {content[:24]!r}")
        if mended == content:
            return ifcopenshell.open(str(path))
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "copy.ifc"
            copy.write_bytes(mended)
            return ifcopenshell.open(str(copy))
    except InputError:
        raise
    except Exception as error:  # the parser raises RuntimeError, OSError and its own types
        raise InputError(f"{path}: expected a readable IFC file, found {' '.join(str(error).split())}") from None


def _mend_stars(ifc: object, model: Model) -> None:
    """Empty the attributes that hold `*` against the schema: their products would be refused for a name.

    Only the copy in memory changes.
    """
    mended = 0
    for entity in [*ifc.by_type("IfcProduct"), *ifc.by_type("IfcProductDefinitionShape")]:
        if STAR.search(str(entity)):
            for i in [i for i, value in enumerate(entity) if value is None]:
                entity[i] = None
            mended += entity.is_a("IfcProduct")
    if mended:
        model.skip(f"{mended} of the products", "names or other attributes given as * against the schema: left out")


def _unit(ifc: object) -> str:
    import ifcopenshell.util.unit

    unit = ifcopenshell.util.unit.get_project_unit(ifc, "LENGTHUNIT")
    if unit is None:
        return "metre"
    return ((getattr(unit, "Prefix", None) or "") + (unit.Name or "metre")).lower()


def _shapes(ifc: object, **selection: object) -> list:
    """Triangulated shapes in their own frames, metres; in any order."""
    import ifcopenshell.geom

    settings = ifcopenshell.geom.settings()
    settings.set("weld-vertices", True)
    chosen = {key: [entity for name in names for entity in _by_type(ifc, name)] for key, names in selection.items()}
    if not all(chosen.values()) and "include" in chosen:
        return []
    iterator = ifcopenshell.geom.iterator(settings, ifc, os.cpu_count() or 1, **chosen)
    shapes = []
    more = iterator.initialize()
    while more:
        shapes.append(iterator.get())
        more = iterator.next()
    return shapes


def _by_type(ifc: object, name: str) -> list:
    try:
        return list(ifc.by_type(name))
    except RuntimeError:  # the file's schema has no such class
        return []


def _take(product: object, shape: object, model: Model, roles: RoleRules) -> None:
    """Add one product to the model as a space or an object, or to neither."""
    vertices, faces = _buffers(shape)
    transform = np.array(shape.transformation.matrix, np.float64).reshape(4, 4).T
    if product.is_a("IfcSpace"):
        if len(faces):
            # Names of rooms repeat from floor to floor and may be missing: the GlobalId is what a row can be found by.
            name = product.Name or product.GlobalId
            model.spaces.append(Space(name, vertices @ transform[:3, :3].T + transform[:3, 3], faces))
        return
    if any(product.is_a(name) for name in NOT_OBJECTS + NOT_OBJECTS_2X3) and not product.is_a("IfcSite"):
        return
    name = product.Name or product.GlobalId
    kind = product.is_a()
    if roles.leaves_out(name, product.GlobalId, kind):
        model.skip(name, f"{kind}: left out as asked")
        return
    glazed = "glass: a transparent material" if _glazed(shape) else ""
    taken = roles.of_product(
        product.is_a,
        f"{name} {product.ObjectType or ''}",
        kind,
        in_curtain_wall=_in_curtain_wall(product),
        glazed=glazed,
    )
    key = shape.geometry.id
    model.parts.append(
        Part(name, kind, taken.role, key, vertices, faces, transform, guid=product.GlobalId, why=taken.why)
    )


def _buffers(shape: object) -> tuple[np.ndarray, np.ndarray]:
    vertices = np.array(shape.geometry.verts, np.float64).reshape(-1, 3)
    return vertices, np.array(shape.geometry.faces, np.int32).reshape(-1, 3)


def _in_curtain_wall(product: object) -> bool:
    if getattr(product, "PredefinedType", None) == "CURTAIN_PANEL":
        return True
    return any(link.RelatingObject.is_a("IfcCurtainWall") for link in getattr(product, "Decomposes", None) or ())


def _glazed(shape: object) -> bool:
    """Whether any face has a transparent material: calling a part-glazed object transparent hides nothing wrongly."""
    used = {i for i in shape.geometry.material_ids if i >= 0}
    levels = [shape.geometry.materials[i].transparency for i in used]
    return any(level is not None and level > TRANSPARENCY for level in levels)


def _note_failures(ifc: object, shapes: dict, model: Model) -> None:
    """List the products that have a representation but gave no shape."""
    import ifcopenshell

    reasons = dict(re.findall(r"^\[error\].*?\{([^}]{22})\} ([^\n]+)", ifcopenshell.get_log(), re.MULTILINE))
    for product in sorted(ifc.by_type("IfcElement"), key=lambda product: product.GlobalId):
        if product.Representation is None or product.GlobalId in shapes:
            continue
        if any(product.is_a(name) for name in NOT_OBJECTS + NOT_OBJECTS_2X3):
            continue
        reason = reasons.get(product.GlobalId, "no geometry that can be triangulated").strip().rstrip(":")
        model.skip(f"{product.is_a()} {product.GlobalId}", reason)


def _find_openings(ifc: object, shapes: dict, model: Model) -> None:
    """Boxes that shut the holes of rooms: voids, and the doors, windows and panes that fill none.

    The void, not the leaf in it: a leaf's box may be smaller than its hole, and one crack is enough to leak.
    """
    voids = sorted(_shapes(ifc, include=("IfcOpeningElement",)), key=lambda shape: shape.guid)
    boxed = {shape.guid for shape in voids}
    model.openings += [_box(shape) for shape in voids if len(shape.geometry.faces)]
    filled = {
        link.RelatedBuildingElement.GlobalId
        for link in _by_type(ifc, "IfcRelFillsElement")
        if link.RelatingOpeningElement.GlobalId in boxed
    }
    fillers = [product for name in ("IfcDoor", "IfcWindow", "IfcPlate") for product in _by_type(ifc, name)]
    for guid in sorted({product.GlobalId for product in fillers} - filled):
        if guid in shapes and len(shapes[guid].geometry.faces):
            model.openings.append(_box(shapes[guid]))


def _box(shape: object) -> np.ndarray:
    vertices, _ = _buffers(shape)
    transform = np.array(shape.transformation.matrix, np.float64).reshape(4, 4).T
    placed = vertices @ transform[:3, :3].T + transform[:3, 3]
    return np.array([placed.min(axis=0), placed.max(axis=0)])
