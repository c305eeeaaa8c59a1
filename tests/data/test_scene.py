from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.data.scene import (
    GRID_LIMIT,
    GRID_M,
    Definition,
    Instance,
    Mesh,
    Role,
    Scene,
    degenerate,
    snap,
    source_path,
)

steps = st.integers(-GRID_LIMIT, GRID_LIMIT)


def scene_of(*vertices: list, faces: list, transform: np.ndarray | None = None) -> Scene:
    mesh = Mesh(np.array(vertices, np.float64), np.array(faces, np.int32))
    place = np.eye(4) if transform is None else transform
    return Scene([Definition("d", (mesh,))], [Instance("i", "Mesh", 0, place, Role.OCCLUDER)])


@given(st.floats(-16_000, 16_000))
def test_snap_is_the_nearest_grid_point(metres):
    got = Fraction(int(snap(np.array([metres]), GRID_M, "here")[0])) * Fraction(GRID_M)
    assert abs(got - Fraction(metres)) <= Fraction(GRID_M) / 2


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300, (GRID_LIMIT + 1) * GRID_M])
def test_coordinates_off_the_grid_are_refused(bad):
    with pytest.raises(InputError, match="here: expected") as error:
        snap(np.array([[0.0, bad, 0.0]]), GRID_M, "here")
    assert "\n" not in str(error.value)


def test_grid_limit_itself_is_inside():
    assert snap(np.array([GRID_LIMIT * GRID_M, -GRID_LIMIT * GRID_M]), GRID_M, "").tolist() == [GRID_LIMIT, -GRID_LIMIT]


@given(st.lists(st.tuples(steps, steps, steps), min_size=2, max_size=2), st.integers(0, 3))
def test_degenerate_is_exact_at_any_size(ends, times):
    a, b = np.array(ends)
    on_line = a + (b - a) * times
    if np.abs(on_line).max() <= GRID_LIMIT:
        assert degenerate(np.array([[a, b, on_line]], np.int32)).all()
    off = np.array([a, b, np.clip(on_line, -GRID_LIMIT, GRID_LIMIT - 1) + np.array([0, 0, 1])])
    u, v = [[int(x) for x in off[i] - off[0]] for i in (1, 2)]
    cross = [u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2] for i in range(3)]
    assert degenerate(off[None].astype(np.int32))[0] == (cross == [0, 0, 0])


def test_world_vertices_follow_the_transform():
    turn = np.array([[0, -1, 0, 10], [1, 0, 0, 20], [0, 0, 1, 30], [0, 0, 0, 1.0]])
    scene = scene_of([1, 0, 0], [0, 2, 0], [0, 0, 3], faces=[[0, 1, 2]], transform=turn)
    expected = np.array([[10, 21, 30], [8, 20, 30], [10, 20, 33]]) * 1024
    np.testing.assert_array_equal(scene.world_vertices(0), expected)
    np.testing.assert_array_equal(scene.object_bounds()[0], [expected.min(axis=0), expected.max(axis=0)])


def test_triangles_without_area_are_dropped_and_their_box_is_empty():
    scene = scene_of([0, 0, 0], [1, 0, 0], [2, 0, 1e-5], [0, 1, 0], faces=[[0, 1, 2], [0, 1, 3], [1, 1, 3]])
    assert len(scene.triangles()[0]) == 1
    nothing = scene_of([0, 0, 0], [1, 0, 0], [2, 0, 0], faces=[[0, 1, 2]])
    low, high = nothing.object_bounds()[0]
    assert (low > high).all()


def test_largest_displacement_is_reported():
    scene = scene_of([0, 0, 0.0004], [1, 0, 0], [0, 1, 0], faces=[[0, 1, 2]])
    assert scene.max_snap_m() == 0.0004
    assert scene_of([0, 0, 0], [1, 0, 0], [0, 1, 0], faces=[[0, 1, 2]]).max_snap_m() == 0


def test_owners_and_roles():
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2]], np.int32))
    objects = [Instance("", "", 0, np.eye(4), role) for role in (Role.DETAIL, Role.OCCLUDER, Role.TRANSPARENT)]
    scene = Scene([Definition("", (mesh,))], objects)
    assert scene.triangles()[1].tolist() == [0, 1, 2]
    assert scene.object_mask(Role.DETAIL, Role.OCCLUDER).tolist() == [True, True, False]
    assert [placed.opaque for placed in objects] == [True, True, False]
    assert Scene([], []).object_mask(Role.DETAIL).shape == (0,)


def test_missing_file_is_one_clear_line(tmp_path):
    with pytest.raises(InputError, match="expected a model file or folder, found nothing"):
        source_path(tmp_path / "no.ifc")


def test_an_object_may_have_a_shape_of_its_own_at_some_levels():
    """The other levels stay the very meshes of its definition, and no other object changes."""
    levels = tuple(Mesh(np.eye(3) * k, np.array([[0, 1, 2]], np.int32), 0.1 * k) for k in range(3))
    scene = Scene([Definition("chair", levels)], [Instance(str(i), "", 0, np.eye(4), Role.DETAIL) for i in range(3)])
    own = Mesh(np.eye(3) * 9, np.array([[0, 1, 2]], np.int32), 0.15)
    other = scene.with_own_geometry(1, {1: own})
    assert [placed.definition_id for placed in other.objects] == [0, 1, 0] and len(scene.definitions) == 1
    assert [a is b for a, b in zip(other.definitions[1].lods, levels, strict=True)] == [True, False, True]
    assert other.definitions[1].lods[1] is own
    for lod in (-1, 3):
        with pytest.raises(InputError, match=f"object 1: expected a level below 3, found {lod}"):
            scene.with_own_geometry(1, {lod: own})


def test_boxes_of_objects_are_the_callers_own():
    scene = scene_of([0, 0, 0], [1, 0, 0], [0, 1, 2], faces=[[0, 1, 2]])
    scene.object_bounds()[:] = 7
    assert (scene.object_bounds() * GRID_M).tolist() == [[[0, 0, 0], [1, 1, 2]]]
    scene.bounds()[:] = 7
    assert (scene.bounds() * GRID_M).tolist() == [[0, 0, 0], [1, 1, 2]]
