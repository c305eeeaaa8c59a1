"""Sampling: rays cast, guided and judged exactly."""

from ...data.silence import start_warp

start_warp()
