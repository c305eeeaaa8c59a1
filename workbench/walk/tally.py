"""What a walk came to: a row for each frame, and what all of them say."""

from dataclasses import dataclass, field

import numpy as np

from ...data.camera import CameraPath
from ...solvers.levels.benefit import Tuples
from ...solvers.walk.policies import Policy
from ...solvers.walk.set_items import Shelves
from .arrival import Arrivals
from .display import Shown
from .memory import Memory, Stored
from .settings import WalkSettings
from .truth import Truth


@dataclass(frozen=True)
class Model:
    """All there is.

    Attributes:
        cells: of the graph.
        objects: of the model.
        polygons: of all objects at their finest levels.
        bytes: of all items.
        render_s: modelled time to draw all triangles, pixels left aside [s].
        cost: the cost model in words.
        depth_bytes: of all depth meshes.
    """

    cells: int
    objects: int
    polygons: int
    bytes: int
    render_s: float
    cost: str
    depth_bytes: int


@dataclass(frozen=True)
class PolicyFrames:
    """Frames by one policy.

    Attributes:
        name: of the policy.
        columns: a value for each frame: drawn (objects, polygons, bytes), skipped, missing, resident, ahead and read
            (objects, polygons, bytes), claimed, reads, read_over (bytes between items), failed, swap_s, compute_s,
            render_s, late_s.
        asked: items that each frame asked for, the most wanted first.
        failures: how often ranges did not come, by what was said.
        given_up: whether the source failed too often in a row to be asked on.
    """

    name: str
    columns: dict[str, np.ndarray]
    asked: list[np.ndarray]
    failures: dict[str, int]
    given_up: bool


class Tally:
    """Counts frames of a policy as they come."""

    def __init__(self, policy: Policy, tuples: Tuples) -> None:
        """None yet."""
        self._policy, self._shelves, self._tuples = policy, policy.stock.shelves, tuples
        self._rows: list[dict[str, float]] = []
        self._asked: list[np.ndarray] = []
        shelves = self._shelves
        # Of items of one object alone, which is quicker to count.
        self._owner = shelves.owners if (shelves.owners[shelves.items] >= 0).all() else None

    def add(self, shown: Shown, stored: Stored, render_s: float, late_s: float) -> None:
        """A frame."""
        shelves, there = self._shelves, stored.drawn >= 0
        items = shelves.table[shown.objects[there], stored.drawn[there]]
        row = {
            "drawn_objects": int(there.sum()),
            "drawn_polygons": int(shelves.faces[items].sum()),
            "drawn_bytes": int(shelves.sizes[np.unique(items)].sum()),
            "skipped": stored.skipped,
            "missing": stored.missing,
        }
        for name, own in (("resident", stored.resident), ("ahead", stored.ahead), ("read", stored.read)):
            row |= {
                f"{name}_objects": self._objects(own),
                f"{name}_polygons": int(shelves.faces[own].sum()),
                f"{name}_bytes": int(shelves.sizes[own].sum()),
            }
        row |= {
            "claimed": stored.claimed,
            "reads": stored.reads,
            "read_over": stored.waste,
            "failed": stored.failed,
            "swap_s": stored.swap_s,
            "compute_s": sum(shown.seconds) + stored.seconds,
            "memory_s": stored.seconds,
            "render_s": render_s,
            "late_s": late_s,
        }
        self._rows.append(row)
        self._asked.append(stored.read)

    def _objects(self, items: np.ndarray) -> int:
        """Objects that have a level among the items."""
        if self._owner is not None:
            return int(np.count_nonzero(np.bincount(self._owner[items], minlength=1))) if len(items) else 0
        held = np.zeros(len(self._shelves.sizes), bool)
        held[items] = True
        return int((held[self._shelves.table] & (self._shelves.table >= 0)).any(axis=1).sum())

    def found(self, memory: Memory) -> PolicyFrames:
        """All frames."""
        columns = {name: np.array([row[name] for row in self._rows]) for name in self._rows[0]}
        return PolicyFrames(self._policy.name, columns, self._asked, dict(memory.failures), memory.given_up)


def shown_frames(frames: list[Shown], tuples: Tuples, shelves: Shelves) -> dict[str, np.ndarray]:
    """What the eye saw and what was to be drawn, a value for each frame, whatever was in memory."""
    finest = shelves.items[shelves.starts[:-1]]
    rows = []
    for shown in frames:
        drawn = shown.lods >= 0
        items = shelves.table[shown.objects[drawn], shown.lods[drawn]]
        rows.append(
            {
                "cells": shown.cells,
                "objects": len(shown.objects),
                "polygons": int(shelves.faces[finest[shown.objects]].sum()),
                "set_polygons": shown.left[0],
                "near_polygons": shown.left[1],
                "mesh_polygons": shown.mesh_triangles,
                "chosen_objects": int(drawn.sum()),
                "chosen_polygons": int(shelves.faces[items].sum()),
                "finest_ms": shown.finest_ns / 1e6,
                "chosen_ms": shown.chosen_ns / 1e6,
                "switches": shown.switches,
                "dropped": shown.dropped,
                "eye_s": shown.seconds[0],
                "levels_s": shown.seconds[1],
            }
        )
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


@dataclass(frozen=True)
class Walked:
    """A walk.

    Attributes:
        place: the database.
        path: of the eye.
        settings: of the walk.
        model: all there is.
        index_bytes: read before the first frame.
        shown: a value for each frame: cells, objects and polygons that the eye may see, chosen_objects,
            chosen_polygons, set_polygons and near_polygons (of all that may be seen from the view cell, without and
            with depth meshes, whose own are mesh_polygons), finest_ms and chosen_ms (modelled times to draw them),
            switches, dropped, eye_s, levels_s.
        policies: frames by each policy.
        truths: what checks of sampled frames found, by each policy; empty without.
        arrivals: bytes from nothing to what the eyes of these frames see, likewise.
    """

    place: str
    path: CameraPath
    settings: WalkSettings
    model: Model
    index_bytes: int
    shown: dict[str, np.ndarray]
    policies: list[PolicyFrames]
    truths: list[Truth] = field(default_factory=list)
    arrivals: list[Arrivals] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """Whether no check found an object that the eye sees, is there, and was not drawn."""
        return not any(truth.wrong for truth in self.truths)
