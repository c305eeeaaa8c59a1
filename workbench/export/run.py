"""Exports by name: where each goes and what makes it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal, get_args

from ...data.errors import InputError
from ...data.store.bake_folder import BakeFolder
from .bits import HEADER, c_header, sets_as_bits
from .glb import model_as_glb
from .json_sets import sets_as_json
from .place import FOLDER_KIND, check_places, write_file
from .portals import portals_as_prt
from .tiles import write_tiles

# What makes the file of each kind.
FILES = {"prt": portals_as_prt, "json": sets_as_json, "bits": sets_as_bits, "glb": model_as_glb}
# What writes the folder of each kind.
FOLDERS = {FOLDER_KIND: write_tiles}
# As editors and type checkers know them.
Kind = Literal["prt", "json", "bits", "glb", "3dtiles"]
KINDS: tuple[Kind, ...] = get_args(Kind)


def export(bake: BakeFolder, outs: Mapping[Kind, str | Path], *, overwrite: bool = False) -> list[Path]:
    """Write a bake in other programs' formats (docs/guides/export.md); what is refused is so before any is written.

    Args:
        bake: to write.
        outs: where to, by kind: files for prt, json, bits and glb, a folder for 3dtiles.
        overwrite: whether what is there may be replaced.

    Returns:
        What was written, a path for each kind and one for the C header of bits.

    Raises:
        InputError: there is no such kind, something is there and may not be replaced, a place cannot be written, or
            the bake has nothing of that kind.
    """
    unknown = [kind for kind in outs if kind not in KINDS]
    if unknown:
        raise InputError(f"export: expected {', '.join(KINDS)}, found {unknown[0]!r}")
    places = {kind: Path(out) for kind, out in outs.items()}
    files = {kind: out for kind, out in places.items() if kind in FILES}
    header = files["bits"].with_name(HEADER) if "bits" in files else None
    # The header is the same for every bake: one that is there already is no clash.
    beside = [] if header is None or _holds(header, c_header()) else [header]
    folders = {kind: out for kind, out in places.items() if kind in FOLDERS}
    check_places(bake, [*files.values(), *beside], folders.values(), overwrite)
    made = {out: FILES[kind](bake) for kind, out in files.items()} | {out: c_header() for out in beside}
    for out, data in made.items():
        write_file(out, data)
    for kind, out in folders.items():
        FOLDERS[kind](bake, out)
    return [*places.values(), *([] if header is None else [header])]


def _holds(file: Path, data: bytes) -> bool:
    return file.is_file() and file.read_bytes() == data
