"""Settings: what nobody can walk by is refused in one line."""

import pytest
from viewcell.data.errors import InputError
from viewcell.solvers.walk.policies import POLICIES
from viewcell.solvers.walk.set_items import Motion
from viewcell.workbench.walk.settings import ALL, DEFAULT_POLICY, WalkSettings


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"policy": "lru"}, "policy: expected coarse-first, as-published, vlod, mmr or all, found 'lru'"),
        ({"cache_bytes": 0}, "cache_bytes: expected a number above 0, found 0"),
        ({"read_bytes": -1}, "read_bytes: expected a number above 0"),
        ({"target_ms": float("nan")}, "target_ms: expected a number above 0, found nan"),
        ({"latency_ms": -1.0}, "latency_ms: expected a number from 0"),
        ({"bandwidth_mbit": 0.0}, "bandwidth_mbit: expected a number above 0"),
        ({"timeout_s": float("inf")}, "timeout_s: expected a number above 0"),
        ({"motion": Motion(speed=0.0)}, "speed: expected a number above 0"),
        ({"motion": Motion(turn_deg=-5.0)}, "turn: expected a number above 0"),
        ({"motion": Motion(ahead_s=-1.0)}, "ahead: expected a number from 0"),
        ({"polygon_bytes": 158, "real_time": True}, "polygon_bytes: expected it on a simulated clock only"),
    ],
)
def test_refused(given, why):
    with pytest.raises(InputError) as refused:
        WalkSettings(**given)
    assert why in str(refused.value)


def test_all_means_each():
    assert WalkSettings(policy=ALL).policies == tuple(POLICIES)
    assert WalkSettings().policies == (DEFAULT_POLICY,) and DEFAULT_POLICY in POLICIES
    assert WalkSettings(latency_ms=0.0, motion=Motion(ahead_s=0.0)).policy == DEFAULT_POLICY
