"""What moves: the box that stands for it, and the rows that it gets; and whole bakes of it."""

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from builders.four_rooms import hashes
from builders.packed_house import packed_scene
from viewcell.data.animation import Animation
from viewcell.data.errors import InputError
from viewcell.data.rows import Rows
from viewcell.data.scene import Role
from viewcell.data.store.scene_folder import read_scene, write_scene
from viewcell.data.sweep import moving, still, with_moving
from viewcell.data.verdict import Verdict
from viewcell.verify.readers.walk import differences
from viewcell.workbench.bake.run import bake
from viewcell.workbench.pack.run import pack

# To and fro through the wall between the two rooms, turning.
SWING = Animation("-rz $30 * t$ -tx $1.5 * sin(90 * t)$", 12.0)


def moving_scene(animation=SWING, name="ball 0"):
    scene = packed_scene()
    number = next(i for i, placed in enumerate(scene.objects) if placed.name == name)
    scene.objects[number] = replace(
        scene.objects[number], role=Role.TRANSPARENT, animation=animation, colour=(9, 8, 7, 255)
    )
    return scene, number


def placed_at(scene, number, t, lod=0):
    """World corners of a moving object at a time [m]."""
    placed = scene.objects[number]
    vertices = scene.definitions[placed.definition_id].lods[lod].vertices
    return (np.column_stack([vertices, np.ones(len(vertices))]) @ (placed.transform @ placed.animation.matrix(t)).T)[
        :, :3
    ]


def test_boxes_hold_all_levels_at_any_time():
    scene, number = moving_scene()
    assert moving(scene).tolist() == [number]
    stand_in = still(scene)
    low, high = stand_in.object_bounds()[number] * scene.grid_m
    for t in np.random.default_rng(0).uniform(0, 100, 200):
        for lod in range(3):
            corners = np.round(placed_at(scene, number, t, lod) / scene.grid_m) * scene.grid_m
            assert (corners >= low).all() and (corners <= high).all()
    rest = scene.object_bounds()[number] * scene.grid_m
    assert (rest[0] >= low).all() and (rest[1] <= high).all()
    assert [placed.name for placed in stand_in.objects] == [placed.name for placed in scene.objects]
    assert not stand_in.objects[number].opaque and len(moving(stand_in)) == 0


def test_the_box_is_closed_and_looks_outwards():
    scene, number = moving_scene()
    triangles, owners = still(scene).triangles()
    corners = triangles[owners == number].astype(np.int64)
    assert len(corners) == 12
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    volume = np.einsum("nk,nk->n", corners[:, 0] - low, np.cross(corners[:, 1] - low, corners[:, 2] - low)).sum()
    assert volume == 6 * (high - low).prod()


def test_a_scene_without_motion_is_itself():
    scene = packed_scene()
    assert still(scene) is scene


def test_what_moves_is_seen_by_nobody_and_unknown_to_who_is_in_its_box():
    scene, number = moving_scene()
    box = still(scene).object_bounds()[number]
    cells = np.array([box, box + 10_000, [box[1], box[1] + 5], box + 10_000], np.int64)
    rows = Rows.unseen(np.array([0, 1, 1, 3]), np.array([2, number, number - 1, number - 1]))
    rows.show(np.ones(4, bool), np.zeros(3), np.ones(3))
    found = with_moving(rows, still(scene), np.array([number]), cells, np.array([True, True, True, False]))
    told = set(zip(found.source.tolist(), found.target.tolist(), found.verdict.tolist(), strict=True))
    visible, unknown = Verdict.VISIBLE, Verdict.UNKNOWN
    assert told == {
        (0, 2, visible),
        (0, number, unknown),
        (1, number, unknown),
        (1, number - 1, visible),
        (2, number, unknown),
        (3, number - 1, visible),
    }


def test_folders_keep_motion_and_colour(tmp_path):
    scene, number = moving_scene()
    write_scene(scene, tmp_path / "a.scene")
    again = read_scene(tmp_path / "a.scene").objects[number]
    assert again.animation == SWING and again.colour == (9, 8, 7, 255)
    scene, _ = moving_scene(Animation("-rz $t$"))
    write_scene(scene, tmp_path / "a.scene")
    assert read_scene(tmp_path / "a.scene").objects[number].animation.period_s == np.inf
    # What has neither is stored as it was before there were such.
    write_scene(packed_scene(), tmp_path / "b.scene")
    assert {"colour", "animation"}.isdisjoint(read_columns(tmp_path / "b.scene" / "objects.parquet"))


def read_columns(path):
    return pq.read_schema(path).names


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("animation", "nonsense", "animation: expected steps"),
        ("period_s", -1.0, "a period above 0"),
        ("role", "detail", "role transparent of what moves, found detail"),
    ],
)
def test_folders_with_broken_motions_are_refused_in_one_line(column, value, words, tmp_path):
    scene, number = moving_scene()
    write_scene(scene, tmp_path / "a.scene")
    path = tmp_path / "a.scene" / "objects.parquet"
    table = pq.read_table(path)
    values = table[column].to_pylist()
    values[number] = value
    at = table.column_names.index(column)
    pq.write_table(table.set_column(at, column, pa.array(values, table.schema.field(column).type)), path)
    with pytest.raises(InputError, match=words) as error:
        read_scene(tmp_path / "a.scene")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("role", [Role.OCCLUDER, Role.DETAIL])
def test_occluders_do_not_move(role):
    with pytest.raises(InputError, match=f"expected role transparent of what moves, found {role.value}"):
        replace(packed_scene().objects[0], role=role, animation=SWING)


@pytest.mark.parametrize("yaw", ["auto", "0"])
def test_a_bake_keeps_what_moves_wherever_it_comes(yaw, tmp_path):
    """At any time the object, as it then is, may be seen from no view cell that the bake hides it from.

    Unmoved it is hidden from one room; after a second it has gone through the wall.
    """
    scene, number = moving_scene(name="plain")
    rest, _ = moving_scene(name="plain")
    rest.objects[number] = replace(rest.objects[number], animation=None)
    unmoved = bake(rest, tmp_path / "rest.bake", yaw=yaw, threads=1).potential_objects[:, number]
    made = bake(scene, tmp_path / "a.bake", yaw=yaw, lods=True, threads=1)
    assert made.scene.objects[number].animation == SWING
    assert all(row["verdict"] == "unknown" for row in made.cell_to_object.to_pylist() if row["object_id"] == number)
    potential = made.potential_objects[:, number]
    moved = np.zeros_like(unmoved)
    for t in [1.0, *np.random.default_rng(1).uniform(0, 24, 2)]:
        frozen = replace(scene, objects=[*scene.objects])
        placed = frozen.objects[number]
        there = placed.transform @ placed.animation.matrix(t)
        frozen.objects[number] = replace(placed, animation=None, transform=there)
        now = bake(frozen, tmp_path / "now.bake", yaw=yaw, threads=1, overwrite=True)
        assert np.array_equal(now.graph.cells, made.graph.cells)
        rows = [row for row in now.cell_to_object.to_pylist() if row["object_id"] == number]
        seen = [row["cell_id"] for row in rows if row["verdict"] == "visible"]
        assert potential[seen].all()
        moved[seen] = True
    assert (moved & ~unmoved).any()
    assert made.verify(rays=20_000).ok
    for flatten in (False, True):
        walk = pack(made, tmp_path / f"{flatten}.walk", flatten=flatten)
        assert differences(walk.folder, made) == []
        row = walk.objects["object_id"].to_pylist().index(number)
        told = walk.objects.slice(row, 1).to_pylist()[0]
        assert (told["animation"], told["period_s"], told["colour"]) == (SWING.text, 12.0, 0x090807FF)
        assert np.array_equal(np.reshape(told["transform"], (4, 4)), made.scene.objects[number].transform)
        box = still(made.scene).object_bounds()[number] * made.grid_m
        assert [told[f"{end}_{axis}"] for end in ("min", "max") for axis in "xyz"] == box.ravel().tolist()


def test_what_moves_hides_nothing(tmp_path):
    """A wall that could close the door hides nothing if it moves."""
    scene, number = moving_scene(Animation("-sa $4 + sin(t)$"))
    other = packed_scene()
    made = [bake(one, tmp_path / f"{k}.bake", threads=1) for k, one in enumerate((scene, other))]
    kept = [one.potential_objects[one.graph.inhabitable] for one in made]
    others = np.arange(len(scene.objects)) != number
    assert (kept[0] >= kept[1])[:, others].all()


def test_a_bake_of_a_changed_motion_is_another(tmp_path):
    bake(moving_scene()[0], tmp_path / "a.bake", threads=1)
    before = hashes(tmp_path / "a.bake")
    with pytest.raises(InputError, match="of another model"):
        bake(moving_scene(Animation("-rz $t$"))[0], tmp_path / "a.bake", threads=1)
    assert hashes(tmp_path / "a.bake") == before


def test_what_cannot_be_baked(tmp_path):
    with pytest.raises(InputError, match=r"object \d+ 'ball 0': expected a motion that stays within bounds"):
        bake(moving_scene(Animation("-tx $t$"))[0], tmp_path / "a.bake", threads=1)
    with pytest.raises(InputError, match="certify: expected a model in which nothing moves"):
        bake(moving_scene()[0], tmp_path / "a.bake", certify=True, threads=1)
    assert not list(tmp_path.iterdir())
