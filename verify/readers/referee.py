"""What a second reader finds in a model file against the scene that was read from it, both ways."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...data.scene import Scene

# Shares of an area, and of the largest distance from the scene's origin, that float32 and sums in another order may be
# off by.
AREA_SHARE, REACH_SHARE = 1.0e-4, 2.0**-22


@dataclass(frozen=True)
class Found:
    """One object as a second reader finds it, in metres, Z up, in the file's own frame.

    Attributes:
        key: GUID if the format has lasting names, else the name.
        box: least and greatest coordinates [m], shape (2, 3), float64.
        area: of all faces, each once [m2].
    """

    key: str
    box: np.ndarray
    area: float


def differences(scene: Scene, found: Iterable[Found]) -> list[str]:
    """What a scene has otherwise than a second reader found: lost, extra, elsewhere, or of another area; one line each.

    Objects that share a key are told apart by their boxes. Boxes may differ by the grid step that vertices are moved
    by, areas by what moving every corner so far can change.
    """
    ours, theirs = defaultdict(list), defaultdict(list)
    for one in _objects(scene):
        ours[one.key].append(one)
    for one in found:
        theirs[one.key].append(one)
    lines = []
    for key in sorted(ours.keys() | theirs.keys()):
        a, b = (sorted(side.get(key, []), key=lambda one: one.box.ravel().tolist()) for side in (ours, theirs))
        if len(a) != len(b):
            lines.append(f"{key!r}: expected {_count(b)} as a second reader finds, found {_count(a)}")
            continue
        lines += [line for one, other in zip(a, b, strict=True) if (line := _difference(scene, one, other))]
    return lines


def _count(found: list[Found]) -> str:
    return f"{len(found)} object{'s' * (len(found) != 1)}"


def _difference(scene: Scene, ours: Found, theirs: Found) -> str:
    # From the scene's origin, not the file's: what is far from that is no less exact.
    slack = scene.grid_m + REACH_SHARE * np.abs(theirs.box - scene.origin).max()
    apart = np.abs(ours.box - theirs.box).max()
    if not apart <= slack:
        return f"{ours.key!r}: expected the box {_text(theirs.box)}, found {_text(ours.box)}"
    # Corners that move by the slack change an area by at most their share of the perimeter, which the box bounds.
    blur = AREA_SHARE * theirs.area + 8 * slack * np.ptp(theirs.box, axis=0).sum()
    if not abs(ours.area - theirs.area) <= blur:
        return f"{ours.key!r}: expected an area of {theirs.area:.6g} m2, found {ours.area:.6g} m2"
    return ""


def _text(box: np.ndarray) -> str:
    low, high = (", ".join(f"{x:.6g}" for x in corner) for corner in box)
    return f"({low}) to ({high})"


def _objects(scene: Scene) -> Iterable[Found]:
    for placed in scene.objects:
        mesh = scene.definitions[placed.definition_id].lods[0]
        points = mesh.vertices @ placed.transform[:3, :3].T + placed.transform[:3, 3]
        points = scene.in_model(points)
        corners = points[mesh.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = float(np.linalg.norm(normals, axis=1).sum() / 2)
        used = corners.reshape(-1, 3)
        yield Found(placed.guid or placed.name, np.array([used.min(axis=0), used.max(axis=0)]), area)
