"""`viewcell walk`: reads its options, walks, prints and writes. Nothing heavy is imported before it is needed."""

import argparse
from pathlib import Path

from ..results import as_json
from ..terminal import FAILED, say


def walk(options: argparse.Namespace) -> int:
    """Walk through a display database, print the papers' tables and write them down."""
    from ...data.camera import Screen
    from ...solvers.walk.set_items import Motion
    from .settings import WalkSettings

    settings = WalkSettings(
        policy=options.policy,
        target_ms=options.target_ms,
        cache_bytes=int(options.cache),
        read_bytes=int(options.read),
        latency_ms=options.latency,
        bandwidth_mbit=options.bandwidth,
        screen=Screen(*options.image, options.fov),
        motion=Motion(options.speed, options.turn, options.ahead),
        polygon_bytes=options.polygon_bytes,
        timeout_s=options.timeout,
        depth_meshes=options.depth_meshes,
        real_time=options.real_time,
    )
    from .pages import default_out, write_walk
    from .run import walk as run
    from .tables import walk_text

    path = None if options.path == "auto" else options.path
    found = run(
        options.walk,
        path,
        settings=settings,
        levels=options.levels,
        frames=options.frames,
        seed=options.seed,
        check=options.check,
    )
    out = Path(options.out) if options.out else default_out(options.walk)
    written, code = write_walk(found, out), 0 if found.ok else FAILED
    if options.json:
        from .pages import walk_json

        say(as_json("walk", code, walk_json(found) | {"folder": str(out), "files": written}))
    else:
        say(walk_text(found))
        say(f"written to {out}")
    return code
