"""Levels of detail: simplified meshes to choose from, objects by connected component, and how far a level sticks out.

Nothing here says how far a simplified mesh is from its original; `solvers.levels.chain` measures that.
"""

from dataclasses import replace

import fast_simplification
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from .errors import InputError
from .ragged import starts_of
from .scene import Definition, Instance, Mesh, Scene
from .solids import is_closed

# Exponents of the error that an edge collapse may accept: high ones get through where low ones stop.
AGGRESSIVENESS = (2.0, 4.0, 7.0)
# Cells along the longest side of a mesh, at most, when vertices are clustered.
FINEST_CLUSTERS = 512


def welded(mesh: Mesh, where: str) -> Mesh:
    """The mesh with one vertex a position, and no triangle that uses a position twice.

    Raises:
        InputError: a coordinate is not finite, or a face names no vertex.
    """
    vertices, faces = np.asarray(mesh.vertices, np.float64).reshape(-1, 3), np.asarray(mesh.faces).reshape(-1, 3)
    if not np.isfinite(vertices).all():
        raise InputError(f"{where}: expected finite coordinates, found {vertices[~np.isfinite(vertices)][0]}")
    if faces.size and not (0 <= faces.min() and faces.max() < len(vertices)):
        raise InputError(
            f"{where}: expected vertex indices below {len(vertices)}, found {faces.min()} to {faces.max()}"
        )
    points, places = np.unique(vertices, axis=0, return_inverse=True)
    faces = places.reshape(-1)[faces].astype(np.int32)
    return _compact(points, faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)], mesh.error_m)


def watertight(mesh: Mesh) -> bool:
    """Whether a welded mesh has triangles, and every directed edge its opposite, as often."""
    # Positions are one to one with indices.
    return bool(len(mesh.faces)) and is_closed(np.stack([mesh.faces, *[np.zeros_like(mesh.faces)] * 2], axis=2))


def simplified(mesh: Mesh, target: int) -> list[Mesh]:
    """Ways to bring a welded mesh down to about `target` triangles; each welded, exact in float32, none empty.

    Edges are collapsed by quadric error (Garland and Heckbert 1997, "Surface simplification using quadric error
    metrics"), at several degrees of aggressiveness. Where none comes within a tenth of the target, vertices are
    clustered on a grid (Rossignac and Borrel 1993, "Multi-resolution 3D approximations for rendering complex scenes"),
    which gets through non-manifold meshes and heaps of small parts, and keeps closed surfaces closed: merging vertices
    takes pairs of opposite edges to pairs of opposite edges, and the edges of a triangle that collapses cancel.

    The same answer for the same mesh. `error_m` is infinite: nothing is known of the deviation yet.
    """
    found = [_collapsed(mesh, target, aggressiveness) for aggressiveness in AGGRESSIVENESS]
    if not any(0 < len(made.faces) <= 1.1 * target for made in found):
        found.append(_clustered(mesh, target))
    return [made for made in found if len(made.faces)]


def _collapsed(mesh: Mesh, target: int, aggressiveness: float) -> Mesh:
    points, faces = fast_simplification.simplify(mesh.vertices, mesh.faces, target_count=target, agg=aggressiveness)
    return _drawable(points, faces)


def _clustered(mesh: Mesh, target: int) -> Mesh:
    """Vertices of each cubic cell merged into their mean; the most cells that leave at most `target` triangles."""
    low, best = mesh.vertices.min(axis=0), _drawable(mesh.vertices[:0], mesh.faces[:0])
    size = float((mesh.vertices.max(axis=0) - low).max())
    few, many = 0, FINEST_CLUSTERS + 1
    while many - few > 1 and size > 0:
        count = (few + many) // 2
        cells = np.floor((mesh.vertices - low) * (count / size)).astype(np.int64)
        _, places, sizes = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
        places = places.reshape(-1)
        sums = [np.bincount(places, column) for column in mesh.vertices.T]
        made = _drawable(np.stack(sums, axis=1) / sizes[:, None], places[mesh.faces])
        if len(made.faces) <= target:
            few, best = count, made
        else:
            many = count
    return best


def _drawable(points: np.ndarray, faces: np.ndarray) -> Mesh:
    # Bake folders store float32.
    return welded(Mesh(np.asarray(points).astype(np.float32).astype(np.float64), faces, np.inf), "simplified mesh")


def _compact(points: np.ndarray, faces: np.ndarray, error_m: float) -> Mesh:
    """A mesh without the vertices that no triangle uses."""
    used, places = np.unique(faces, return_inverse=True)
    return Mesh(points[used], places.reshape(-1, 3).astype(np.int32), error_m)


def split_components(scene: Scene) -> Scene:
    """A scene whose objects are connected: every component of an object becomes an object of its own.

    Triangles are connected if they share a vertex position. A closed component keeps what lies in its bounding box
    with it: the inner shell of a hollow solid, alone, would turn its cavity into matter, and hide what is there.
    Definitions with several levels stay whole, for the components of one level say nothing of those of another. What
    instances share they still share; components are named after their object, with #0, #1 ... in order of their first
    triangle. Source: Chhugani et al. 2005, section 4 (polygon simplification).

    Raises:
        InputError: a mesh has coordinates that are not finite, or indices out of range.
    """
    definitions: list[Definition] = []
    ids: list[list[int]] = []
    for number, shape in enumerate(scene.definitions):
        parts = [shape]
        if len(shape.lods) == 1:
            parts = _components(shape, f"definition {number} {shape.name!r}")
        ids.append(list(range(len(definitions), len(definitions) + len(parts))))
        definitions += parts
    objects: list[Instance] = []
    for placed in scene.objects:
        parts = ids[placed.definition_id]
        names = [placed.name] if len(parts) == 1 else [f"{placed.name} #{i}" for i in range(len(parts))]
        objects += [replace(placed, name=name, definition_id=i) for name, i in zip(names, parts, strict=True)]
    return replace(scene, definitions=definitions, objects=objects)


def _components(shape: Definition, where: str) -> list[Definition]:
    """A definition for each component; the definition itself if there is only one."""
    mesh = shape.lods[0]
    points = welded(mesh, where).vertices
    faces = np.asarray(mesh.faces).reshape(-1, 3)
    positions, places = np.unique(np.asarray(mesh.vertices).reshape(-1, 3), axis=0, return_inverse=True)
    corners = places.reshape(-1)[faces]
    if not len(points):
        return [shape]
    links = np.ones(2 * len(faces)), (corners[:, [0, 0]].ravel(), corners[:, 1:].ravel())
    label = connected_components(coo_array(links, shape=(len(positions),) * 2), directed=False)[1][corners[:, 0]]
    label = _with_contents(mesh, label, where)
    first = np.unique(label, return_index=True)[1]
    if len(first) == 1:
        return [shape]
    chosen = [faces[label == label[row]] for row in np.sort(first)]
    return [
        Definition(f"{shape.name} #{i}", (_compact(mesh.vertices, part, mesh.error_m),))
        for i, part in enumerate(chosen)
    ]


def _with_contents(mesh: Mesh, label: np.ndarray, where: str) -> np.ndarray:
    """Labels of triangles, those of closed components taken over by all that lies in their bounding boxes."""
    _, label = np.unique(label, return_inverse=True)
    count = int(label.max()) + 1
    corners = mesh.vertices[mesh.faces]
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, label, corners.min(axis=1))
    np.maximum.at(high, label, corners.max(axis=1))
    order = np.argsort(label, kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(label))[:-1])
    links = []
    for outer, part in enumerate(parts):
        inside = np.flatnonzero((low >= low[outer]).all(axis=1) & (high <= high[outer]).all(axis=1))
        if len(inside) > 1 and watertight(welded(Mesh(mesh.vertices, mesh.faces[part]), where)):
            links += [(outer, inner) for inner in inside]
    pairs = np.array(links, int).reshape(-1, 2).T
    graph = coo_array((np.ones(pairs.shape[1]), (pairs[0], pairs[1])), shape=(count, count))
    return connected_components(graph, directed=False)[1][label]


def object_errors(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Deviation of every level of every object from its level 0, in the scene's metres.

    A transform stretches a definition's `error_m` by at most the spectral norm of its linear part.

    Returns:
        Deviations [m], float64, object after object and level after level; where each object's begin, shape
        (objects + 1,), int64.
    """
    if not scene.objects:
        return np.zeros(0), np.zeros(1, np.int64)
    levels = [[mesh.error_m for mesh in shape.lods] for shape in scene.definitions]
    of = [placed.definition_id for placed in scene.objects]
    linear = np.stack([placed.transform[:3, :3] for placed in scene.objects])
    # Above the rounding of the singular values.
    stretch = np.linalg.norm(linear, ord=2, axis=(1, 2)) * (1 + 2.0**-40)
    starts = starts_of([len(levels[i]) for i in of])
    return np.concatenate([np.array(levels[i]) * s for i, s in zip(of, stretch, strict=True)]), starts
