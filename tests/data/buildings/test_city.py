"""Cities: closed, walkable, partly oblique, as large as asked for."""

import numpy as np
import pytest
import trimesh
from viewcell.data.buildings.city import AXIAL, LOT_M, OBLIQUE, STOREY_M, TILE_M, make_city
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.scene import Role, Scene
from viewcell.data.solids import SolidIndex, closed_elements
from viewcell.workbench.cli import main


@pytest.fixture(scope="module")
def city() -> Scene:
    return make_city(triangles=80_000)


def bodies(scene: Scene) -> list[int]:
    return [i for i, placed in enumerate(scene.objects) if placed.kind == "IfcBuilding"]


@pytest.mark.parametrize(("seed", "triangles"), [(0, 50_000), (1, 63_000), (2, 100_000), (3, 400_000)])
def test_as_many_triangles_as_asked_for(seed, triangles):
    found = len(make_city(seed=seed, triangles=triangles).triangles()[0])
    assert 0.99 * triangles <= found <= triangles


def test_grows_by_instances():
    small, large = (make_city(triangles=n) for n in (100_000, 1_000_000))
    assert len(large.definitions) == len(small.definitions) < 60
    assert len(bodies(large)) > 7 * len(bodies(small))


def test_same_arguments_same_city(city):
    again, other = make_city(triangles=80_000), make_city(triangles=80_000, seed=1)
    np.testing.assert_array_equal(again.triangles()[0], city.triangles()[0])
    assert [x.name for x in again.objects] == [x.name for x in city.objects]
    assert [x.name for x in other.objects] != [x.name for x in city.objects]


def test_every_object_is_closed_and_looks_outwards(city):
    assert len(closed_elements(city)) == len(city.objects)
    for shape in city.definitions:
        mesh = shape.lods[0]
        solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        assert solid.is_watertight, shape.name
        label = trimesh.graph.connected_component_labels(solid.face_adjacency, node_count=len(mesh.faces))
        a, b, c = (mesh.vertices - mesh.vertices.mean(axis=0))[mesh.faces].transpose(1, 0, 2)
        assert np.bincount(label, np.einsum("ij,ij->i", a, np.cross(b, c))).min() > 0, shape.name


@pytest.mark.parametrize("design", [*AXIAL, *OBLIQUE])
def test_bodies_fill_their_outline_up_to_the_roof(city, design):
    for number, tier in enumerate((AXIAL | OBLIQUE)[design].tiers):
        shape = next(shape for shape in city.definitions if shape.name == f"{design} body {number}")
        x, y = np.array(tier.outline, float).T
        area = (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2
        height = tier.storeys * STOREY_M + (AXIAL | OBLIQUE)[design].gable_m / 2
        assert trimesh.Trimesh(*(shape.lods[0].vertices, shape.lods[0].faces)).volume == pytest.approx(area * height)


def test_some_buildings_are_oblique_and_all_stay_apart():
    city = make_city(triangles=300_000)
    ids = bodies(city)
    angles = [np.arctan2(*city.objects[i].transform[[1, 0], 0]) % (np.pi / 2) for i in ids]
    oblique = np.array([0.01 < angle < np.pi / 2 - 0.01 for angle in angles])
    assert 0.1 < oblique.mean() < 0.45
    bounds = city.object_bounds()[ids] * city.grid_m
    middles = np.array([city.objects[i].transform[:2, 3] for i in ids])
    assert (np.abs(bounds[:, :, :2] - middles[:, None]) <= np.array(LOT_M) / 2 + 0.001).all()
    assert len(np.unique(np.round(bounds[:, 1, 2], 1))) >= 8


def test_windows_are_on_the_outside_of_walls(city):
    triangles, owners = city.triangles()
    solids = dict(closed_elements(city, Role.OCCLUDER))
    ids = bodies(city)
    middles = np.array([city.objects[i].transform[:2, 3] for i in ids])
    for object_id in [i for i, placed in enumerate(city.objects) if placed.kind == "IfcWindow"][::7]:
        corners = triangles[owners == object_id].reshape(-1, 3)
        near = np.abs(middles - city.objects[object_id].transform[:2, 3]).max(axis=1) < LOT_M[1] / 2
        own = [i for i, there in zip(ids, near, strict=True) if there]
        centre = corners.mean(axis=0)[None]
        index = SolidIndex(np.array([[centre[0] - 1, centre[0] + 1]]), [(i, solids[i]) for i in own])
        assert index.outside(centre, 0).all()


def test_in_bounds_and_streets_are_free(city):
    bounds = city.object_bounds() * city.grid_m
    tiles = np.array([b for b, placed in zip(bounds, city.objects, strict=True) if placed.name.startswith("ground")])
    low, high = tiles[:, 0].min(axis=0), tiles[:, 1].max(axis=0)
    assert (bounds[:, 0] >= low).all() and (bounds[:, 1, :2] <= high[:2]).all()
    assert (np.ptp(tiles[:, :, :2], axis=1) == TILE_M).all()
    assert len(city.spaces) == 4 * len(tiles)
    rng = np.random.default_rng(0)
    boxes = np.array([[s.vertices.min(axis=0), s.vertices.max(axis=0)] for s in city.spaces]) / city.grid_m
    index = SolidIndex(boxes, closed_elements(city))
    points = rng.uniform(boxes[:, None, 0], boxes[:, None, 1], (len(boxes), 30, 3))
    assert np.mean([index.outside(points[cell], cell) for cell in range(len(boxes))]) > 0.9


def test_roles(city):
    roles = {placed.kind: placed.role for placed in city.objects}
    assert {kind for kind, role in roles.items() if role is Role.OCCLUDER} == {"IfcBuilding", "IfcSlab"}
    assert {"IfcWindow", "IfcPlant", "IfcLightFixture", "IfcTransportElement"} <= roles.keys()


@pytest.mark.parametrize("options", [{"triangles": 49_999}, {"triangles": 50_000_001}, {"seed": -1}])
def test_unusable_arguments(options):
    with pytest.raises(InputError, match=f"{next(iter(options))}: expected .* found"):
        make_city(**options)


def test_make_city_from_the_command_line(tmp_path, capsys):
    out = tmp_path / "a.glb"
    assert main(["make", "city", "--triangles", "50000", "--seed", "2", "--out", str(out)]) == 0
    made = make_city(seed=2, triangles=50_000)
    assert f"{len(made.triangles()[0]):,}" in capsys.readouterr().out.split()
    assert len(read(out).triangles()[0]) == len(made.triangles()[0])
    assert main(["make", "city", "--triangles", "100000000000"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
