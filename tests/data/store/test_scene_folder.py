import json
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from viewcell.data.errors import InputError
from viewcell.data.scene import Definition, Instance, Mesh, NamedStorey, Role, Scene, Space
from viewcell.data.store.scene_folder import read_scene, write_scene
from viewcell.data.store.scene_tables import meshes_table, objects_table, scene_from_tables


def random_scene(seed: int = 0) -> Scene:
    """Turned and moved instances far from round numbers, so that a lost digit changes the snapped model."""
    rng = np.random.default_rng(seed)
    definitions = []
    for i in range(3):
        lods = []
        for lod in range(1 + i):
            vertices = rng.uniform(-4, 4, (12, 3)).astype(np.float32).astype(np.float64)
            lods.append(Mesh(vertices, rng.integers(0, 12, (9, 3)).astype(np.int32), error_m=0.1 * lod))
        definitions.append(Definition(f"shape {i}", tuple(lods)))
    objects = []
    for i in range(20):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        transform = np.eye(4)
        transform[:3, :3], transform[:3, 3] = turn, rng.uniform(-200, 200, 3)
        role = list(Role)[i % 3]
        storey = (None, NamedStorey("ground"), NamedStorey("upper", 1 / 3))[i % 3]
        told = {"storey": storey, "materials": ("brick", "it's «plaster»")[: i % 4]}
        objects.append(Instance(f"object «{i}»", "IfcWall", i % 3, transform, role, **told))
    box = np.array([[0, 0, 0], [1 / 3, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32)
    return Scene(
        definitions,
        objects,
        spaces=[
            Space("room 1", box, faces, "Stube", "0Lt8gR", NamedStorey("upper", -2.7)),
            Space("room 2", box + 1, faces),
        ],
        openings=np.array([[[0, 0, 0], [0.1, 1, 2]]]),
        origin=np.array([5.0e5, 40_000_001.0, 12.0]),  # the second is more than float32 can tell
        source="a test",
        sha256="00",
        skipped=[{"what": "wall 7", "why": "empty"}],
    )


def assert_same(a: Scene, b: Scene) -> None:
    for got, expected in zip(a.triangles(), b.triangles(), strict=True):
        np.testing.assert_array_equal(got, expected)
    assert [replace(x, transform=None) for x in a.objects] == [replace(x, transform=None) for x in b.objects]
    for x, y in zip(a.objects, b.objects, strict=True):
        np.testing.assert_array_equal(x.transform, y.transform)
    for x, y in zip(a.definitions, b.definitions, strict=True):
        assert (x.name, len(x.lods)) == (y.name, len(y.lods))
        for p, q in zip(x.lods, y.lods, strict=True):
            np.testing.assert_array_equal(p.vertices, q.vertices)
            np.testing.assert_array_equal(p.faces, q.faces)
            assert p.error_m == q.error_m
    for x, y in zip(a.spaces, b.spaces, strict=True):
        np.testing.assert_array_equal(x.vertices, y.vertices)
        np.testing.assert_array_equal(x.faces, y.faces)
        assert (x.name, x.long_name, x.guid, x.storey) == (y.name, y.long_name, y.guid, y.storey)
    np.testing.assert_array_equal(a.openings, b.openings)
    np.testing.assert_array_equal(a.origin, b.origin)
    assert (a.grid_m, a.source, a.sha256, a.unit, a.skipped) == (b.grid_m, b.source, b.sha256, b.unit, b.skipped)


def test_round_trip_changes_nothing(tmp_path):
    scene = random_scene()
    write_scene(scene, tmp_path / "a.scene")
    assert_same(read_scene(tmp_path / "a.scene"), scene)
    assert [path.name for path in tmp_path.iterdir()] == ["a.scene"]


def test_older_folders_say_nothing_of_storeys_and_materials(tmp_path):
    write_scene(random_scene(), tmp_path / "a")
    (tmp_path / "a" / "rooms.parquet").unlink()
    objects = pq.read_table(tmp_path / "a" / "objects.parquet")
    pq.write_table(objects.drop_columns(["storey", "elevation_m", "materials"]), tmp_path / "a" / "objects.parquet")
    found, wanted = read_scene(tmp_path / "a"), random_scene()
    wanted.objects = [replace(placed, storey=None, materials=()) for placed in wanted.objects]
    wanted.spaces = [Space(space.name, space.vertices, space.faces) for space in wanted.spaces]
    assert_same(found, wanted)


def test_tables_alone_give_the_scene_back():
    scene = random_scene(1)
    manifest = {"origin": scene.origin.tolist(), "grid_m": scene.grid_m}
    again = scene_from_tables(manifest, meshes_table(scene), objects_table(scene))
    np.testing.assert_array_equal(again.triangles()[0], scene.triangles()[0])


def test_object_boxes_are_those_of_the_snapped_model():
    scene = random_scene(2)
    table = objects_table(scene).to_pydict()
    triangles, owners = scene.triangles()
    for object_id in range(len(scene.objects)):
        corners = triangles[owners == object_id].reshape(-1, 3) * scene.grid_m
        assert [table[f"min_{x}"][object_id] for x in "xyz"] == corners.min(axis=0).tolist()
        assert [table[f"max_{x}"][object_id] for x in "xyz"] == corners.max(axis=0).tolist()


def test_object_without_triangles_has_no_box(tmp_path):
    flat = Definition("flat", (Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32)),))
    scene = Scene([flat], [Instance("flat", "Mesh", 0, np.eye(4), Role.DETAIL)])
    assert objects_table(scene)["min_x"].to_pylist() == [None]


def test_scene_without_anything_survives(tmp_path):
    write_scene(Scene([], []), tmp_path / "empty")
    assert_same(read_scene(tmp_path / "empty"), Scene([], []))


def test_a_scene_is_replaced_but_nothing_else_is(tmp_path):
    write_scene(random_scene(0), tmp_path / "a")
    write_scene(random_scene(1), tmp_path / "a")
    assert_same(read_scene(tmp_path / "a"), random_scene(1))
    (tmp_path / "holiday").mkdir()
    (tmp_path / "holiday" / "photo.jpg").touch()
    with pytest.raises(InputError, match="something else there"):
        write_scene(random_scene(), tmp_path / "holiday")
    assert (tmp_path / "holiday" / "photo.jpg").exists()


def test_failed_write_leaves_the_old_scene(tmp_path, monkeypatch):
    write_scene(random_scene(0), tmp_path / "a")

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pq, "write_table", full)
    with pytest.raises(InputError, match="No space left"):
        write_scene(random_scene(1), tmp_path / "a")
    assert_same(read_scene(tmp_path / "a"), random_scene(0))
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_vertices_that_float32_would_move_are_refused(tmp_path):
    scene = random_scene()
    scene.definitions[0].lods[0].vertices[3, 1] = 0.1
    with pytest.raises(InputError, match="exact in float32"):
        write_scene(scene, tmp_path / "a")
    assert list(tmp_path.iterdir()) == []


def change_manifest(folder, **changes):
    manifest = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps(manifest | changes))


def change_table(path, **columns):
    table = pq.read_table(path)
    for name, values in columns.items():
        at = table.column_names.index(name)
        table = table.set_column(at, name, pa.array(values, table.schema.field(name).type))
    pq.write_table(table, path)


BREAKS = {
    "expected a scene folder's manifest": lambda f: (f / "manifest.json").unlink(),
    "expected JSON": lambda f: (f / "manifest.json").write_text("{"),
    "expected a JSON object": lambda f: (f / "manifest.json").write_text("[]"),
    "expected format 1, found 2": lambda f: change_manifest(f, format=2),
    "expected kind 'scene', found 'bake'": lambda f: change_manifest(f, kind="bake"),
    "expected complete True, found False": lambda f: change_manifest(f, complete=False),
    "expected 21 objects, found 20": lambda f: change_manifest(f, counts={"objects": 21}),
    "expected grid_m above 0": lambda f: change_manifest(f, grid_m=0),
    "expected origin to be 3": lambda f: change_manifest(f, origin=[0, 0]),
    "expected a readable scene": lambda f: change_manifest(f, origin="here"),
    "expected a Parquet table": lambda f: (f / "meshes.parquet").write_bytes(b"PAR1"),
    "objects.parquet: expected": lambda f: (f / "objects.parquet").unlink(),
    "expected the column 'min_x'": lambda f: pq.write_table(pa.table({"a": [1]}), f / "openings.parquet"),
    "expected a definition_id below 3, found 9": lambda f: change_table(
        f / "objects.parquet", definition_id=[9] + [0] * 19
    ),
    "expected object_id 0, found 5": lambda f: change_table(f / "objects.parquet", object_id=[5] * 20),
    "expected role": lambda f: change_table(f / "objects.parquet", role=["wall"] * 20),
    "expected a transform of 16": lambda f: change_table(f / "objects.parquet", transform=[[0.0] * 12] * 20),
    "expected rows in order": lambda f: change_table(f / "meshes.parquet", lod=[1] * 6),
    "expected vertex indices below 12": lambda f: change_table(f / "meshes.parquet", faces=[[0, 1, 99]] * 6),
    "expected a row for each of 2 rooms": lambda f: change_table(f / "rooms.parquet", room_id=[0, 0]),
    "multiple of 3": lambda f: change_table(f / "meshes.parquet", faces=[[0, 1]] * 6),
}


@pytest.mark.parametrize("message", BREAKS)
def test_broken_folder_is_one_clear_line(tmp_path, message):
    folder = tmp_path / "a"
    write_scene(random_scene(), folder)
    BREAKS[message](folder)
    with pytest.raises(InputError, match=message) as error:
        read_scene(folder)
    assert "\n" not in str(error.value)
