"""Write a view: index.html, the viewer's script, its licences, and the display database as a script."""

import os
import tempfile
import webbrowser
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup, escape

from ...data.errors import InputError
from ...data.progress import phase
from ...data.store.bake_folder import read_bake
from ...data.store.scene_folder import held_manifest
from ...data.store.walk_folder import KIND, read_walk
from ..files import write_files
from ..pack.run import pack
from ..pages import fill
from .contents import chunks, contents, depth_scripts, geometry_bytes, script
from .reasons import reasons

if TYPE_CHECKING:
    from ...data.store.bake_folder import BakeFolder
    from ...data.store.walk_folder import WalkFolder

PAGE = files(__package__) / "page"
BUILT = PAGE / "build"
SCRIPT = "viewer.js"
# Third-party code is in the script: what its authors ask for goes with it.
LICENCES = f"{SCRIPT}.LEGAL.txt"
# A page opened by a double-click may load no more than this in one script, in bytes.
LARGEST = 200_000_000
# With more geometry than this it is read in chunks, as it is looked ahead to [bytes].
STREAMED = 8_000_000
CHUNK = "geometry-{}.js"
DEPTH = "depth-{}.js"

NO_REASONS = script("viewcellReasons", {"certified": None}, {})


@dataclass(frozen=True)
class View:
    """A view that was written; in a notebook it shows itself.

    Attributes:
        page: path of its index.html.
    """

    page: Path

    def __fspath__(self) -> str:
        return str(self.page)

    def open(self) -> None:
        """Open it in the browser."""
        webbrowser.open(self.page.absolute().as_uri())

    def _repr_html_(self) -> str:
        """The page in a frame; a notebook serves what lies below its own folder."""
        page = Path(os.path.relpath(self.page)).as_posix()
        return f'<iframe src="{escape(page)}" width="100%" height="600" style="border:0"></iframe>'


def view(
    source: "BakeFolder | WalkFolder | str | Path", out: str | Path | None = None, *, overwrite: bool = False
) -> View:
    """Write a folder that opens by a double-click and needs no network: walk through a bake.

    Args:
        source: a display database of `viewcell pack`, or a bake, which is packed for it.
        out: folder to write; `source` with .view in place of its ending by default.
        overwrite: replace the view that is there.

    Returns:
        The view.

    Raises:
        InputError: `source` is neither, something else is in the way, the script was not built, or the model is too
            large for one file.
    """
    folder = Path(source if isinstance(source, str | Path) else source.folder)
    if not (BUILT / SCRIPT).is_file():
        raise InputError(f"{SCRIPT}: expected the viewer's script, found none; `make install` builds it")
    packed = held_manifest(folder, KIND) is not None
    out = folder.with_suffix(".view") if out is None else Path(out)
    _check_place(out, overwrite)
    with phase("view"), tempfile.TemporaryDirectory() as scratch:
        walk = read_walk(folder) if packed else pack(folder, Path(scratch) / f"{folder.stem}.walk")
        streams = geometry_bytes(walk) > STREAMED
        data, why = contents(walk, streams=streams), _reasons(folder, walk, packed)
        if len(data) > LARGEST:
            raise InputError(
                f"{folder}: expected a model whose view takes at most {LARGEST // 10**6} MB, found {len(data) // 10**6}"
            )
        own = Markup((PAGE / "view.css").read_text("utf-8"))
        page = fill(PAGE, "index.html", title=folder.stem, own=own)
        texts = {"data.js": data.encode(), "why.js": why.encode(), "index.html": page.encode()}
        texts |= {CHUNK.format(k): text.encode() for k, text in enumerate(chunks(walk) if streams else ())}
        texts |= {DEPTH.format(row): text.encode() for row, text in enumerate(depth_scripts(walk))}
        write_files(out, lambda: texts | {name: (BUILT / name).read_bytes() for name in (SCRIPT, LICENCES)})
        for left in {*out.glob(CHUNK.format("*")), *out.glob(DEPTH.format("*"))} - {out / name for name in texts}:
            left.unlink()
    return View(out / "index.html")


def _reasons(folder: Path, walk: "WalkFolder", packed: bool) -> str:
    """Sightlines and certificates of the bake; of a database whose bake is elsewhere, or has changed, nothing."""
    place = walk.bake_place if packed else folder
    there = not packed or (held_manifest(place, "bake") is not None and not walk.stale())
    text = reasons(read_bake(place), walk) if there else NO_REASONS
    return text if len(text) <= LARGEST else NO_REASONS


def _check_place(out: Path, overwrite: bool) -> None:
    """Refuse to replace what nobody said should be, and what is no view whatever was said."""
    if not out.exists():
        return
    ours = out.is_dir() and (out / "index.html").is_file() and (out / SCRIPT).is_file()
    if not ours and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out}: expected a new name or a view, found something else")
    if ours and not overwrite:
        raise InputError(f"{out}: expected a new name, found a view; --overwrite (overwrite=True) replaces it")
