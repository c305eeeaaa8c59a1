"""What a walk may be told."""

from dataclasses import dataclass, field

import numpy as np

from ...data.camera import Screen
from ...data.errors import InputError
from ...data.store.remote import TIMEOUT_S
from ...solvers.walk.policies import POLICIES
from ...solvers.walk.set_items import Motion

ALL = "all"
DEFAULT_POLICY = "coarse-first"


@dataclass(frozen=True)
class WalkSettings:
    """How a walk is done.

    Attributes:
        policy: what is held in memory: coarse-first, as-published, vlod or mmr; or all, one after the other.
        target_ms: frame time that levels of detail are chosen for [ms].
        cache_bytes: memory for items.
        read_bytes: most that is asked for in a frame; without a bandwidth also what a frame's time suffices for.
        latency_ms: before the first byte of each range [ms].
        bandwidth_mbit: of disk or network [Mbit/s]; None for `read_bytes` a frame.
        screen: what frames are drawn on.
        motion: how fast the user may move and turn, and how far is looked ahead.
        polygon_bytes: what a triangle takes in the memory of a renderer whose vertices are larger than positions; None
            for what it takes in the file. With it nothing is read.
        timeout_s: for which an answer is awaited [s].
        depth_meshes: draw what the database has of them in place of what stands on them.
        real_time: frames at their times, reads by a thread, times measured; else on a simulated clock.

    Raises:
        InputError: a number out of its range, or an unknown policy.
    """

    policy: str = DEFAULT_POLICY
    target_ms: float = 16.0
    cache_bytes: int = 16_000_000
    read_bytes: int = 800_000
    latency_ms: float = 0.0
    bandwidth_mbit: float | None = None
    screen: Screen = field(default_factory=Screen)
    motion: Motion = field(default_factory=Motion)
    polygon_bytes: int | None = None
    timeout_s: float = TIMEOUT_S
    depth_meshes: bool = True
    real_time: bool = False

    def __post_init__(self) -> None:
        """Refuse what nobody can walk by."""
        if self.policy not in (*POLICIES, ALL):
            raise InputError(f"policy: expected {', '.join(POLICIES)} or {ALL}, found {self.policy!r}")
        above = ("target_ms", "cache_bytes", "read_bytes", "bandwidth_mbit", "polygon_bytes", "timeout_s")
        numbers = {name: getattr(self, name) for name in (*above, "latency_ms")}
        numbers |= {"speed": self.motion.speed, "turn": self.motion.turn_deg, "ahead": self.motion.ahead_s}
        for name, value in numbers.items():
            least = 0 if name in ("latency_ms", "ahead") else np.nextafter(0, 1)
            if value is not None and not least <= value < np.inf:
                raise InputError(f"{name}: expected a number {'from' if not least else 'above'} 0, found {value}")
        if self.polygon_bytes is not None and self.real_time:
            raise InputError("polygon_bytes: expected it on a simulated clock only: files have no such items")

    @property
    def policies(self) -> tuple[str, ...]:
        """Those to walk with, in order."""
        return tuple(POLICIES) if self.policy == ALL else (self.policy,)
