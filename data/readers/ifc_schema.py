"""What classes of an IFC schema may refer to; a solid among whose profiles stands a building ends the process."""

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from ..errors import InputError
from .step import Entity

# Where shapes come from. Elsewhere exporters do break the schema, and nothing comes of it.
GEOMETRY = (
    "IfcObjectPlacement IfcProduct IfcProductRepresentation IfcProfileDef IfcRepresentation IfcRepresentationContext "
    "IfcRepresentationItem IfcRepresentationMap"
).split()
STRUCTURE = re.compile(rb"#\d+|[(),]")
REFERENCE = re.compile(rb"#(\d+)")
AGAIN = re.compile(rb"\((#\w+,)\1+")


def check_classes(path: Path, schema: str, entities: list[Entity]) -> None:
    """Every entity is of a class of the schema, and those that make shapes refer to what they may.

    Args:
        path: named in errors.
        schema: identifier, such as IFC4.
        entities: of the file.

    Raises:
        InputError: naming the entity.
    """
    kinds = {entity.number: entity.kind for entity in entities}
    seen: set[tuple[bytes, bytes]] = set()
    for entity in entities:
        if b"#" not in entity.inside:
            form = b""
        else:
            bare = b"".join(STRUCTURE.findall(entity.inside))
            form = AGAIN.sub(rb"(\1", REFERENCE.sub(lambda found: b"#" + kinds[int(found[1])], bare))
        if (entity.kind, form) in seen:
            continue
        seen.add((entity.kind, form))
        kind = entity.kind.decode()
        if _declared(schema, kind) is None:
            raise InputError(f"{path}: expected classes of {schema}, found #{entity.number}={kind}")
        if not _inherits(schema, kind).isdisjoint(GEOMETRY):
            for place, other in _references(form):
                if not _may(schema, kind, place, other):
                    wrong = f"{other} as value {place + 1} of #{entity.number}={kind}"
                    raise InputError(f"{path}: expected what {schema} allows there, found {wrong}")


def _references(form: bytes) -> Iterator[tuple[int, str]]:
    """Places, from 0, and classes of the references in the structure of a statement."""
    place = depth = 0
    for token in re.findall(rb"#\w+|[(),]", form):
        if token == b"," and not depth:
            place += 1
        elif token in b"()":
            depth += 1 if token == b"(" else -1
        elif token != b",":
            yield place, token[1:].decode()


@cache
def _declared(schema: str, kind: str) -> object | None:
    """Declaration of a class; None if the schema has none of that name."""
    import ifcopenshell

    try:
        return ifcopenshell.ifcopenshell_wrapper.schema_by_name(schema).declaration_by_name(kind).as_entity()
    except RuntimeError:
        return None


@cache
def _inherits(schema: str, kind: str) -> frozenset[str]:
    """A class and those that it inherits from."""
    names, declared = set(), _declared(schema, kind)
    while declared:
        names.add(declared.name())
        declared = declared.supertype()
    return frozenset(names)


@cache
def _may(schema: str, kind: str, place: int, other: str) -> bool:
    """Whether an attribute of a class may be an entity of another, or hold one."""
    attributes = _declared(schema, kind).all_attributes()
    return place >= len(attributes) or _admits(attributes[place].type_of_attribute(), _inherits(schema, other))


def _admits(wanted: object, names: frozenset[str]) -> bool:
    while aggregate := wanted.as_aggregation_type():
        wanted = aggregate.type_of_element()
    named = wanted.as_named_type()
    return named is not None and _is_among(named.declared_type(), names)


def _is_among(declared: object, names: frozenset[str]) -> bool:
    if entity := declared.as_entity():
        return entity.name() in names
    if select := declared.as_select_type():
        return any(_is_among(one, names) for one in select.select_list())
    alias = declared.as_type_declaration()
    return alias is not None and _admits(alias.declared_type(), names)
