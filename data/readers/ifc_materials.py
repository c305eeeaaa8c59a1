"""What an IFC file says of materials, in layers, lists, constituents and profiles: their names, and which is glass."""

from collections.abc import Iterator

from .ifc_shapes import TRANSPARENCY
from .roles import RoleRules

# Attributes by which materials are made of others.
PARTS = ("ForLayerSet", "MaterialLayers", "Materials", "MaterialConstituents", "MaterialProfiles", "ForProfileSet")
PARTS += ("ForProfileEndSet", "Material")
# Opaque layers up to this thickness, in metres, hide nothing of glass: foils and coats.
FOIL_M = 0.005


def glass_material(product: object, roles: RoleRules, metres: float) -> str:
    """By which of its materials one sees through a product; empty if by none.

    Args:
        product: its own materials count, then those of its type.
        roles: the words for glass.
        metres: length of the file's unit [m].
    """
    for owner in (product, type_of(product)):
        found = [link.RelatingMaterial for link in associations(owner)]
        if found:
            return next((why for material in found if (why := _glass(material, roles, metres))), "")
    return ""


def material_names(product: object) -> tuple[str, ...]:
    """Names of a product's own materials, else of its type's: each once, layers and parts in the file's order."""
    for owner in (product, type_of(product)):
        found = [link.RelatingMaterial for link in associations(owner)]
        if found:
            names = [one.Name for material in found for one in _single(material)]
            return tuple(dict.fromkeys(filter(None, names)))
    return ()


def type_of(product: object) -> object | None:
    """The product's type, such as an IfcWallType; None if it has none."""
    links = [*(getattr(product, "IsTypedBy", None) or ()), *(getattr(product, "IsDefinedBy", None) or ())]
    return next((link.RelatingType for link in links if link.is_a("IfcRelDefinesByType")), None)


def associations(owner: object | None) -> list:
    """The links of a product or a type to materials."""
    links = getattr(owner, "HasAssociations", None) or ()
    return [link for link in links if link.is_a("IfcRelAssociatesMaterial") and link.RelatingMaterial is not None]


def _glass(material: object, roles: RoleRules, metres: float) -> str:
    if material.is_a("IfcMaterialLayerSetUsage"):
        material = material.ForLayerSet
    if material.is_a("IfcMaterialLayerSet"):
        return _glass_layers(list(material.MaterialLayers or ()), roles, metres)
    # In a list, or of constituents or profiles, nobody knows which faces are which: one of glass is enough.
    return next((why for one in _single(material) if (why := _glass_one(one, roles))), "")


def _glass_layers(layers: list, roles: RoleRules, metres: float) -> str:
    """Why light passes all layers, which lie behind one another; empty if it does not."""
    why = ""
    for layer in layers:
        if layer.Material is None or layer.IsVentilated:  # air
            continue
        glass = _glass_one(layer.Material, roles)
        why = why or glass
        if not glass and (layer.LayerThickness or 0.0) * metres > FOIL_M and not roles.named_air(layer.Material.Name):
            return ""
    return why


def _single(material: object) -> Iterator[object]:
    """The IfcMaterials in whatever a product is said to be made of."""
    if material.is_a("IfcMaterial"):
        yield material
        return
    for name in PARTS:
        parts = getattr(material, name, None) or ()
        for part in parts if isinstance(parts, tuple) else (parts,):
            yield from _single(part)


def _glass_one(material: object, roles: RoleRules) -> str:
    for style in _styles(material):
        for shading in style.Styles or ():
            level = getattr(shading, "Transparency", None)
            if level is not None and level > TRANSPARENCY:
                return f"glass: material {material.Name!r} lets {level:.0%} of the light pass"
        if style.Name and (why := roles.named_glass(style.Name, "surface style")):
            return why
    return roles.named_glass(material.Name or "", "material")


def _styles(material: object) -> Iterator[object]:
    """The surface styles of a material."""
    for definition in getattr(material, "HasRepresentation", None) or ():
        for representation in definition.Representations or ():
            for item in representation.Items or ():
                if item.is_a("IfcStyledItem"):
                    yield from _surface_styles(item.Styles or ())


def _surface_styles(styles: tuple) -> Iterator[object]:
    for style in styles:
        if style.is_a("IfcSurfaceStyle"):
            yield style
        elif style.is_a("IfcPresentationStyleAssignment"):
            yield from _surface_styles(style.Styles or ())
