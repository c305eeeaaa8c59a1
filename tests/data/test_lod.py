"""Simplifying, splitting into components, and the deviation of placed levels."""

from dataclasses import replace

import numpy as np
import pytest
from builders.shapes import BALL, MESHES, RING, box, joined, scene_of, soup, turned
from viewcell.data import lod
from viewcell.data.errors import InputError
from viewcell.data.lod import object_errors, simplified, split_components, watertight, welded
from viewcell.data.scene import Definition, Mesh
from viewcell.kernels.deviation import launch_deviation
from viewcell.solvers.levels.chain import with_lods


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"vertices": np.full((3, 3), np.nan)}, "definition 0 'shape 0': expected finite"),
        ({"vertices": np.zeros((2, 3))}, "definition 0 'shape 0': expected vertex indices below 2"),
    ],
)
def test_broken_meshes_are_told_in_one_line(change, said):
    broken = replace(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32)), **change)
    for function in (with_lods, split_components):
        with pytest.raises(InputError, match=said):
            function(scene_of(broken))


def test_clustering_keeps_closed_surfaces_closed(monkeypatch):
    monkeypatch.setattr(lod, "AGGRESSIVENESS", ())
    for name in ("ball", "ring", "heap", "soup"):
        (made,) = simplified(welded(MESHES[name], name), 60)
        assert 0 < len(made.faces) <= 60 and watertight(made)


def test_components_become_objects_that_share_definitions():
    pair = joined(box([0, 0, 0], [1, 1, 1]), box([5, 0, 0], [6, 1, 1]))
    moved = np.eye(4)
    moved[:3, 3] = [0, 8, 0]
    scene = scene_of(pair, BALL, transforms=[np.eye(4), moved])
    scene.objects.append(replace(scene.objects[0], name="another", transform=moved))
    made = split_components(scene)
    assert [shape.name for shape in made.definitions] == ["shape 0 #0", "shape 0 #1", "shape 1"]
    names = [placed.name for placed in made.objects]
    assert names == ["thing 0 #0", "thing 0 #1", "thing 1", "another #0", "another #1"]
    assert [placed.definition_id for placed in made.objects] == [0, 1, 2, 0, 1]
    assert all(watertight(welded(shape.lods[0], "")) for shape in made.definitions)
    before, after = (np.unique(x.triangles()[0].reshape(-1, 9), axis=0) for x in (scene, made))
    assert np.array_equal(before, after)


def test_triangles_are_connected_by_position():
    assert len(split_components(scene_of(soup(RING))).definitions) == 1


def test_a_hollow_solid_stays_one_object():
    # Its inner shell alone, or its outer, would be solid all through, and hide what is in the cavity.
    shells = box([0, 0, 0], [4, 4, 4]), box([1, 1, 1], [3, 3, 3], inwards=True)
    apart = box([9, 0, 0], [10, 1, 1])
    torn = replace(shells[1], faces=shells[1].faces[2:])
    for inner in (shells[1], torn):
        made = split_components(scene_of(joined(shells[0], inner, apart)))
        assert [len(shape.lods[0].faces) for shape in made.definitions] == [12 + len(inner.faces), 12]


def test_definitions_with_levels_are_not_split():
    pair = joined(box([0, 0, 0], [1, 1, 1]), box([5, 0, 0], [6, 1, 1]))
    scene = scene_of(pair)
    scene.definitions[0] = Definition("given", (pair, box([0, 0, 0], [6, 1, 1])))
    assert split_components(scene).definitions == scene.definitions


def test_deviations_are_stretched_by_transforms():
    scene, _ = with_lods(scene_of(BALL, BALL, transforms=[turned(3.0), turned(0.5)]))
    errors, starts = object_errors(scene)
    levels = np.array([level.error_m for level in scene.definitions[0].lods])
    assert np.allclose(errors[starts[0] : starts[1]], 3 * levels, rtol=1e-9)
    assert np.allclose(errors[starts[1] : starts[2]], levels, rtol=1e-9)
    for object_id, placed in enumerate(scene.objects):
        shape = [mesh.vertices @ placed.transform[:3, :3].T for mesh in scene.definitions[object_id].lods]
        faces = [mesh.faces for mesh in scene.definitions[object_id].lods]
        found = launch_deviation(shape[0][faces[0]], shape[-1][faces[-1]])
        assert found.lower.max() <= errors[starts[object_id + 1] - 1]
