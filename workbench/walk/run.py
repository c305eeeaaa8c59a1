"""Walk: a display database and a path in, what every frame showed, held and read out.

Source: Funkhouser et al. 1996, figure 24: user interface, visibility, detail elision, rendering, lookahead, cache, and
asynchronous reads.
"""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...data.camera import CameraPath
from ...data.contents import cells_holding
from ...data.errors import InputError
from ...data.progress import phase, shown
from ...data.ragged import starts_of
from ...data.store.walk_folder import WalkFolder
from ...solvers.levels.benefit import NOTHING
from ...solvers.walk.policies import POLICIES, Now, Policy, Stock
from ...solvers.walk.range_cells import RangeCells
from ...solvers.walk.set_items import SetItems
from .arrival import Arrivals, oracle_bytes, policy_bytes
from .display import Display, Shown, check_path, shelves_of
from .far import FarFaces
from .level_choice import LevelChoice, read_level_choice
from .memory import Layout, Memory, gap_bytes
from .opened import Opened, opened
from .path import read_path
from .path import walk as generated
from .reader import Line, Reader, SimulatedReader, ThreadReader, WallClock
from .scene import Drawing
from .settings import WalkSettings
from .tally import Model, PolicyFrames, Tally, Walked, shown_frames
from .truth import Judge, Truth

FRAMES = 1_000
# A way through portals may be so much longer than a step between two frames [m]: a path is drawn in straight pieces.
CORNER_M = 1.0


def walk(
    database: WalkFolder | str | Path,
    path: CameraPath | str | Path | None = None,
    *,
    settings: WalkSettings | None = None,
    levels: str | Path | None = None,
    frames: int = FRAMES,
    seed: int = 0,
    check: int = 0,
    progress: bool = False,
) -> Walked:
    """Walk through a display database: what is seen, drawn, held in memory and read, frame by frame.

    Args:
        database: of `viewcell pack`, its folder, or its address (http or https) on a server that knows ranges.
        path: a camera path, or a table of one (docs/tune-file.md); by default a walk to random rooms.
        settings: memory, reads, screen; the same settings and path give the same numbers, but for times, and for what a
            server fails to send.
        levels: a tune-lod.json of `viewcell tune lod`, for costs and choice of levels; else the usual ones.
        frames: of the default walk.
        seed: of the default walk.
        check: so many frames are compared with what rays from the eye meet, and with pictures of the whole model.
        progress: show how far it is on stderr.

    Returns:
        All frames. An object that the eye sees is left out only if no level of it had arrived, or if the frame's time
        did not suffice; both are counted. `Walked.ok` is False if a check found another one.

    Raises:
        InputError: the database is unreadable, altered or older than its bake, the path leaves the model or goes
            through walls, the cache is smaller than a frame's coarsest levels, or as `WalkSettings`.

    Source: Funkhouser et al. 1996, section 4.
    """
    settings = settings or WalkSettings()
    choice = LevelChoice() if levels is None else read_level_choice(levels)
    if check < 0:
        raise InputError(f"check: expected a number of frames from 0, found {check}")
    with ExitStack() as stack:
        stack.enter_context(shown(progress))
        found = stack.enter_context(opened(database, settings.timeout_s))
        way = path if isinstance(path, CameraPath) else None
        if way is None:
            way = generated(found.walk, frames, seed, everywhere=True) if path is None else read_path(path)
        return _Tour(found, way, settings, choice).walked(check)


class _Tour:
    """One path through one database."""

    def __init__(self, opened: Opened, path: CameraPath, settings: WalkSettings, levels: LevelChoice) -> None:
        """Prepare everything, and refuse paths and caches that will not do."""
        walk = opened.walk
        self._opened, self._path, self._settings = opened, path, settings
        far = FarFaces(walk, settings.depth_meshes)
        self._display = Display(walk, settings.screen, levels, settings.target_ms, far)
        shelves = shelves_of(walk, far, settings.polygon_bytes)
        self._holders = cells_holding(walk.graph, path.eyes / walk.grid_m)
        self._ways = RangeCells(walk.graph, walk.grid_m)
        check_path(walk, path, self._holders)
        self._check_walls()
        known = self._display.known
        screen = settings.screen
        half_angle = float(np.arctan(np.hypot(screen.width, screen.height) / 2 / screen.focal))
        self._row_of = np.full(walk.graph.cell_count, -1)
        self._row_of[known.cells] = np.arange(len(known.cells))
        limits = self._display.cell_limits(walk.graph)
        sets = SetItems.of(shelves, *far.sets(known.cells, known.starts, known.members, limits))
        self.stock = Stock(
            shelves,
            sets,
            far.balls(self._display.boxes),
            walk.graph,
            known.cells,
            walk.grid_m,
            half_angle,
            settings.motion,
            settings.cache_bytes,
            np.arange(len(shelves.sizes)) >= walk.items.num_rows if len(far.index) else shelves.steps == 0,
        )
        offsets = np.append(walk.items["offset"].to_numpy().astype(np.int64), far.index.offsets.ravel())
        real = settings.polygon_bytes is None
        self._layout = Layout(offsets if real else starts_of(shelves.sizes)[:-1], shelves.sizes, real)
        steps = np.diff(path.t)
        self._frame_s = float(np.median(steps)) if len(steps) else 1.0
        rate = settings.read_bytes / self._frame_s
        if settings.bandwidth_mbit is not None:
            rate = settings.bandwidth_mbit * 1e6 / 8
        self._line = Line(rate, settings.latency_ms / 1e3)
        self._forward = path.axes()[:, 2]
        ahead = path.eyes[1:] - path.eyes[:-1]
        self._velocity = np.concatenate([np.zeros((1, 3)), ahead / np.maximum(steps, 1e-9)[:, None]])
        self._check_cache()

    def _check_walls(self) -> None:
        """Refuse a step to a cell that no way through portals of about its length leads to."""
        graph, path, (starts, cells) = self._opened.walk.graph, self._path, self._holders
        if not graph.portal_count:
            return
        for frame in range(len(path) - 1):
            here, there = cells[starts[frame] : starts[frame + 1]], cells[starts[frame + 1] : starts[frame + 2]]
            if np.intersect1d(here, there).size:
                continue
            step = float(np.linalg.norm(path.eyes[frame + 1] - path.eyes[frame]))
            if not np.isin(there, self._ways.near(path.eyes[frame], here, step + CORNER_M)[0]).any():
                raise InputError(
                    f"path: expected steps through portals, found one of {step:.2f} m through a wall between frames "
                    f"{frame} and {frame + 1}"
                )

    def _check_cache(self) -> None:
        """Refuse a cache that does not hold what one frame shows at its coarsest."""
        found, coarsest = self._display.seen(self._path), self.stock.shelves.coarsest
        least, worst = 0, 0
        shares = [p.near_share for p in self._kinds() if p.near_share is not None]
        for frame in range(len(self._path)):
            objects = found.objects[found.starts[frame] : found.starts[frame + 1]].astype(np.int64)
            items = np.unique(coarsest[self._display.in_place(self._path, frame, self._held(frame), objects)])
            sizes, second = self.stock.shelves.sizes[items], self.stock.second[items]
            parts = [sizes.sum()]
            parts += [max(sizes[~second].sum() / near, sizes[second].sum() / (1 - near)) for near in shares]
            size = int(np.ceil(max(parts)))
            least, worst = max((least, worst), (size, frame), key=lambda pair: pair[0])
        if self._settings.cache_bytes < least:
            raise InputError(
                f"cache: expected at least {least:,} bytes, which the coarsest levels of frame {worst} take, "
                f"found {self._settings.cache_bytes:,}"
            )

    def _kinds(self) -> list[type[Policy]]:
        return [POLICIES[name] for name in self._settings.policies]

    def walked(self, check: int) -> Walked:
        """Walk by each policy."""
        settings, count = self._settings, len(self._path)
        # In the middle of equal parts: at the very beginning nothing has arrived.
        sampled = np.unique((np.arange(check) + 0.5) * count // max(1, check)).astype(int)
        judge = Judge(self._opened, self._path, self._display) if check else None
        frames: list[Shown] = []
        with phase("walk", count * (1 + len(settings.policies)), "frame") as bar:
            if not settings.real_time:
                self._display.begin()
                for frame in range(count):
                    frames.append(self._display.frame(self._path, frame, self._held(frame)))
                    bar.update()
            found, truths, arrivals = [], [], []
            for kind in self._kinds():
                shown, stored, truth = self._by(kind(self.stock), frames, sampled, judge, bar.update)
                found.append(stored)
                truths.append(truth)
                if judge is not None:
                    arrivals.append(self._arrivals(kind, shown, sampled, judge))
        return Walked(
            self._opened.place, self._path, settings, self._model(), self._opened.index_bytes,
            shown_frames(shown, self._display.tuples, self.stock.shelves), found,
            [truth for truth in truths if truth is not None], arrivals,
        )  # fmt: skip

    def _arrivals(
        self, kind: Callable[[Stock], Policy], frames: list[Shown], sampled: np.ndarray, judge: Judge
    ) -> Arrivals:
        """Bytes from nothing to what the eyes of sampled frames see."""
        gap, sizes, found = gap_bytes(self._line), self.stock.shelves.sizes, []
        for frame in sampled.tolist():
            policy, now = kind(self.stock), self._now(frame, frames[frame])
            pixels = judge.visible_pixels(frame, frames[frame])
            read = policy_bytes(policy, now, pixels, self._layout, gap, self._settings.read_bytes)
            # What objects share, an oracle reads once.
            items, place = np.unique(now.wanted, return_inverse=True)
            shown = np.bincount(place, pixels, len(items)).astype(np.int64)
            found.append((*read, oracle_bytes(shown, sizes[items])))
        return Arrivals(policy.name, *(np.array(part).reshape(-1, 2) for part in zip(*found, strict=True)))

    def _model(self) -> Model:
        """What there is in all."""
        walk, shelves, graph = self._opened.walk, self.stock.shelves, self._opened.walk.graph
        finest = shelves.items[shelves.starts[: walk.objects.num_rows]]
        primitives, count = int(shelves.faces[finest].sum()), walk.items.num_rows
        cost = self._display.cost
        seconds = float(cost.seconds(primitives, 0, len(finest)) * (1 + cost.margin))
        return Model(
            graph.cell_count, walk.objects.num_rows, primitives, int(shelves.sizes[:count].sum()), seconds, cost.line(),
            int(shelves.sizes[count:].sum()),
        )  # fmt: skip

    def _by(
        self, policy: Policy, frames: list[Shown], sampled: np.ndarray, judge: Judge | None, step: Callable[[], None]
    ) -> tuple[list[Shown], PolicyFrames, Truth | None]:
        """Walk by one policy."""
        settings, path, clock = self._settings, self._path, WallClock()
        source = self._opened.source if self._layout.real else None
        if settings.real_time:
            slowed = settings.latency_ms > 0 or settings.bandwidth_mbit is not None
            reader: Reader = ThreadReader(self._opened.source, clock, self._line if slowed else None)
            frames, drawing = [], Drawing(self._opened.walk, settings.screen, self._display.far)
            self._display.begin()
        else:
            reader, drawing = SimulatedReader(source, self._line), None
        memory = Memory(policy, self._layout, reader, self._line, settings.read_bytes)
        tally, truth = Tally(policy, self._display.tuples), None if judge is None else Truth(policy.name)
        clock.begin()
        try:
            for frame in range(len(path)):
                when = float(path.t[frame] - path.t[0])
                if drawing is not None:
                    clock.wait_until(when)
                    frames.append(self._display.frame(path, frame, self._held(frame)))
                begin = time.perf_counter()
                now = self._now(frame, frames[frame])
                looked = time.perf_counter() - begin
                stored = memory.frame(frame, now, frames[frame].lods, when)
                stored = replace(stored, seconds=stored.seconds + looked)
                render_s = 0.0
                if drawing is not None:
                    begin = time.perf_counter()
                    drawing.draw(path, frame, frames[frame].objects, stored.drawn, memory.held)
                    render_s = time.perf_counter() - begin
                tally.add(frames[frame], stored, render_s, clock.now() - when if drawing is not None else 0.0)
                if truth is not None and frame in sampled:
                    truth.add(judge.compare(frame, frames[frame], stored, memory.held))
                step()
        finally:
            reader.close()
        return frames, tally.found(memory), truth

    def _held(self, frame: int) -> np.ndarray:
        """Cells that hold a frame's eye."""
        return self._holders[1][self._holders[0][frame] : self._holders[0][frame + 1]]

    def _now(self, frame: int, shown: Shown) -> Now:
        """A frame as policies see it."""
        path, motion, shelves = self._path, self._settings.motion, self.stock.shelves
        holders = self._held(frame)
        cells, length = self._ways.near(path.eyes[frame], holders, motion.speed * motion.ahead_s)
        rows, own = self._row_of[cells], self._row_of[holders]
        known = rows >= 0
        level = np.where(shown.lods == NOTHING, shelves.counts[shown.objects] - 1, shown.lods)
        wanted = shelves.table[shown.objects, level]
        return Now(
            path.eyes[frame], self._forward[frame], self._velocity[frame], own[own >= 0], rows[known],
            length[known] / motion.speed, shown.objects, wanted, self.stock.urgent(shown.objects, wanted, shown.pixels),
        )  # fmt: skip
