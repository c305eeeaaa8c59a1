"""Curtains proved from triangles: inside walls and on their faces, and not a step beyond."""

import numpy as np
import trimesh
from builders import random_solids
from viewcell.verify.proofs.curtain import is_opaque
from viewcell.verify.proofs.opaque import OpaqueSurfaces

# A wall along (4, 3): its plan [grid steps], and its height.
PLAN = np.array([[0, 0], [4000, 3000], [3700, 3400], [-300, 400]])
TOP = 3000


def prism(plan, low, high, left_out=()):
    """Triangles of a prism, some of its faces left out: sides 0 to 3, bottom 4, top 5."""
    p = [[*map(int, c), z] for z in (low, high) for c in plan]
    faces = [(k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k) for k in range(4)] + [(3, 2, 1, 0), (4, 5, 6, 7)]
    kept = [face for n, face in enumerate(faces) if n not in left_out]
    return [[p[a], p[b], p[c]] for f in kept for a, b, c in ((f[0], f[1], f[2]), (f[0], f[2], f[3]))]


def surfaces(*parts):
    owners = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    return OpaqueSurfaces(np.concatenate([np.array(part) for part in parts]), owners)


def along(share, out=0.5):
    """A plan point of the wall: along its length, and through its thickness."""
    a, b, d = PLAN[0], PLAN[1], PLAN[3]
    return np.round(a + share * (b - a) + out * (d - a)).astype(int).tolist()


WALL = surfaces(prism(PLAN, 0, TOP))


def test_the_middle_and_the_faces_of_a_wall_are_opaque():
    for out in (0, 0.5, 1):
        assert is_opaque(WALL, [along(0, out), along(1, out)], 0, TOP)
        assert is_opaque(WALL, [along(1, out), along(0, out)], 0, TOP)
    # Across it, from edge to edge.
    assert is_opaque(WALL, [along(0, 0), along(1, 1)], 0, TOP)


def test_a_step_beyond_the_wall_is_open():
    ends = [along(0.1), along(0.9)]
    assert is_opaque(WALL, ends, 0, TOP)
    assert not is_opaque(WALL, ends, 0, TOP + 1) and not is_opaque(WALL, ends, -1, TOP)
    assert not is_opaque(WALL, [along(0), along(1, 1.25)], 0, TOP)
    for k, step in ((0, [4, 3]), (1, [4, 3])):
        faces = [along(0, 0), along(1, 0)]
        moved = [int(c) + (s if k else -s) for c, s in zip(faces[k], step, strict=True)]
        faces[k] = moved
        assert not is_opaque(WALL, faces, 0, TOP)
    for step in ([0, -1], [1, 0]):
        assert not is_opaque(WALL, [[int(c) + s for c, s in zip(p, step, strict=True)] for p in PLAN[:2]], 0, TOP)


def test_nothing_is_opaque_without_length_or_height():
    assert not is_opaque(WALL, [along(0.5), along(0.5)], 0, TOP)
    assert not is_opaque(WALL, [along(0), along(1)], TOP, TOP)
    assert not is_opaque(WALL, [along(0), along(1)], TOP, 0)


def test_an_open_element_is_opaque_on_its_faces_only():
    for missing in range(6):
        wall = surfaces(prism(PLAN, 0, TOP, left_out=(missing,)))
        assert not is_opaque(wall, [along(0), along(1)], 0, TOP)
        assert is_opaque(wall, [along(0, 0), along(1, 0)], 0, TOP) == (missing != 0)


def test_a_wall_with_a_window_is_open_where_the_window_is():
    """Four parts about a window from 0.4 to 0.6 of the length, z 1000 to 2000."""

    def part(first, last, low, high):
        return prism([along(first, 0), along(last, 0), along(last, 1), along(first, 1)], low, high)

    parts = part(0, 0.4, 0, TOP), part(0.6, 1, 0, TOP), part(0.4, 0.6, 0, 1000), part(0.4, 0.6, 2000, TOP)
    wall = surfaces(*parts)
    face = [along(0, 0), along(1, 0)]
    assert is_opaque(wall, face, 0, 1000) and is_opaque(wall, face, 2000, TOP)
    assert not is_opaque(wall, face, 0, 1001) and not is_opaque(wall, face, 1999, TOP)
    assert not is_opaque(wall, face, 0, TOP)
    assert is_opaque(wall, [along(0, 0), along(0.4, 0)], 0, TOP)
    assert not is_opaque(wall, [along(0, 0), along(0.6, 0)], 0, TOP)


def test_a_face_with_a_missing_triangle_is_open():
    triangles = prism(PLAN, 0, TOP)
    for n in (0, 1):
        wall = surfaces(triangles[:n] + triangles[n + 1 :])
        assert not is_opaque(wall, [PLAN[0].tolist(), PLAN[1].tolist()], 0, TOP)


def test_random_curtains_in_a_turned_box_against_sampled_points():
    random, found = np.random.default_rng(0), [0, 0]
    mesh = trimesh.creation.box([4, 0.5, 3])
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.3, [0, 0, 1]))
    scene = random_solids.scene_of_meshes([mesh])
    triangles, owners = scene.triangles()
    wall = OpaqueSurfaces(triangles, owners)
    for _ in range(300):
        middle = trimesh.transformations.rotation_matrix(0.3, [0, 0, 1])[:2, :2]
        ends = (random.uniform([-2.1, -0.27], [2.1, 0.27], (2, 2)) @ middle.T * 1024).round().astype(int)
        low, high = np.sort(random.integers(-1600, 1600, 2)).tolist()
        holds = is_opaque(wall, ends.tolist(), low, high)
        points = np.array([[*p, z] for p in ends for z in (low, high)]) / 1024
        inner = points.mean(axis=0) + (points - points.mean(axis=0)) * 0.999
        if holds:
            assert mesh.contains(inner).all()
        found[holds] += 1
    assert min(found) > 40
