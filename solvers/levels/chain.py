"""Chains of levels of detail, each about half of the one before, with a proved bound on its deviation from the finest.

Simplification is a library's business (`data.lod.simplified`), what may be promised of its answer is not: deviations
are measured on the meshes, in both directions and from level 0, and watertightness is checked.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from ...data.lod import simplified, watertight, welded
from ...data.progress import track
from ...data.scene import Definition, Mesh, Scene
from ...kernels import deviation
from ...kernels.deviation import launch_deviation
from ...kernels.launch import CPU, Device

# A level has at most this share of the triangles of the one before.
SHARE = 0.75
COARSEST = 100


@dataclass(frozen=True)
class LodChain:
    """Levels of detail of one mesh.

    Attributes:
        levels: finest first; the first is the mesh as given, the others are exact in float32. `error_m` bounds the
            Hausdorff distance to the first, both ways, rounding included, and does not fall along the chain.
        lower_m: lower bounds on the same distances, shape (levels,), float64.
        watertight: whether the first level is; then all are.
        ended: why the last level has more triangles than asked; empty if it has not.
    """

    levels: tuple[Mesh, ...]
    lower_m: np.ndarray
    watertight: bool
    ended: str


def lod_chain(mesh: Mesh, *, coarsest: int = COARSEST, where: str = "mesh", device: Device = CPU) -> LodChain:
    """Halve a mesh until it has at most `coarsest` triangles.

    A mesh with non-manifold edges, holes or overlapping parts is simplified like any other, with the same bound, but
    without a promise that it stays a surface of any kind. A watertight mesh (every directed edge has its opposite, as
    often; positions merged) gets watertight levels only.

    Args:
        mesh: finest level; its `error_m` is taken to be 0.
        coarsest: triangles that the last level may have; a mesh that has no more is its own chain.
        where: what to call the mesh in an error.
        device: where to measure deviations.

    Returns:
        The same chain for the same mesh. It ends early where nothing simpler is found, and says so.

    Raises:
        InputError: a coordinate is not finite, or a face names no vertex.
    """
    finest = welded(mesh, where)
    closed = watertight(finest)
    surface = _surface(finest)
    levels, lower = [replace(mesh, error_m=0.0)], [0.0]
    left = len(finest.faces)
    while len(surface) and left > coarsest:
        found = _best(finest, surface, left, closed, device)
        if found is None:
            break
        level, low = found
        levels.append(replace(level, error_m=max(level.error_m, levels[-1].error_m)))
        lower.append(low)
        left = len(level.faces)
    ended = "" if left <= coarsest else f"nothing simpler found below {left} triangles"
    if not len(surface):
        ended = "no triangle that has an area"
    return LodChain(tuple(levels), np.array(lower), closed, ended)


def _surface(mesh: Mesh) -> np.ndarray:
    """Triangles that have an area: what is drawn."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return corners[(normals != 0).any(axis=1)]


def _best(finest: Mesh, surface: np.ndarray, count: int, closed: bool, device: Device) -> tuple[Mesh, float] | None:
    """Of the ways to about half of `count` triangles the one that deviates least, and a lower bound on how much."""
    best = None
    for level in simplified(finest, count // 2):
        if len(level.faces) > SHARE * count or (closed and not watertight(level)) or not len(_surface(level)):
            continue
        found = launch_deviation(surface, _surface(level), device=device)
        if best is None or found.upper.max() < best[0].error_m:
            best = replace(level, error_m=float(found.upper.max())), float(found.lower.max())
    return best


def with_lods(scene: Scene, *, device: Device = CPU) -> tuple[Scene, list[dict[str, str]]]:
    """A scene whose definitions of a single level have chains of them; level 0 stays as it was.

    Args:
        scene: definitions that have several levels already keep those.
        device: where to measure deviations; on as many definitions at a time as it has threads.

    Returns:
        The scene, and what could not be promised, as {"what": definition, "why": reason}.

    Raises:
        InputError: a mesh has coordinates that are not finite, or indices out of range.
    """

    def build(number: int) -> LodChain:
        shape = scene.definitions[number]
        return lod_chain(shape.lods[0], where=f"definition {number} {shape.name!r}", device=Device(device.name))

    # Once, not in every thread.
    wp.load_module(deviation.__name__, device=device.name)
    single = [i for i, shape in enumerate(scene.definitions) if len(shape.lods) == 1]
    with ThreadPoolExecutor(device.threads) as pool:
        made = pool.map(build, single)
        chains = list(track(made, "levels of detail", "shape", len(single)))
    definitions, notes = list(scene.definitions), []
    for number, chain in zip(single, chains, strict=True):
        name = scene.definitions[number].name
        definitions[number] = Definition(name, chain.levels)
        if chain.ended:
            notes.append({"what": name, "why": chain.ended})
        if len(chain.levels) > 1 and not chain.watertight:
            notes.append({"what": name, "why": "not watertight, so its levels need not be"})
    return replace(scene, definitions=definitions), notes
