"""What a part of a model does to sight: occluder, detail or transparent, from its IFC class or its names.

Classes are tested by inheritance: a test for the exact name once made every `IfcSlabStandardCase` transparent.
"""

import re
from collections.abc import Callable
from functools import cache

from ..errors import InputError
from ..scene import Role

SEE_THROUGH = ("IfcWindow", "IfcCurtainWall")
BUILDING = ("IfcBuildingElement", "IfcBuiltElement")
# Elements of a building that are furniture to a visibility solver: they block rays and shape no cells.
ACCESSORIES = ("IfcFurnishingElement", "IfcElementComponent", "IfcBuildingElementPart", "IfcShadingDevice")
GLASS = re.compile(r"glass|glaz|translucent|transparent|verre|glas\b", re.IGNORECASE)
WINDOW = re.compile(r"window|fenster|fen[eê]tre", re.IGNORECASE)
DOOR = re.compile(r"(?<![a-z])doors?(?![a-z])", re.IGNORECASE)
FURNITURE = re.compile(
    r"furnitur|furnish|möbel|chair|stuhl|table|tisch|desk|sofa|couch|bench|shelf|shelves|cabinet|cupboard|wardrobe|"
    r"bed\b|lamp|plant|toilet|\bwc\b|sink|basin|bath|shower|heater|radiator|monitor|computer",
    re.IGNORECASE,
)
DOOR_CHOICES = ("open", "closed")


def check_doors(doors: str) -> None:
    """Accept "open" or "closed".

    Raises:
        InputError: anything else.
    """
    if doors not in DOOR_CHOICES:
        raise InputError(f"doors: expected open or closed, found {doors!r}")


def ifc_role(is_a: Callable[[str], bool], name: str, doors: str, in_curtain_wall: bool = False) -> Role:
    """Role of an IFC product, its materials aside.

    Args:
        is_a: whether the product's class is, or inherits from, the class of that name.
        name: the product's name and type, to tell proxies of furniture.
        doors: "open" (doors are transparent) or "closed" (they occlude).
        in_curtain_wall: the product is a part of a curtain wall; its plates are panes.
    """
    if is_a("IfcDoor"):
        return Role.OCCLUDER if doors == "closed" else Role.TRANSPARENT
    if any(map(is_a, SEE_THROUGH)) or (in_curtain_wall and is_a("IfcPlate")):
        return Role.TRANSPARENT
    if any(map(is_a, ACCESSORIES)) or not any(map(is_a, BUILDING)):
        return Role.DETAIL
    if is_a("IfcBuildingElementProxy") and FURNITURE.search(name):
        return Role.DETAIL
    return Role.OCCLUDER


def named_role(name: str, material: str, doors: str) -> tuple[Role, str]:
    """Role and kind of a part of a mesh file, from its own name and its material's.

    A name that holds an IFC class, such as `12|IfcDoor|Exit`, is judged by that class.
    """
    if GLASS.search(material):
        return Role.TRANSPARENT, _named_class(name) or "Mesh"
    if kind := _named_class(name):
        return ifc_role(_ancestors(kind).__contains__, name, doors, in_curtain_wall=True), kind
    if GLASS.search(name) or WINDOW.search(name):
        return Role.TRANSPARENT, "Mesh"
    if DOOR.search(name):
        return (Role.OCCLUDER if doors == "closed" else Role.TRANSPARENT), "Mesh"
    return Role.OCCLUDER, "Mesh"


def _named_class(name: str) -> str:
    found = re.search(r"(?<![A-Za-z0-9])Ifc[A-Z][A-Za-z0-9]+", name)
    return found[0] if found and _ancestors(found[0]) else ""


@cache
def _ancestors(kind: str) -> frozenset[str]:
    """The class and all that it inherits from, in the first schema that knows it; empty where none does."""
    import ifcopenshell  # a third of a second, and only for names that hold an IFC class

    for schema in ("IFC4", "IFC2X3", "IFC4X3_ADD2"):
        try:
            declared = ifcopenshell.ifcopenshell_wrapper.schema_by_name(schema).declaration_by_name(kind).as_entity()
        except RuntimeError:
            continue
        names = []
        while declared:
            names.append(declared.name())
            declared = declared.supertype()
        return frozenset(names)
    return frozenset()
