"""Ends of walls that stand against each other are no targets; all other faces are, each in pieces that hold it."""

import numpy as np
import pytest
import trimesh
from builders import random_solids, turned_house
from viewcell.data.exposed import UprightFace, exposed_faces, face_pieces
from viewcell.data.occludees import find_occludees
from viewcell.data.prepared import PreparedModel

# Corners of two walls along a line at an angle, on the grid.
A, B, C = np.array([0, 0]), np.array([4000, 1000]), np.array([7000, 1750])
ACROSS = np.array([-60, 240])


def wall(start, end, heights=(0, 3000), wide=ACROSS):
    """An upright wall between two plan points [grid steps], as a mesh in metres."""
    plan = np.array([start, end, end + wide, start + wide])
    corners = np.concatenate([np.column_stack([plan, np.full(4, h)]) for h in heights])
    faces = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]
    for k in range(4):
        j = (k + 1) % 4
        faces += [[k, j, 4 + j], [k, 4 + j, 4 + k]]
    return trimesh.Trimesh(corners * 2.0**-10, faces, process=False)


def exposed(*meshes):
    scene = random_solids.scene_of_meshes(list(meshes))
    return exposed_faces(PreparedModel(scene).closed)


def ends_of(faces):
    return {frozenset(map(tuple, face.ends.tolist())) for face in faces}


def test_walls_end_to_end_hide_their_ends():
    found = exposed(wall(A, B), wall(B, C))
    joint = frozenset([tuple(B), tuple(B + ACROSS)])
    assert set(found) == {0, 1}
    assert all(len(faces) == 3 and joint not in ends_of(faces) for faces in found.values())


def test_a_lower_wall_covers_nothing_but_is_covered():
    found = exposed(wall(A, B), wall(B, C, heights=(0, 2000)))
    assert set(found) == {1} and len(found[1]) == 3


def test_two_walls_on_each_other_cover_together():
    found = exposed(wall(A, B), wall(B, C, heights=(0, 1500)), wall(B, C, heights=(1500, 3000)))
    assert set(found) == {0, 1, 2}
    apart = exposed(wall(A, B), wall(B, C, heights=(0, 1500)), wall(B, C, heights=(1501, 3000)))
    assert set(apart) == {1, 2}


@pytest.mark.parametrize(
    "other",
    {
        "a step away": wall(B + np.array([1, 0]), C),
        "narrower": wall(B, C, wide=ACROSS // 2),
        "on the same side": wall(B, A + np.array([0, 400])),
        "inside out": wall(B, C),
    }.items(),
    ids=lambda item: item[0],
)
def test_what_does_not_cover(other):
    name, mesh = other
    if name == "inside out":
        mesh.invert()
    found = exposed(wall(A, B), mesh)
    assert 0 not in found


def test_elements_along_the_axes_are_left_alone():
    assert not exposed(random_solids.box([0, 0, 0], [2, 0.2, 3]), random_solids.box([2, 0, 0], [4, 0.2, 3]))


def test_elements_with_sloped_faces_are_left_alone():
    leaning = wall(B, C)
    leaning.vertices[4:] += [0.01, 0.0, 0.0]
    assert 1 not in exposed(wall(A, B), leaning)


@pytest.mark.parametrize("way", [(4000, 1000), (-37, 12), (1, 3000), (0, 500), (5, -2)])
def test_pieces_hold_a_face(way):
    start = np.array([13, -7])
    ends = np.array([start, start + way])
    corners = np.array(
        [[[*ends[0], 0], [*ends[1], 0], [*ends[1], 900]], [[*ends[0], 0], [*ends[1], 900], [*ends[0], 900]]]
    )
    boxes, prisms = face_pieces(UprightFace(ends, corners), 1000)
    assert len(boxes) + len(prisms) >= 1
    for share in np.linspace(0, 1, 101):
        point = ends[0] + share * (ends[1] - ends[0])
        held = [(point >= box[0, :2]).all() and (point <= box[1, :2]).all() for box in boxes]
        for prism in prisms:
            plan, rest = prism[:, :2], point - prism[:, :2]
            along = np.roll(plan, -1, axis=0) - plan
            held.append((along[:, 0] * rest[:, 1] - along[:, 1] * rest[:, 0] >= -1e-6).all())
        assert any(held)
    assert all(part[:, 2].min() == 0 and part[:, 2].max() == 900 for part in [*boxes, *prisms])


def test_pieces_of_a_model_hold_all_but_covered_faces():
    """Points of uncovered faces lie in pieces of their object; the middle of the joint does not."""
    meshes = [wall(A, B), wall(B, C), turned_house.upright(random_solids.box([1, 2, 0], [2, 3, 1]), 20)]
    scene = random_solids.scene_of_meshes(meshes)
    model = PreparedModel(scene)
    found, plain = model.occludees, find_occludees(scene)
    plans = found.plans.filled(len(found.pieces), np.arange(len(found.pieces)))

    def holds(object_id, point):
        for piece in range(found.starts[object_id], found.starts[object_id + 1]):
            box, plan = found.pieces[piece], plans[piece].astype(float)
            along = np.roll(plan, -1, axis=0) - plan
            rest = point[:2] - plan
            if (point >= box[0] - 1e-6).all() and (point <= box[1] + 1e-6).all():
                if not plan.any() or (along[:, 0] * rest[:, 1] - along[:, 1] * rest[:, 0] >= -1e-3).all():
                    return True
        return False

    joint = np.append(B + ACROSS / 2, 1500.0)
    assert not holds(0, joint) and not holds(1, joint)
    triangles, owners = scene.triangles()
    random = np.random.default_rng(0)
    for triangle, owner in zip(triangles, owners, strict=True):
        on_joint = all(tuple(p[:2]) in {tuple(B), tuple(B + ACROSS)} for p in triangle.tolist())
        for point in random.dirichlet(np.ones(3), 6) @ triangle:
            assert on_joint or holds(owner, point)
    # What is not touched is cut as it was.
    a, b = (some.pieces[some.starts[2] : some.starts[3]] for some in (found, plain))
    assert np.array_equal(a, b)


def test_copies_of_a_wall_have_its_faces_where_they_stand():
    """Two pairs of walls end to end, the second pair a copy of the first one elsewhere."""
    shift = np.array([9000, -4000])
    walls = [wall(A, B), wall(B, C), wall(A + shift, B + shift), wall(B + shift, C + shift)]
    model = PreparedModel(random_solids.scene_of_meshes(walls))
    models = model.scene.first_alike
    assert models.tolist() == [0, 1, 0, 1]
    own, copied = exposed_faces(model.closed), exposed_faces(model.closed, models)
    assert list(own) == list(copied) == [0, 1, 2, 3]
    for one, other in zip(own.values(), copied.values(), strict=True):
        for face, same in zip(one, other, strict=True):
            np.testing.assert_array_equal(face.ends, same.ends)
            np.testing.assert_array_equal(face.corners, same.corners)
