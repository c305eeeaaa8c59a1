import numpy as np
import pytest
from builders.closed import assert_closed, assert_rooms_are_clear, assert_sealed
from viewcell.data import prepared
from viewcell.data.buildings.arcade import arch, make_arcade, octagon
from viewcell.data.errors import InputError
from viewcell.data.scene import Role
from viewcell.workbench.bake.run import bake
from viewcell.workbench.verify import verify_bake


@pytest.fixture(scope="module")
def arcade():
    return make_arcade()


def normals(scene, number):
    """Unit normals of an object's triangles, shape (n, 3)."""
    triangles, owners = scene.triangles()
    a, b, c = triangles[owners == number].astype(float).transpose(1, 0, 2)
    found = np.cross(b - a, c - a)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def test_eight_arches_of_24_faces_and_an_octagon_are_all_that_is_oblique(arcade):
    oblique = {}
    for number, placed in enumerate(arcade.objects):
        if placed.role is Role.OCCLUDER:
            off = np.sort(np.abs(normals(arcade, number)), axis=1)[:, 1] > 1e-9
            oblique[placed.name] = int(off.sum())
    assert {name for name, count in oblique.items() if count} == {
        *(f"arched wall {number}" for number in range(1, 9)), "octagonal passage",
    }  # fmt: skip
    # As in the paper: 192 faces that are off the axes, of eight windows.
    assert sum(count for name, count in oblique.items() if name.startswith("arched")) == 192
    assert oblique["octagonal passage"] == 8


def test_walls_are_closed_and_rooms_are_clear_and_sealed():
    scene = make_arcade(furnished=False)
    for shape in scene.definitions:
        assert_closed(shape.lods[0])
    assert_rooms_are_clear(scene, scene.spaces)
    assert_sealed(scene, [space for space in scene.spaces if space.name != "court"])


def test_an_arch_is_round_and_an_octagon_regular():
    ring = arch(2.0, 0.5, 1.5, 12)
    assert ring.shape == (15, 2) and ring[:, 1].max() == 2.5 and ring[:2, 1].tolist() == [0.5, 0.5]
    np.testing.assert_allclose(np.linalg.norm(ring[2:] - [0, 1.5], axis=1), 1.0)
    ring = octagon(2.0)
    np.testing.assert_allclose(np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1), 2 * (np.sqrt(2) - 1))
    assert ring[:, 1].min() == 0.0 and ring[:, 1].max() == 2.0


def test_the_passage_is_an_octagon_on_the_floor(arcade):
    number = next(i for i, placed in enumerate(arcade.objects) if placed.name == "octagonal passage")
    off = np.abs(normals(arcade, number))
    off = off[np.sort(off, axis=1)[:, 1] > 1e-9]
    np.testing.assert_allclose(off[:, 1:], np.sqrt(0.5), atol=1e-3)
    low, high = arcade.openings[np.abs(arcade.openings[:, 1, 2] - 2.25).argmin()]
    assert low[2] == 0.0 and high[1] - low[1] == pytest.approx(2.25)


@pytest.mark.slow
def test_plants_of_the_court_are_seen_through_the_arches(arcade, tmp_path):
    made = bake(arcade, tmp_path / "arcade", threads=1)
    assert made.manifest["yaw_deg"] == 0.0
    table = made.cell_to_object
    columns = (table[name].to_pylist() for name in ("cell_id", "object_id", "verdict"))
    names = made.graph.cell_names
    seen = {
        (names[cell], arcade.objects[k].name) for cell, k, verdict in zip(*columns, strict=True) if verdict == "visible"
    }
    assert {("corridor", f"plant {number} of the court") for number in range(1, 9)} <= seen
    # Through a door, the corridor and an arch, and through the octagon.
    assert any(room.endswith("office") and "of the court" in name for room, name in seen)
    assert ("hall", "west wall") in seen


def test_what_is_carved_hides_nothing_and_keeps_no_more(tmp_path, monkeypatch):
    """Half the portals, the same cells and the same sets, and no ray sees what they leave out."""
    scene = make_arcade(windows=2)
    carved = bake(scene, tmp_path / "carved", threads=1)
    monkeypatch.setattr(prepared, "CARVED_M2", 0.0)
    whole = bake(scene, tmp_path / "whole", threads=1)
    assert carved.manifest["axial_area_carved_m2"] > 0.4 and whole.manifest["axial_area_carved_m2"] == 0.0
    assert carved.graph.portal_count < 0.6 * whole.graph.portal_count
    np.testing.assert_array_equal(carved.graph.cells, whole.graph.cells)
    np.testing.assert_array_equal(carved.potential_objects, whole.potential_objects)
    found = verify_bake(carved, rays=200_000)
    assert found.ok


@pytest.mark.parametrize("segments", range(2, 66, 2))
def test_any_arch_leaves_a_closed_wall(segments):
    for shape in make_arcade(windows=1, segments=segments, furnished=False).definitions:
        assert_closed(shape.lods[0])


@pytest.mark.parametrize(("windows", "segments"), [(1, 2), (3, 64)])
def test_other_sizes(windows, segments):
    scene = make_arcade(windows=windows, segments=segments, furnished=False)
    assert sum(placed.name.startswith("arched wall") for placed in scene.objects) == windows
    assert len(scene.spaces) == (windows + 1) // 2 + 3


@pytest.mark.parametrize(
    "options", [{"windows": 0}, {"windows": 101}, {"segments": 1}, {"segments": 7}, {"segments": 66}, {"seed": -1}]
)
def test_unusable_arguments(options):
    with pytest.raises(InputError, match=f"{next(iter(options))}: expected .* found"):
        make_arcade(**options)
