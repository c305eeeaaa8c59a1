"""The place that a bake is written to: what may be replaced there, what is unfinished, and what becomes stale."""

import contextlib
import glob
import os
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING

from filelock import FileLock, Timeout

from ...data.errors import InputError
from ...data.store.scene_folder import OLD, WRITING, held_manifest, refuse_others
from ...data.version import __version__
from .settings import Settings

if TYPE_CHECKING:
    from ...data.scene import Scene

# How the name of a folder of unfinished work ends.
PARTIAL = ".partial"


def partial_folder(out: Path, known: str) -> Path:
    """Where unfinished work of the bake with a fingerprint is kept: beside its folder, and beside that of others."""
    return out.with_name(f".{out.name}.{known[:16]}{PARTIAL}")


def default_out(model: "Scene | str | Path") -> Path:
    """Where a bake goes that was not told where: named after its model, in the current folder."""
    # `resolve` gives "." and ".." a name.
    name = Path(model).resolve().stem or "model" if isinstance(model, str | Path) else "scene"
    return Path(f"{name}.bake")


def check_place(out: Path, settings: Settings, overwrite: bool) -> None:
    """Refuse what is sure to fail, before a model is read.

    Raises:
        InputError: `out` holds something else, or a bake with other settings, or cannot be written; or a table of view
            cells is not there.
    """
    refuse_others(out, "bake")
    if settings.table is not None and not settings.table.is_file():
        raise InputError(
            f"{settings.cells}: expected a table of view cells, portals, octree or walkways, found nothing there"
        )
    parent = out.absolute().parent
    while not parent.exists():
        parent = parent.parent
    try:
        with tempfile.TemporaryDirectory(prefix=f".{out.name}{WRITING}", dir=parent):
            pass
    except OSError as error:
        raise InputError(f"{out}: expected to be able to write there, found {error.strerror}") from None
    if not overwrite and (done := held_manifest(out, "bake")) is not None and _changed(done, settings):
        raise occupied(out, done, settings)


def occupied(out: Path, done: dict, settings: Settings) -> InputError:
    """What to say of a folder that holds another bake, and how the two differ."""
    changed = _changed(done, settings)
    if done.get("viewcell") != __version__:
        found = f"by viewcell {done.get('viewcell')}"
    elif changed:
        found = "with " + ", ".join(f"{name} {value!r}" for name, value in changed.items())
    else:
        found = f"of another model, or of an earlier state of it ({done['model']['path']})"
    return InputError(
        f"{out}: expected a bake of this model with these settings, found one {found}; "
        "--overwrite (overwrite=True) replaces it, another --out keeps both"
    )


def _changed(done: dict, settings: Settings) -> dict[str, object]:
    """Settings of a finished bake that are not the asked ones."""
    held, asked = done.get("settings", {}), asdict(settings)
    return {name: value for name, value in held.items() if name in asked and asked[name] != value}


def set_aside(report: Path) -> None:
    """Rename a report, and the curves in it, of a bake since replaced: neither passes for the new one's.

    It becomes report.stale, or report.stale.2 and so on where there is one.
    """
    if report.is_dir():
        names = (f"{report.name}.stale{more}" for more in chain([""], (f".{k}" for k in count(2))))
        report.rename(next(place for name in names if not (place := report.with_name(name)).exists()))


@contextlib.contextmanager
def alone(out: Path, what: str = "bake") -> Iterator[None]:
    """Nobody else on this machine writes a bake, or what else it is, to a place meanwhile.

    Raises:
        InputError: another one does.
    """
    lock = FileLock(out.absolute().with_name(f".{out.name}.lock"), blocking=False)
    try:
        lock.acquire()
    except Timeout:
        raise InputError(f"{out}: expected no {what} that is being written there, found one; wait for it") from None
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            os.unlink(lock.lock_file)
        lock.release()


def leftovers(folder: Path, name: str | None = None) -> list[Path]:
    """Unfinished work of bakes, and folders that were being written when a command was killed, in a folder.

    Args:
        folder: where bakes are.
        name: of the bake; of all by default.
    """
    name = "*" if name is None else glob.escape(name)
    found = [*folder.glob(f".{name}.*{PARTIAL}"), *folder.glob(f".{name}{WRITING}*")]
    return sorted(path for path in found if path.is_dir())


def clean(folder: Path) -> list[tuple[str, Path]]:
    """Remove what is left over in a folder; a finished folder whose place was left empty is put back.

    Returns:
        What was done, "removed" or "put back", and to what.

    Raises:
        InputError: it is no folder, or something in it cannot be removed.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: expected a folder, found {'a file' if folder.exists() else 'nothing there'}")
    done = []
    try:
        for path in leftovers(folder):
            home = folder / path.name[1:].split(WRITING)[0]
            if path.name.endswith(OLD) and not home.exists():
                os.rename(path, home)
                done.append(("put back", home))
            else:
                shutil.rmtree(path)
                done.append(("removed", path))
    except OSError as error:
        raise InputError(f"{error.filename}: expected to be able to remove it, found {error.strerror}") from None
    return done
