"""The model as glTF, read back by a reader of its own."""

import numpy as np
import pytest
from builders import gltf_reader
from builders.exported_house import STOOLS
from viewcell.data.scene import Definition, Instance, Mesh, Role, Scene
from viewcell.workbench.export.glb import model_as_glb, objects_as_glb


@pytest.fixture(scope="module")
def exported(house):
    return model_as_glb(house)


def by_corners(triangles):
    """An order of triangles that does not depend on which was written first."""
    return np.lexsort(np.round(triangles.reshape(-1, 9) * 1000).T)


def test_every_object_is_a_node_where_it_stands_in_the_model(house, exported):
    found = {node["extras"]["id"]: (node, triangles) for node, triangles, _ in gltf_reader.drawn(exported)}
    assert sorted(found) == list(range(len(house.scene.objects)))
    for number, placed in enumerate(house.scene.objects):
        node, triangles = found[number]
        assert node["name"] == placed.name and node["extras"]["kind"] == placed.kind
        assert node["extras"].get("guid", "") == placed.guid
        assert node["extras"]["role"] == placed.role.value
        assert node["extras"].get("storey") == (placed.storey and placed.storey.name)
        mesh = house.scene.definitions[placed.definition_id].lods[0]
        # The bake's frame, then the model's, each by hand.
        x, y, z = placed.transform[:3, :3] @ mesh.vertices.T + placed.transform[:3, 3:]
        turn = (x + 1j * y) * np.exp(1j * np.radians(house.yaw_deg))
        wanted = (np.stack([turn.real, turn.imag, z], axis=1) + house.origin)[mesh.faces]
        assert triangles.shape == wanted.shape
        order, other = by_corners(triangles), by_corners(wanted)
        assert np.abs(triangles[order] - wanted[other]).max(initial=0) < 1e-5


def test_faces_keep_their_colours_and_others_get_those_of_their_role(house, exported):
    found = {node["name"]: colours for node, _, colours in gltf_reader.drawn(exported)}
    for name in STOOLS:
        assert sorted(map(tuple, np.round(found[name] * 255).astype(int).tolist())) == (
            [(20, 160, 90, 128)] * 6 + [(200, 30, 10, 255)] * 6
        )
    assert found["case"][0, 3] == 1 and found["glass"][0, 3] < 1
    document, _ = gltf_reader.split(exported)
    blended = {
        material["pbrMetallicRoughness"]["baseColorFactor"][3] < 1: material.get("alphaMode")
        for material in document["materials"]
    }
    assert blended == {True: "BLEND", False: None}


def test_a_shape_is_written_once(house, exported):
    document, _ = gltf_reader.split(exported)
    nodes = {node["name"]: node for node in document["nodes"]}
    assert nodes["plain"]["mesh"] == nodes["twin"]["mesh"] == nodes["mirrored"]["mesh"] != nodes["sheared"]["mesh"]
    assert "mesh" not in nodes["nothing"]
    vertices = [accessor for accessor in document["accessors"] if accessor["type"] == "VEC3"]
    shapes = {placed.definition_id for placed in house.scene.objects}
    # All but the empty one, and the sheared stool's own.
    assert len(vertices) == len(shapes) - 1 + 1

    def points(name):
        return document["meshes"][nodes[name]["mesh"]]["primitives"][0]["attributes"]["POSITION"]

    assert nodes["case"]["mesh"] != nodes["glass"]["mesh"] and points("case") == points("glass")


@pytest.mark.parametrize(("count", "kind"), [(2**16 - 1, 5123), (2**16, 5125)])
def test_indices_are_as_short_as_may_be(count, kind):
    """65,535 as a short index would end a strip."""
    points = np.arange(3 * count, dtype=float).reshape(-1, 3)
    mesh = Mesh(points, np.array([[0, 1, count - 1]], np.int32))
    scene = Scene([Definition("many", (mesh,))], [Instance("many", "Thing", 0, np.eye(4), Role.DETAIL)])
    data = objects_as_glb(scene, [0], np.eye(4))
    document, _ = gltf_reader.split(data)
    assert [a["componentType"] for a in document["accessors"] if a["type"] == "SCALAR"] == [kind]
    assert gltf_reader.drawn(data)[0][1].tolist() == [points[[0, 1, count - 1]].tolist()]


def test_an_object_has_its_own_colour_where_its_faces_have_none():
    """Two instances of a bare shape, one of them red; and a coloured shape, which keeps its colours."""
    faces = np.array([[0, 1, 2]], np.int32)
    green = np.array([[20, 160, 90, 255]], np.uint8)
    shapes = [Definition("bare", (Mesh(np.eye(3), faces),)), Definition("green", (Mesh(np.eye(3), faces, 0.0, green),))]
    red = (200, 30, 10, 255)
    placed = [Instance(f"{i} {c}", "Thing", i, np.eye(4), Role.DETAIL, colour=c) for i in (0, 1) for c in (None, red)]
    data = objects_as_glb(Scene(shapes, placed), range(4), np.eye(4))
    shown = [np.round(255 * colours[0]).astype(int).tolist() for _, _, colours in gltf_reader.drawn(data)]
    assert shown[1] == list(red) != shown[0] and shown[2] == shown[3] == green[0].tolist()
