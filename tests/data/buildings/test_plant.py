"""Plants: closed, walkable, as large as asked for; and the parts that they are made of."""

import json
from collections import Counter

import numpy as np
import pytest
import trimesh
from viewcell.data.buildings.machinery import PARTS, straight_pipe
from viewcell.data.buildings.plant import BAY_M, HEIGHT_M, make_plant
from viewcell.data.buildings.shapes import bent, extruded, laid, pipe, revolved
from viewcell.data.errors import InputError
from viewcell.data.occludees import find_occludees
from viewcell.data.scene import Definition, Instance, Mesh, Role, Scene
from viewcell.data.solids import SolidIndex, closed_elements
from viewcell.data.store.scene_folder import read_scene
from viewcell.workbench.cli import main


@pytest.fixture(scope="module")
def plant() -> Scene:
    return make_plant(triangles=60_000)


def assert_closed_and_outward(vertices: np.ndarray, faces: np.ndarray) -> None:
    """Each connected part has every edge once in each direction, and a positive volume."""
    solid = trimesh.Trimesh(vertices, faces, process=False)
    assert solid.is_watertight and solid.is_winding_consistent
    label = trimesh.graph.connected_component_labels(solid.face_adjacency, node_count=len(faces))
    a, b, c = (solid.vertices - solid.centroid)[faces].transpose(1, 0, 2)
    assert np.bincount(label, np.einsum("ij,ij->i", a, np.cross(b, c))).min() > 0


def free_share(scene: Scene, seed: int) -> float:
    """Share of points in the spaces that lie outside all closed objects."""
    rng = np.random.default_rng(seed)
    boxes = np.array([[s.vertices.min(axis=0), s.vertices.max(axis=0)] for s in scene.spaces]) / scene.grid_m
    index = SolidIndex(boxes, closed_elements(scene))
    points = rng.uniform(boxes[:, None, 0], boxes[:, None, 1], (len(boxes), 60, 3))
    return float(np.mean([index.outside(points[cell], cell) for cell in range(len(boxes))]))


@pytest.mark.parametrize(("seed", "triangles"), [(0, 50_000), (1, 63_000), (2, 100_000), (3, 400_000)])
def test_as_many_triangles_as_asked_for(seed, triangles):
    found = len(make_plant(seed=seed, triangles=triangles).triangles()[0])
    assert 0.99 * triangles <= found <= triangles


def test_grows_by_instances_at_the_same_density():
    small, large = (make_plant(triangles=n) for n in (100_000, 1_000_000))
    assert len(large.definitions) == len(small.definitions) < 50
    bays = [sum(placed.name.startswith("floor") for placed in scene.objects) for scene in (small, large)]
    assert bays[1] / bays[0] == pytest.approx(10, rel=0.35)
    assert len({tuple(placed.transform[:2, 3]) for placed in large.objects if "floor" in placed.name}) == bays[1]


def test_same_arguments_same_plant(plant):
    again, other = make_plant(triangles=60_000), make_plant(triangles=60_000, seed=1)
    np.testing.assert_array_equal(again.triangles()[0], plant.triangles()[0])
    assert [x.name for x in again.objects] == [x.name for x in plant.objects]
    assert [x.name for x in other.objects] != [x.name for x in plant.objects]


def test_triangles_are_those_of_the_objects_one_by_one(plant):
    # Two equal corners and three in a line make triangles without area; both kinds of instances are mixed.
    flat = Mesh(
        np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0.5]]), np.array([[0, 1, 2], [0, 1, 3], [1, 1, 3]], np.int32)
    )
    where = [np.eye(4), np.eye(4) + 0.1 * np.eye(4, k=3), np.diag([-1.0, 1, 1, 1])]
    objects = [Instance("flat", "", len(plant.definitions), transform, Role.DETAIL) for transform in where]
    mixed = Scene(
        [*plant.definitions, Definition("flat", (flat,))], [*plant.objects[:40], *objects, *plant.objects[40:]]
    )
    triangles, owners = mixed.triangles()
    place = 0
    for object_id, placed in enumerate(mixed.objects):
        corners = mixed.world_vertices(object_id)[mixed.definitions[placed.definition_id].lods[0].faces]
        a, b, c = corners.astype(object).transpose(1, 0, 2)
        corners = corners[[(np.cross(v - u, w - u) != 0).any() for u, v, w in zip(a, b, c, strict=True)]]
        np.testing.assert_array_equal(triangles[place : place + len(corners)], corners)
        assert (owners[place : place + len(corners)] == object_id).all()
        place += len(corners)
    assert place == len(triangles) == len(plant.triangles()[0]) + 3
    assert triangles.dtype == owners.dtype == np.int32
    assert 0 < mixed.max_snap_m() <= mixed.grid_m / 2


def test_the_first_object_out_of_bounds_is_named(plant):
    away = [Instance(name, "", 3 - k, np.eye(4) * 1e6, Role.DETAIL) for k, name in enumerate(("first", "second"))]
    with pytest.raises(InputError, match=r"object 5 'first': expected coordinates within"):
        Scene(plant.definitions, [*plant.objects[:5], *away]).triangles()


def test_instances_have_the_pieces_that_each_has_alone(plant):
    together = find_occludees(plant)
    for object_id in range(0, len(plant.objects), 9):
        alone = find_occludees(Scene(plant.definitions, [plant.objects[object_id]]))
        own = slice(together.starts[object_id], together.starts[object_id + 1])
        np.testing.assert_array_equal(together.pieces[own], alone.pieces)


def test_every_object_is_closed_and_looks_outwards(plant):
    assert len(closed_elements(plant)) == len(plant.objects)
    for shape in plant.definitions:
        assert_closed_and_outward(shape.lods[0].vertices, shape.lods[0].faces)


def test_lies_in_its_bays_with_a_wall_around(plant):
    bounds = plant.object_bounds() * plant.grid_m
    floors = np.array([b for b, placed in zip(bounds, plant.objects, strict=True) if placed.name.startswith("floor")])
    low, high = floors[:, 0].min(axis=0), floors[:, 1].max(axis=0)
    assert (bounds[:, 0] >= low - [0.31, 0.31, 0]).all()
    assert (bounds[:, 1] <= [high[0] + 0.31, high[1] + 0.31, HEIGHT_M + 0.6]).all()
    corners = {tuple(np.round(floor[0, :2] / BAY_M).astype(int)) for floor in floors}
    outside = sum((i + a, j + b) not in corners for i, j in corners for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1)))
    walls = Counter(placed.name.rsplit(" ", 1)[0] for placed in plant.objects if placed.kind == "IfcWall")
    assert walls["wall"] + walls["gate wall"] == outside


def test_roles_and_kinds(plant):
    roles = {placed.name.rsplit(" ", 1)[0]: placed.role for placed in plant.objects}
    for name in ("floor", "roof", "column", "wall", "wall x", "duct"):
        assert roles[name] is Role.OCCLUDER, name
    for name in ("grating", "rail", "rail short", "rack frame", "drum"):
        assert roles[name] is Role.DETAIL, name
    assert {"IfcWall", "IfcSlab", "IfcColumn", "IfcRailing", "IfcPipeSegment"} <= {x.kind for x in plant.objects}


def test_aisles_and_walkways_are_free(plant):
    assert len(plant.spaces) == 6 * sum(placed.name.startswith("floor") for placed in plant.objects)
    assert free_share(plant, 0) > 0.999
    heights = sorted({float(space.vertices[:, 2].min()) for space in plant.spaces})
    assert heights == [0.0, 5.0, 9.0]


@pytest.mark.parametrize("name", PARTS)
def test_parts_have_a_size_that_fits_a_bay(name):
    vertices = np.concatenate([mesh.vertices for mesh in PARTS[name]()])
    assert (np.ptp(vertices, axis=0) < [BAY_M, BAY_M, 9.5]).all()
    assert vertices[:, 2].min() >= -1.6


def test_a_bent_pipe_is_closed_and_as_thick_as_asked_for():
    path = bent([(0, 0, 0), (0, 0, 2), (3, 0, 2), (3, 1, 2)], 0.5, 8)
    mesh = pipe(path, 0.1, 24)
    assert_closed_and_outward(mesh.vertices, mesh.faces)
    assert len(mesh.faces) == 2 * 24 * len(path)
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume == pytest.approx(length * np.pi * 0.01, rel=0.02)
    ends = mesh.vertices[[-2, -1]]
    np.testing.assert_allclose(ends, [(0, 0, 0), (3, 1, 2)])


def test_solids_of_revolution_and_prisms_by_volume():
    cone = revolved([(0, 0), (1, 0), (0.5, 3), (0, 3)], 64)
    assert_closed_and_outward(cone.vertices, cone.faces)
    assert trimesh.Trimesh(cone.vertices, cone.faces).volume == pytest.approx(np.pi * (1 + 0.5 + 0.25), rel=0.01)
    prism = extruded([(0, 0), (2, 0), (0, 1)], -1, 3)
    for axis in (0, 1):
        mesh = laid(prism, axis)
        assert_closed_and_outward(mesh.vertices, mesh.faces)
        assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume == pytest.approx(4)
        assert np.ptp(mesh.vertices[:, axis]) == 4


def test_a_valve_adds_to_a_pipe():
    plain, valved = (sum(len(m.faces) for m in straight_pipe(12.0, 0.1, valved=v)) for v in (False, True))
    assert valved > plain


@pytest.mark.parametrize("options", [{"triangles": 49_999}, {"triangles": 50_000_001}, {"seed": -1}])
def test_unusable_arguments(options):
    with pytest.raises(InputError, match=f"{next(iter(options))}: expected .* found"):
        make_plant(**options)


def test_make_plant_from_the_command_line(tmp_path, capsys):
    out = tmp_path / "a.scene"
    assert main(["make", "plant", "--triangles", "50000", "--seed", "3", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    scene = read_scene(out)
    np.testing.assert_array_equal(scene.triangles()[0], make_plant(seed=3, triangles=50_000).triangles()[0])
    for count in (len(scene.triangles()[0]), len(scene.objects), len(scene.definitions), len(scene.spaces)):
        assert f"{count:,}" in printed.split()
    assert json.loads((out / "manifest.json").read_text())["counts"]["triangles"] == len(scene.triangles()[0])
    for wrong in (["--triangles", "1000000000000"], ["--triangles", "10"], ["--triangles", "x"], ["--out", "a.obj"]):
        assert main(["make", "plant", *wrong]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
