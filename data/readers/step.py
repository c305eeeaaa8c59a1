"""The text of a STEP file (ISO 10303-21, which IFC files are), checked before a parser takes it.

The parser reads what it can of a file that is cut off and says nothing; a wall that refers to nothing is a hole. Some
damage, such as a placement relative to itself, ends the process. So the whole text is checked first.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..errors import InputError

ASIDES = re.compile(rb"/\*.*?\*/|'[^']*+(?:''[^']*+)*+'|\"[^\"]*\"", re.DOTALL)
END = re.compile(rb"ENDSEC\s*;\s*END-ISO-10303-21\s*;?[\s\0]*\Z", re.IGNORECASE)
DATA = re.compile(rb"\bDATA\s*(?:\([^;]*\)\s*)?;", re.IGNORECASE)
ENTITY = re.compile(rb"#(\d+)=([A-Z]\w*)\((.*)\)", re.IGNORECASE)
VALUE = rb"[$*]|#\d++|''|[+-]?\d++(?:\.\d*+)?(?:E[+-]?\d++)?|\.\w++\."
# Brackets open before a value, after the name of its type such as IFCLABEL if it has one, and close after it.
ITEM = rb"(?:(?:[A-Z]\w*+)?\()*+(?:" + VALUE + rb"|(?<=\()(?=\)))\)*+"
ITEMS = re.compile(ITEM + rb"(?:," + ITEM + rb")*+", re.IGNORECASE)
REFERENCE = re.compile(rb"#(\d+)")
BLANKS = re.compile(rb"\s+")
# Relations of space boundaries lead in circles by right; nothing is placed or built by them.
RELATION = b"IFCREL"
SHOWN = 60


@dataclass(frozen=True)
class Entity:
    """A statement: its number, class in capitals, and the text between its brackets without blanks and strings."""

    number: int
    kind: bytes
    inside: bytes


def check_step(path: Path, content: bytes) -> list[Entity]:
    """Entities of a file, every statement of which is whole: each is defined once, none refers to nothing or to itself.

    Args:
        path: named in errors.
        content: of the file.

    Raises:
        InputError: the file is no STEP file, was cut off, or is damaged.
    """
    if not content.lstrip()[:13].upper().startswith(b"ISO-10303-21"):
        raise InputError(f"{path}: expected an IFC file (ISO-10303-21), found {content[:24]!r}")
    bare = ASIDES.sub(lambda aside: b"" if aside[0].startswith(b"/") else b"''", content)
    end = END.search(bare, max(0, len(bare) - 4096))
    if not end:
        raise InputError(f"{path}: expected ENDSEC and END-ISO-10303-21 at the end, found {_last(bare)}: cut off?")
    begin = DATA.search(bare, 0, end.start())
    if not begin:
        raise InputError(f"{path}: expected a DATA section, found none")
    # More than one section of data is allowed, though nobody writes it.
    statements = DATA.sub(b"", re.sub(rb"\bENDSEC\s*;", b"", bare[begin.end() : end.start()])).split(b";")
    if statements[-1].strip():
        raise InputError(f"{path}: expected a statement that ends in ;, found {_shown(statements[-1])}")
    entities = [_entity(path, statement) for statement in statements[:-1]]
    _check_references(path, entities)
    return entities


def _entity(path: Path, statement: bytes) -> Entity:
    dense = BLANKS.sub(b"", statement)
    found = ENTITY.fullmatch(dense)
    if not found:
        raise InputError(f"{path}: expected #number=NAME(...);, found {_shown(statement)}")
    inside = found[3]
    if inside and not (ITEMS.fullmatch(inside) and inside.count(b"(") == inside.count(b")")):
        raise InputError(f"{path}: expected values between commas, found {_shown(statement)}")
    return Entity(int(found[1]), found[2].upper(), inside)


def _check_references(path: Path, entities: list[Entity]) -> None:
    """Entities are defined once; what they refer to is defined, and leads back to none of them."""
    known: dict[int, int] = {}
    for place, entity in enumerate(entities):
        if known.setdefault(entity.number, place) != place:
            raise InputError(f"{path}: expected every entity once, found #{entity.number} twice")
    owners, to = [], []
    for place, entity in enumerate(entities):
        references = [int(number) for number in REFERENCE.findall(entity.inside)]
        for reference in references:
            if reference not in known:
                wanted = f"#{reference}, which #{entity.number} refers to"
                raise InputError(f"{path}: expected {wanted}, found no such entity: cut off?")
        if not entity.kind.startswith(RELATION):
            owners += [place] * len(references)
            to += [known[reference] for reference in references]
    links = coo_matrix((np.ones(len(to), np.int8), (owners, to)), shape=(len(entities), len(entities)))
    _, component = connected_components(links, connection="strong")
    own = np.flatnonzero(np.equal(owners, to))
    circle = np.array(owners, int)[own[:1]] if len(own) else np.flatnonzero(np.bincount(component)[component] > 1)
    if len(circle):
        found = ", ".join(f"#{entities[place].number}" for place in circle[:4])
        raise InputError(f"{path}: expected no entity to lead back to itself, found {found}")


def _last(bare: bytes) -> str:
    return _shown(bare[-200:].split(b";")[-1] or b"nothing")


def _shown(text: bytes) -> str:
    line = " ".join(text.decode("ascii", "replace").split())
    return repr(line if len(line) <= SHOWN else line[:SHOWN] + "...")
