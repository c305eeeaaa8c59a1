"""Check anybody's potentially visible sets against a model: hunt for what they hide, and say how sure the answer is.

Where there are triangles, rays look for what the claims hide and every suspect is judged exactly. A bare cell graph
has no triangles: there, visible means joined by a line through portals, which is decided for every pair.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa

from ...data.errors import InputError
from ...data.graph import CellGraph
from ...data.plural import counted
from ...data.progress import phase, shown
from ...data.scene import OPAQUE, Role, Scene
from ...data.store.bake_folder import BakeFolder, read_bake
from ...data.store.claims import Claims, read_claims
from ...data.store.room_tables import read_room_table, words_of_cells
from ...data.store.scene_folder import read_manifest
from ...data.store.view_cells import ViewCells, read_rows, view_cells
from ...verify.check_result import CheckResult, WrongPair
from ...verify.exact.sightline import Sightlines
from ...verify.exact.trace import contact_links
from ...verify.rays.adjudicate import Judge, Judgement, sightline_end
from ...verify.rays.clearance import clearances
from ...verify.rays.confidence import Confidence
from ...verify.rays.embree import Candidates
from ...verify.rays.falsify import Falsifier
from ...verify.rays.second_look import SecondLook
from ...verify.rays.starts import ORIGINS_MOST, cell_origins

RAYS = 4_000_000
# Sightlines whose surroundings are measured; it takes about a millisecond each.
MEASURED = 1_000
# Rays to each claimed pair that the hunt did not see.
AGAIN = 512


def check(
    model: Scene | BakeFolder | str | Path,
    pvs: object = None,
    cells: object = None,
    *,
    rays: int = RAYS,
    seed: int = 0,
    targets: str | None = None,
    progress: bool = False,
    **reading: object,
) -> CheckResult:
    """Look for visible things that claimed sets hide.

    Args:
        model: a scene, a bake, or a path: whatever `read` takes, a bake folder, a folder of cells.parquet and
            portals.parquet, or a compiled map (.bsp with its .prt, or .prt); the last two are judged by their portals,
            unless view cells beside a .bsp say that it is meant as a model.
        pvs: what is claimed to be potentially visible: a table or matrix as `data.store.claims.read_claims` takes it,
            or several in a list.
        cells: view cells: a table of boxes (a path, or anything that pyarrow makes a table of) in the model's own
            metres, or a bake or its folder. By default those of the model, if it is a bake or a cell graph.
        rays: to cast.
        seed: of the rays.
        targets: "objects" or "cells", where a matrix could have either as columns.
        progress: show a bar.
        reading: how a model file is read: options of `read`, such as `unit` and `doors`.

    Returns:
        All wrong-hidden pairs that were found, each with a sightline that exact arithmetic confirms. None found does
        not mean none there: `CheckResult.confidence` says how much is ruled out.

    Raises:
        InputError: the model, the cells or the claims are unusable, or a view cell has no point outside every solid.
    """
    if rays < 1:
        raise InputError(f"rays: expected 1 or more, found {rays}")
    start = time.perf_counter()
    model, cells = _place(model), _place(cells)
    if isinstance(model, str | Path) and _has_portals(Path(model), cells):
        from .map import check_map

        return check_map(Path(model), _sources(pvs), cells, rays=rays, seed=seed, targets=targets, progress=progress)
    if pvs is None:
        raise InputError(f"{model}: expected claims beside it, found none")
    # Cells of a bake lie in its frame.
    if (yaw_deg := _baked_yaw(cells)) and not _is_bake(model):
        reading.setdefault("yaw", yaw_deg)
    opened = open_model(model, reading)
    if isinstance(opened, CellGraph):
        from .graph import check_graph

        result = check_graph(opened, _sources(pvs), targets)
        result.asked = {"model": str(Path(model).resolve()), "judge": "portals"}
        return result
    scene, own_cells = opened
    cells = cells if cells is not None else own_cells
    view = _view_cells(cells, scene, str(model))
    names, guids = ([getattr(placed, of) for placed in scene.objects] for of in ("name", "guid"))
    claims = read_claims(_sources(pvs), view, names, targets, guids=guids)
    hunt = _Hunt(scene, view, claims, rays, seed)
    baked = isinstance(cells, str | Path) and _is_bake(cells)
    rooms = read_room_table(Path(cells), "rooms") if baked else None
    hunt.result.cell_rooms = words_of_cells(rooms, view.graph.cell_names)
    hunt.result.seconds["read"] = time.perf_counter() - start
    with shown(progress):
        hunt.run()
    path = None if isinstance(model, Scene) else str(Path(model).resolve())
    hunt.result.asked = {"model": path, "judge": "triangles", "reading": reading}
    return hunt.result


def assert_conservative(
    pvs: object,
    scene: Scene | BakeFolder | str | Path,
    cells: object = None,
    *,
    rays: int = 1_000_000,
    **options: object,
) -> CheckResult:
    """Fail where claimed sets hide what is visible.

    Args:
        pvs: what is claimed, as for `check`, or a bake.
        scene: the model, as for `check`.
        cells: view cells, as for `check`; by default those of the bake, if `pvs` is one or a bake's folder.
        rays: to cast.
        options: further ones of `check`.

    Returns:
        What `check` found: nothing wrong-hidden.

    Raises:
        AssertionError: a sightline shows something that is claimed hidden; the message tells which, from where.
        InputError: as for `check`.
    """
    __tracebackhide__ = True
    pvs = _place(pvs)
    if cells is None and isinstance(pvs, str | Path) and (Path(pvs) / "manifest.json").is_file():
        cells = pvs
    result = check(scene, pvs, cells, rays=rays, **options)
    if not result.ok:
        hidden = counted(len(result.wrong), "visible pair")
        raise AssertionError(f"not conservative: {hidden} claimed hidden\n{result.table()}")
    return result


def _has_portals(model: Path, cells: object) -> bool:
    """Whether a model is judged by a map's own portals: a .prt, or a .bsp without view cells of other kinds."""
    suffix = model.suffix.lower()
    ends_prt = isinstance(cells, str | Path) and Path(cells).suffix.lower() == ".prt"
    return suffix == ".prt" or (suffix == ".bsp" and (cells is None or ends_prt))


def _sources(pvs: object) -> Sequence[object]:
    return [] if pvs is None else [_place(part) for part in (pvs if isinstance(pvs, list | tuple) else [pvs])]


def _place(given: object) -> object:
    """The folder of a bake in its place; anything else as it is."""
    return given.folder if isinstance(given, BakeFolder) else given


def _baked_yaw(cells: object) -> float:
    """What the model of a bake whose cells are taken is turned back by; 0 for anything else."""
    if not isinstance(cells, str | Path) or not (Path(cells) / "manifest.json").is_file():
        return 0.0
    return float(read_manifest(Path(cells), kind="bake").get("yaw_deg", 0.0))


def open_model(model: Scene | str | Path, reading: dict[str, object]) -> tuple[Scene, Path | None] | CellGraph:
    """The model, and where its own view cells are; or a bare graph. `reading` has options of `read`.

    Raises:
        InputError: it is unreadable.
    """
    if isinstance(model, Scene):
        from ...data.frame import in_frame

        return in_frame(model, reading.get("yaw", 0.0)), None
    path = Path(model)
    scene_folder = (path / "manifest.json").is_file() and not _is_bake(path)
    told = [name for name, value in reading.items() if value not in (None, "", "open")]
    told = [name for name in told if not (name == "yaw" and scene_folder)]
    if path.is_dir() and told:
        raise InputError(f"{path}: expected a model file beside {', '.join(told)}, found a folder")
    if path.is_dir() and not (path / "manifest.json").exists():
        from ...data.store.graph_folder import read_graph

        return read_graph(path)[0]
    if path.is_dir() and read_kind(path) == "bake":
        bake = read_bake(path)
        return bake.graph if bake.scene is None else (bake.scene, path)
    from ...data.readers import read

    return read(path, **reading), None


def _is_bake(model: Scene | str | Path) -> bool:
    """Whether a model is a bake folder."""
    return not isinstance(model, Scene) and Path(model).is_dir() and read_kind(Path(model)) == "bake"


def read_kind(folder: Path) -> str:
    """What a folder with a manifest is: "bake", or "scene"."""
    try:
        read_manifest(folder, kind="bake")
    except InputError:
        return "scene"
    return "bake"


def _view_cells(cells: object, scene: Scene, model: str) -> ViewCells:
    """View cells of a table; those of a bake are relative to its origin."""
    if cells is None:
        raise InputError(f"{model}: expected a table of view cells beside it, found none")
    if not isinstance(cells, str | Path):
        try:
            return view_cells(pa.table(cells), scene, "cells", inwards=True)
        except (TypeError, AttributeError, pa.ArrowException) as error:
            raise InputError(f"cells: expected a table, found {error}") from None
    path = Path(cells)
    table_path = path / "cells.parquet" if path.is_dir() else path
    placement = None
    if (table_path.parent / "manifest.json").is_file() and read_kind(table_path.parent) == "bake":
        manifest = read_manifest(table_path.parent, kind="bake")
        placement = np.array(manifest["origin"], np.float64), float(manifest.get("yaw_deg", 0.0))
    return view_cells(read_rows(table_path), scene, str(table_path), placement=placement, inwards=True)


class _Hunt:
    """One check of claims about a model with triangles."""

    def __init__(self, scene: Scene, view: ViewCells, claims: Claims, rays: int, seed: int):
        self.rays, self.seed = rays, seed
        self.opaque, self.glass = scene.triangles(*OPAQUE), scene.triangles(Role.TRANSPARENT)
        if not len(self.opaque[0]):
            raise InputError(f"{scene.source or 'model'}: expected opaque triangles, found none")
        lines = Sightlines(*self.opaque)
        graph = view.graph
        self.judge = Judge(graph, lines, Sightlines(*self.glass), contact_links(graph.tiles.cells, graph.cell_count))
        sources = np.flatnonzero(graph.inhabitable)
        if not len(sources):
            raise InputError("cells: expected at least one inhabitable view cell, found none")
        wanted = int(np.clip(rays // len(sources) // 32, 8, ORIGINS_MOST))
        self.spots = cell_origins(graph, sources, wanted, lines, seed)
        dark = [int(cell) for cell, own in zip(sources, self.spots, strict=True) if not len(own)]
        if dark:
            raise InputError(
                f"cells: expected view cells with a point outside every solid, found none in cell {view.ids[dark[0]]}"
                f"{f' and {len(dark) - 1} more' if len(dark) > 1 else ''}; inhabitable = false leaves a cell out"
            )
        named = {"object": claims.objects, "cell": claims.cells}
        claimed = {kind: matrix for kind, matrix in named.items() if matrix is not None}
        self.result = CheckResult(
            cell_ids=view.ids,
            sources=sources,
            object_names=[placed.name for placed in scene.objects],
            claimed=claimed,
            seen={kind: np.zeros_like(matrix) for kind, matrix in claimed.items()},
            silent=claims.silent,
            grid_m=scene.grid_m,
            origin=scene.origin,
            yaw_deg=scene.yaw_deg,
            snap_m=scene.max_snap_m(),
            boxes=graph.cells,
        )
        if claims.silent is not None and claims.silent.any():
            cells = counted(int(claims.silent.sum()), "view cell")
            self.result.notes.append(f"{cells} at an angle: claims of objects only, so none of their cells were judged")
        # Pairs that no suspect is wanted of: claimed, or found wrong already.
        self.settled = {kind: matrix.copy() for kind, matrix in claimed.items()}

    def run(self) -> None:
        """Hunt, look again for what was not seen, and measure what was found."""
        sources, claimed = self.result.sources, self.result.claimed
        start = time.perf_counter()
        objects = claimed.get("object", np.ones((len(self.result.cell_ids), len(self.result.object_names)), bool))
        falsifier = Falsifier(
            boxes=self.result.boxes[sources],
            plans=self.judge.graph.plans.take(sources, self.judge.graph.cell_count),
            spots=self.spots,
            claimed=objects[sources],
            opaque=self.opaque,
            glass=self.glass,
            lines=self.judge.lines,
            cells=(self.result.boxes, claimed["cell"][sources]) if "cell" in claimed else None,
            seed=self.seed,
        )
        self.result.seconds["prepare"] = time.perf_counter() - start
        self.hunt(falsifier)
        self.look_again(falsifier)
        start = time.perf_counter()
        self.measure()
        self.result.seconds["measure"] = time.perf_counter() - start

    def hunt(self, falsifier: Falsifier) -> None:
        """Rays that look for wrong-hidden pairs; the exact judge has the last word on each."""
        start, judged = time.perf_counter(), self.result.seconds.get("adjudicate", 0.0)
        with phase("rays", self.rays, "ray") as bar:
            for suspects, state in falsifier.batches(self.rays):
                self.judge_suspects(suspects)
                bar.reach(state.rays)
                if state.uniform_rays.min(initial=1):
                    largest = Confidence(state.uniform_rays).holes_sr.max()
                    bar.note = f"{len(self.result.wrong)} wrong-hidden, holes below {largest:.2g} sr"
                self.result.rays = state.rays
        self.result.uniform = falsifier.uniform_rays
        if not self.result.rays:
            self.result.statement = "exact: everything is claimed, so nothing is hidden"
        spent = self.result.seconds.get("adjudicate", 0.0) - judged
        self.result.seconds["rays"] = time.perf_counter() - start - spent

    def look_again(self, falsifier: Falsifier) -> None:
        """Mark the claimed pairs that the hunt saw, and look for the others."""
        start = time.perf_counter()
        marks = falsifier.seen()
        objects, sources = len(self.result.object_names), self.result.sources
        for kind in self.result.claimed:
            marked = marks[:, :objects] if kind == "object" else marks[:, objects:]
            self.result.seen[kind][sources] = marked
        look = SecondLook(falsifier.free, falsifier.targets, self.opaque)
        for kind, matrix in self.result.claimed.items():
            rows, targets = np.nonzero(matrix[sources] & ~self.result.seen[kind][sources])
            shift = 0 if kind == "object" else objects
            found, cast = look.see(rows, targets + shift, AGAIN, self.seed)
            self.result.seen[kind][sources[rows[found]], targets[found]] = True
            self.result.rays += cast
        self.result.seconds["look again"] = time.perf_counter() - start

    def judge_suspects(self, suspects: Candidates) -> None:
        """Judge suspects; keep the first confirmed one of each pair."""
        start, result = time.perf_counter(), self.result
        cells = result.sources[suspects.rows]
        ends = [sightline_end(suspects, k, self.judge.graph.cells) for k in range(len(cells))]
        ends = np.array(ends).reshape(-1, 3)
        for number, kind in enumerate(("cell", "object")):
            part = np.flatnonzero(suspects.kinds == number)
            if not len(part):
                continue
            found = self.judge.judge_all(kind, cells[part], suspects.targets[part], suspects.origins[part], ends[part])
            result.grazes += int((found == Judgement.GRAZE).sum())
            result.blocked += int((found == Judgement.BLOCKED).sum())
            for k in part[found == Judgement.VISIBLE]:
                pair = int(cells[k]), int(suspects.targets[k])
                if not self.settled[kind][pair]:
                    self.settled[kind][pair] = True
                    result.wrong.append(WrongPair(kind, *pair, suspects.origins[k], ends[k]))
        result.seconds["adjudicate"] = result.seconds.get("adjudicate", 0.0) + time.perf_counter() - start

    def measure(self) -> None:
        """By how much the sightlines of wrong-hidden pairs clear their surroundings."""
        part = self.result.wrong[:MEASURED]
        if not part:
            return
        origins, ends = np.array([w.origin for w in part]), np.array([w.end for w in part])
        targets = np.array([w.target if w.kind == "object" else -1 for w in part])
        distances, objects = clearances(origins, ends, targets, *self.opaque)
        for k, pair in enumerate(part):
            near = [(int(o), float(d)) for o, d in zip(objects[k], distances[k], strict=True) if o >= 0]
            self.result.wrong[k] = replace(pair, margin=float(distances[k, 0]), nearest=tuple(near))
        narrow = int((distances[:, 0] * self.result.grid_m < self.result.snap_m).sum())
        if narrow:
            self.result.notes.append(
                f"{counted(narrow, 'sightline')} cleared everything by less than vertices were moved to the grid "
                f"({1e3 * self.result.snap_m:.2g} mm); without snapping something may be in the way"
            )
