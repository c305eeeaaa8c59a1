"""IFC files, through ifcopenshell; an .ifczip is a zip archive with one of them.

Products are sorted by GlobalId, because the geometry threads deliver them in any order, and told apart by their numbers
in the file, because a GlobalId may stand there twice. Products that share one geometry share one definition.
"""

import re
import tempfile
from collections import Counter, defaultdict
from pathlib import Path

from ..errors import InputError
from ..extras import need
from ..scene import LOST_ROOM, Scene, Space
from .archive import only_file
from .assemble import Model, Part, assemble
from .ifc_materials import associations, glass_material, material_names, type_of
from .ifc_places import Places
from .ifc_schema import check_classes
from .ifc_shapes import Shape, keep_bodies, shape_alone, shapes_of
from .roles import RoleRules, Taken
from .step import check_step

# The geometry of these is no surface that anything could stand before.
NOT_OBJECTS = ("IfcOpeningElement", "IfcAnnotation", "IfcGrid", "IfcVirtualElement", "IfcSpatialElement")
NOT_OBJECTS_2X3 = ("IfcFeatureElement", "IfcSpatialStructureElement", "IfcPort", "IfcStructuralItem")
# Shown as lines, or cut from walls: nothing that a list of what is missing should hold.
UNSEEN = ("IfcOpeningElement", "IfcAnnotation", "IfcGrid")
OLD_SCHEMA = re.compile(rb"(FILE_SCHEMA\s*\(\s*\(\s*')(IFC2X_FINAL|IFC2X2_FINAL|IFC2X2|IFC2X)(')", re.IGNORECASE)
STAR = re.compile(r"[(,]\*[,)]")
NAMES_SHOWN = 5


def read_ifc(path: Path, model: Model, roles: RoleRules) -> Scene:
    """Scene of an IFC2x, IFC2x3, IFC4 or IFC4x3 file.

    Args:
        path: .ifc or .ifczip; it is never written to.
        model: source, sha256 and grid step; filled in here.
        roles: what is glass, a door, or left out.

    Raises:
        InputError: the file is no IFC file, is damaged, or holds nothing opaque that can be read.
    """
    ifc = _open(path)
    try:
        _take_all(ifc, model, roles)
    except (InputError, MemoryError):
        raise
    except Exception as error:  # an attribute that is none of its kind shows only when it is asked for
        found = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: expected a sound IFC file, found {found[:200]}") from None
    return assemble(model)


def _open(path: Path) -> object:
    need("ifcopenshell")
    import ifcopenshell

    content = _content(path)
    entities = check_step(path, content)
    # Old headers are refused by name only; entities of IFC2x are read as those of IFC2x3.
    mended = OLD_SCHEMA.sub(rb"\1IFC2X3\3", content[:65536], count=1) + content[65536:]
    try:
        if mended == content and path.suffix.lower() == ".ifc":
            ifc = ifcopenshell.open(str(path))
        else:
            with tempfile.TemporaryDirectory() as folder:
                copy = Path(folder) / "copy.ifc"
                copy.write_bytes(mended)
                ifc = ifcopenshell.open(str(copy))
        check_classes(path, ifc.schema_identifier, entities)
        if not ifc.by_type("IfcProject"):
            raise InputError(f"{path}: expected an IfcProject, which says the unit of length, found none")
        return ifc
    except InputError:
        raise
    except Exception as error:  # the parser raises RuntimeError, OSError and its own types
        raise InputError(f"{path}: expected a readable IFC file, found {' '.join(str(error).split())}") from None


def _content(path: Path) -> bytes:
    """The text of the IFC file."""
    if path.suffix.lower() == ".ifczip":
        return only_file(path, (".ifc",))
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: expected a readable file, found {error.strerror}") from None


def _take_all(ifc: object, model: Model, roles: RoleRules) -> None:
    model.unit = _unit(ifc)
    _mend_stars(ifc, model)
    products = {product.id(): product for product in ifc.by_type("IfcProduct")}
    boxes = _room_boxes(products)
    lost = keep_bodies(products.values())
    shapes = shapes_of(ifc, exclude=[product for name in UNSEEN for product in _by_type(ifc, name)])
    # One whose shape the iterator passed over, perhaps for the fault of another.
    for number, product in products.items():
        if product.Representation is not None and number not in shapes and not _is_any(product, UNSEEN):
            alone = shape_alone(product)
            if alone is not None:
                shapes[number] = alone
    order = sorted(shapes, key=lambda number: (products[number].GlobalId or "", number))
    places = Places(_metres(ifc))
    for number in order:
        _take(products[number], shapes[number], model, roles, places)
    _note_rooms(products, shapes, boxes, lost, model, places)
    _note_failures(products, shapes, lost, model)
    _note_others(products, shapes, model)
    _note_repeats([products[number] for number in order], model)
    _find_openings(ifc, shapes, model)


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


def _metres(ifc: object) -> float:
    """Length of the file's unit [m]."""
    import ifcopenshell.util.unit

    return float(ifcopenshell.util.unit.calculate_unit_scale(ifc))


def _by_type(ifc: object, name: str) -> list:
    try:
        return list(ifc.by_type(name))
    except RuntimeError:  # the file's schema has no such class
        return []


def _is_any(product: object, kinds: tuple[str, ...]) -> bool:
    return any(map(product.is_a, kinds))


def _is_object(product: object) -> bool:
    return product.is_a("IfcSite") or not _is_any(product, NOT_OBJECTS + NOT_OBJECTS_2X3)


def _name(product: object) -> str:
    # Names of rooms repeat from floor to floor and may be missing: the GlobalId is what a row can be found by.
    return product.Name or product.GlobalId or f"#{product.id()}"


def _room(product: object, shape: Shape, places: Places) -> Space:
    words = product.LongName or "", product.GlobalId or "", places.storey_of(product)
    return Space(_name(product), shape.placed(), shape.faces, *words)


def _take(product: object, shape: Shape, model: Model, roles: RoleRules, places: Places) -> None:
    """Add one product to the model as a space or an object, or to neither."""
    name, kind, guid = _name(product), product.is_a(), product.GlobalId or ""
    if product.is_a("IfcSpace"):
        if len(shape.faces):
            model.spaces.append(_room(product, shape, places))
        return
    if not _is_object(product):
        return
    if roles.leaves_out(name, guid, kind):
        model.skip(name, f"{kind}: left out as asked")
        return
    taken = _taken(product, shape, roles, places.metres)
    model.parts.append(
        Part(
            name,
            kind,
            taken.role,
            shape.key,
            shape.vertices,
            shape.faces,
            shape.transform,
            guid=guid,
            why=taken.why,
            colours=shape.colours,
            storey=places.storey_of(product),
            materials=material_names(product),
        )
    )


def _taken(product: object, shape: Shape, roles: RoleRules, metres: float) -> Taken:
    """What a product is taken for; a part of a wall or slab that has layers is what the whole is."""
    whole = _whole(product)
    as_what = whole if whole is not None and product.is_a("IfcBuildingElementPart") else product
    glazed = "glass: a surface style that lets light pass" if shape.glazed else glass_material(product, roles, metres)
    if not glazed and as_what is not product and not associations(product):
        glazed = glass_material(as_what, roles, metres)
    names = (product.Name, getattr(product, "ObjectType", None), getattr(type_of(product), "Name", None))
    return roles.of_product(
        as_what.is_a,
        " ".join(filter(None, names)),
        product.is_a(),
        in_curtain_wall=getattr(product, "PredefinedType", None) == "CURTAIN_PANEL"
        or (whole is not None and whole.is_a("IfcCurtainWall")),
        glazed=glazed,
    )


def _whole(product: object) -> object | None:
    """The element that a product is a part of; None if it is none's."""
    links = getattr(product, "Decomposes", None) or ()
    wholes = [link.RelatingObject for link in links if link.RelatingObject is not None]
    return next((whole for whole in wholes if whole.is_a("IfcElement")), None)


def _room_boxes(products: dict) -> dict[int, Shape]:
    """Shapes of the bounding boxes that rooms are given as, of those that have no other, by their numbers."""
    found = {}
    for number, product in products.items():
        if not product.is_a("IfcSpace") or product.Representation is None:
            continue
        for representation in product.Representation.Representations or ():
            if (representation.RepresentationIdentifier or "").lower() == "box":
                shape = shape_alone(product, representation)
                if shape is not None and len(shape.faces):
                    found[number] = shape
    return found


def _note_rooms(products: dict, shapes: dict, boxes: dict, lost: dict, model: Model, places: Places) -> None:
    """List the rooms without a body; where a bounding box is given it stands for the room."""
    rooms = [product for product in products.values() if product.is_a("IfcSpace")]
    for product in sorted(rooms, key=lambda product: (product.GlobalId or "", product.id())):
        number = product.id()
        if number in shapes and len(shapes[number].faces):
            continue
        why = lost.get(number, "no representation" if product.Representation is None else _reason(product))
        if number in boxes:
            model.spaces.append(_room(product, boxes[number], places))
            why += ": its bounding box stands for it"
        what = f"{LOST_ROOM}{_name(product)!r} (IfcSpace {product.GlobalId})"
        model.skip(what, f"a room without a body: {why}")


def _reason(product: object) -> str:
    """Why a product's representation gave no shape, by the geometry library's log."""
    import ifcopenshell

    found = re.findall(r"^\[error\].*?\{([^}]{22})\} ([^\n]+)", ifcopenshell.get_log(), re.MULTILINE)
    reason = dict(found).get(product.GlobalId, "no geometry that can be triangulated")
    return reason.strip().rstrip(":")


def _note_failures(products: dict, shapes: dict, lost: dict, model: Model) -> None:
    """List the elements that have a representation but gave no shape."""
    for product in sorted(products.values(), key=lambda product: (product.GlobalId or "", product.id())):
        number = product.id()
        if not product.is_a("IfcSpace") and _is_object(product) and number not in shapes:
            if number in lost or product.Representation is not None:
                model.skip(f"{product.is_a()} {product.GlobalId}", lost.get(number) or _reason(product))


def _note_others(products: dict, shapes: dict, model: Model) -> None:
    """Count the products that have a shape but are no things, such as zones and storeys."""
    others = Counter(
        products[number].is_a()
        for number in shapes
        if not products[number].is_a("IfcSpace") and not _is_object(products[number])
    )
    for kind in sorted(others):
        model.skip(f"{others[kind]} {kind}", f"{kind}: nothing that anybody could see")


def _note_repeats(products: list, model: Model) -> None:
    """List GlobalIds that stand for several products, and count names that do."""
    by_guid, by_name = defaultdict(list), Counter()
    for product in products:
        by_guid[product.GlobalId].append(product)
        if _is_object(product) and product.Name:
            by_name[product.Name] += 1
    for guid, same in sorted(by_guid.items(), key=lambda item: item[0] or ""):
        if len(same) > 1:
            named = ", ".join(f"#{product.id()} {_name(product)!r}" for product in same[:NAMES_SHOWN])
            model.note(f"GlobalId {guid}", f"stands for {len(same)} products, all kept: {named}")
    repeated = {name: count for name, count in by_name.items() if count > 1}
    if repeated:
        shared = f"{len(repeated)} names stand for {sum(repeated.values())} objects"
        model.note("names of objects", f"{shared}: GlobalIds tell them apart")


def _find_openings(ifc: object, shapes: dict, model: Model) -> None:
    """Boxes that shut the holes of rooms: voids, and the doors, windows and panes that fill none.

    The void, not the leaf in it: a leaf's box may be smaller than its hole, and one crack is enough to leak.
    """
    voids = shapes_of(ifc, include=_by_type(ifc, "IfcOpeningElement"))
    guid = {product.id(): product.GlobalId or "" for product in ifc.by_type("IfcProduct")}
    boxed = sorted((number for number in voids if len(voids[number].faces)), key=lambda number: (guid[number], number))
    model.openings += [voids[number].placed() for number in boxed]
    filled = {
        link.RelatedBuildingElement.id()
        for link in _by_type(ifc, "IfcRelFillsElement")
        if link.RelatingOpeningElement.id() in boxed
    }
    fillers = {product.id() for name in ("IfcDoor", "IfcWindow", "IfcPlate") for product in _by_type(ifc, name)}
    for number in sorted(fillers - filled, key=lambda number: (guid[number], number)):
        if number in shapes and len(shapes[number].faces):
            model.openings.append(shapes[number].placed())
