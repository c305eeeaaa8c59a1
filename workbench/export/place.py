"""Where an export goes: nothing is replaced unasked, and what is written appears whole or not at all."""

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from ...data.errors import InputError
from ...data.store.bake_folder import TABLES, BakeFolder
from ...data.store.scene_folder import WRITING, refuse_others

# As the manifest of an exported folder says it.
FOLDER_KIND = "3dtiles"


def check_places(bake: BakeFolder, files: Iterable[Path], folders: Iterable[Path], overwrite: bool) -> None:
    """Refuse what must not be written, before any of it is.

    Args:
        bake: what is exported; its own files are never replaced.
        files: to write.
        folders: to write.
        overwrite: whether files, and folders of an earlier export, may be replaced.

    Raises:
        InputError: something is there that may not be replaced, or two exports have one name.
    """
    files, folders = list(files), list(folders)
    taken = set()
    for out in (*files, *folders):
        if (name := out.absolute()) in taken:
            raise InputError(f"{out}: expected a name for each export, found it twice")
        taken.add(name)
        _refuse_own(bake.folder, out)
    for out in files:
        if out.is_dir():
            raise InputError(f"{out}: expected a file to write, found a folder")
        if not out.parent.is_dir():
            raise InputError(f"{out}: expected a file to write in a folder that is there, found none")
        if out.exists() and not overwrite:
            raise occupied(out)
    for out in folders:
        refuse_others(out, FOLDER_KIND)
        if out.exists() and any(out.iterdir()) and not overwrite:
            raise occupied(out)


def occupied(out: Path) -> InputError:
    """What to say of a name that is taken."""
    return InputError(f"{out}: expected a new name, found something there; --overwrite (overwrite=True) replaces it")


def _refuse_own(folder: Path, out: Path) -> None:
    """Refuse to put an export in place of a part of the bake."""
    own = {"manifest.json", *(f"{name}.parquet" for name in TABLES)}
    place, home = out.resolve(), folder.resolve()
    if place == home or (place.parent == home and place.name in own):
        raise InputError(f"{out}: expected another place than the bake's own, found a part of it")


def write_file(out: Path, data: bytes) -> None:
    """Write a file: it is there whole, or what was there before still is.

    What a killed command leaves behind is named as `viewcell clean` looks for it.

    Raises:
        InputError: it cannot be written.
    """
    try:
        with tempfile.TemporaryDirectory(dir=out.parent, prefix=f".{out.name}{WRITING}") as scratch:
            (Path(scratch) / "new").write_bytes(data)
            os.replace(Path(scratch) / "new", out)
    except OSError as error:
        raise InputError(f"{out}: expected a file to write, found {error.strerror}") from None
