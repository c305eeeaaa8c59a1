"""glTF by our own reader: containers, accessors, nodes, materials."""

import json

import numpy as np
import pytest
from builders.model_files import HOUSE, add_accessor, add_view, box_corners, glb, gltf, gltf_parts
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.scene import Role

ONE = {"wall": ((0, 0, 0), (4, 1, 3))}
TWO = ONE | {"post": ((6, 0, 0), (7, 1, 3))}


def written(path, out, data, binary=True):
    path.write_bytes((glb if binary else gltf)(out, data))
    return path


def refused(path) -> str:
    with pytest.raises(InputError) as error:
        read(path)
    assert "\n" not in str(error.value) and "expected" in str(error.value) and "found" in str(error.value)
    return str(error.value)


def box_of(scene, name: str) -> list:
    place = [placed.name for placed in scene.objects].index(name)
    return (scene.object_bounds()[place] * scene.grid_m + scene.origin).round(4).tolist()


@pytest.mark.parametrize("cut", [2, 15, 40, 900, -4])
def test_files_that_end_early_are_one_line(tmp_path, cut):
    content = glb(*gltf_parts())
    (tmp_path / "a.glb").write_bytes(content[:cut])
    refused(tmp_path / "a.glb")


def test_bytes_after_the_end_are_noted(tmp_path):
    (tmp_path / "a.glb").write_bytes(glb(*gltf_parts()) + b"more")
    assert [note["what"] for note in read(tmp_path / "a.glb").notes] == ["4 bytes"]


def test_buffers_beside_it(tmp_path):
    out, data = gltf_parts()
    for uri, name in {"a%20b.bin": "a b.bin", "sub/c.BIN": "sub/C.bin", "sub\\d.bin": "sub/d.bin"}.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(bytes(data))
        text = json.dumps(out | {"buffers": [{"byteLength": len(data), "uri": uri}]})
        (tmp_path / "a.gltf").write_text(text, encoding="utf-8-sig")
        assert len(read(tmp_path / "a.gltf").objects) == 12
        (tmp_path / name).write_bytes(bytes(data)[:-8])
        assert f"expected {len(data):,} bytes in buffer 0" in refused(tmp_path / "a.gltf")
        (tmp_path / name).unlink()
        assert "nothing there" in refused(tmp_path / "a.gltf")


def test_versions_and_extensions(tmp_path):
    out, data = gltf_parts(ONE)
    for version in ("1.0", "3.0", None):
        assert "version" in refused(written(tmp_path / "a.glb", out | {"asset": {"version": version}}, data))
    needed = {"extensionsRequired": ["KHR_materials_unlit", "KHR_texture_transform", "KHR_mesh_quantization"]}
    assert len(read(written(tmp_path / "a.glb", out | needed, data)).objects) == 1
    assert "CESIUM_RTC" in refused(written(tmp_path / "a.glb", out | {"extensionsRequired": ["CESIUM_RTC"]}, data))


BROKEN = {
    "count": lambda out: out["accessors"][0].update(count=10**9),
    "negative count": lambda out: out["accessors"][0].update(count=-1),
    "no view": lambda out: out["accessors"][0].update(bufferView=-1),
    "long view": lambda out: out["bufferViews"][0].update(byteLength=10**9),
    "stride": lambda out: out["bufferViews"][0].update(byteStride=4),
    "type": lambda out: out["accessors"][0].update(type="MAT4"),
    "component": lambda out: out["accessors"][0].update(componentType=5124),
    "index": lambda out: out["accessors"][1].update(bufferView=0),
    "float indices": lambda out: out["meshes"][0]["primitives"][0].update(indices=0),
    "mode": lambda out: out["meshes"][0]["primitives"][0].update(mode=7),
    "no mesh": lambda out: out["nodes"][0].update(mesh=5),
    "no scene": lambda out: out.update(scene=3),
    "cycle": lambda out: out["nodes"][0].update(children=[0]),
    "matrix": lambda out: out["nodes"][0].update(matrix=[1, 0, 0]),
    "no material": lambda out: out["meshes"][0]["primitives"][0].update(material=3),
    "not a list": lambda out: out.update(nodes=3),
    "no nodes": lambda out: out.update(nodes=[], scenes=[]),
}


@pytest.mark.parametrize("case", BROKEN)
def test_contradictions_are_one_line(tmp_path, case):
    out, data = gltf_parts(ONE)
    BROKEN[case](out)
    refused(written(tmp_path / "a.glb", out, data))


def test_counts_are_held_against_the_size_of_the_file(tmp_path):
    """Zeros take no room in it, and a length in the header none either."""
    out, data = gltf_parts(TWO)
    del out["accessors"][0]["bufferView"]
    out["accessors"][0]["count"] = 10**7
    assert "bytes may hold" in refused(written(tmp_path / "a.glb", out, data))
    content = glb(*gltf_parts())
    (tmp_path / "a.glb").write_bytes(content[:8] + (len(content) + 5).to_bytes(4, "little") + content[12:])
    assert "found the end of the file" in refused(tmp_path / "a.glb")


def test_names_of_materials_are_not_those_of_objects(tmp_path):
    """A wall with a part in the paint of windows is no window."""
    out, data = gltf_parts(TWO)
    out["materials"] = [{"name": "Window frame white"}, {"name": "brick"}]
    primitive = out["meshes"][0]["primitives"][0]
    out["meshes"][0]["primitives"] = [primitive | {"material": 0}, primitive | {"material": 1}]
    scene = read(written(tmp_path / "a.glb", out, data))
    assert [placed.role for placed in scene.objects] == [Role.OCCLUDER] * 3
    out["meshes"][0]["name"] = "Window 3"
    scene = read(written(tmp_path / "a.glb", out, data))
    assert [placed.role for placed in scene.objects] == [Role.TRANSPARENT, Role.TRANSPARENT, Role.OCCLUDER]


def test_strides_offsets_and_interleaved_views(tmp_path):
    out, data = gltf_parts(ONE)
    points = box_corners((0, 0, 0), (4, 1, 3)).astype(np.float32)
    mixed = np.column_stack([np.full((8, 1), 99, np.float32), points, np.full((8, 2), -99, np.float32)])
    out["accessors"][0] |= {"bufferView": add_view(out, data, mixed.tobytes(), byteStride=24), "byteOffset": 4}
    assert box_of(read(written(tmp_path / "a.glb", out, data), up="z"), "wall") == [[0, 0, 0], [4, 1, 3]]


def test_sparse_values_replace_those_of_the_base(tmp_path):
    for base in (True, False):
        out, data = gltf_parts(ONE)
        accessor = out["accessors"][0]
        count = 3 if base else 8
        if not base:
            del accessor["bufferView"]
        places = add_view(out, data, np.arange(8 - count, 8, dtype=np.uint8).tobytes())
        moved = add_view(out, data, (2 * box_corners((0, 0, 0), (4, 1, 3))[8 - count :]).astype(np.float32).tobytes())
        accessor["sparse"] = {
            "count": count,
            "indices": {"bufferView": places, "componentType": 5121},
            "values": {"bufferView": moved},
        }
        high = read(written(tmp_path / "a.glb", out, data), up="z")
        assert box_of(high, "wall")[1] == [8, 3 if base else 2, 6]
        accessor["sparse"]["indices"]["componentType"] = 5125
        refused(written(tmp_path / "a.glb", out, data))


def test_turned_scaled_and_deep_nodes(tmp_path):
    out, data = gltf_parts(ONE)
    half = 2**-0.5
    # 2000 nodes deep; a quarter turn about z, twice as long (a quaternion of any length), and moved.
    out["nodes"][0] |= {"rotation": [0, 0, 2 * half, 2 * half], "scale": [2, 1, -1], "translation": [10, 20, 30]}
    out["nodes"] += [{"children": [k]} for k in range(2000)]
    out["scenes"] = [{"nodes": [2000]}]
    scene = read(written(tmp_path / "a.glb", out, data), up="z")
    # In the file the wall is (0, 0, -1) to (4, 3, 0): Y up.
    assert box_of(scene, "wall") == [[7, 20, 30], [10, 28, 31]]
    matrix = [0, 2, 0, 0, -1, 0, 0, 0, 0, 0, -1, 0, 10, 20, 30, 1]
    for key in ("rotation", "scale", "translation"):
        del out["nodes"][0][key]
    out["nodes"][0]["matrix"] = matrix
    assert box_of(read(written(tmp_path / "a.glb", out, data), up="z"), "wall") == [[7, 20, 30], [10, 28, 31]]


def test_shared_meshes_share_a_definition_in_the_order_of_nodes(tmp_path):
    out, data = gltf_parts(ONE)
    out["nodes"] = [{"mesh": 0, "name": f"n{10 - k}", "translation": [9 * k, 0, 0]} for k in range(3)]
    out["scenes"] = [{"nodes": [2, 0, 1]}]
    scene = read(written(tmp_path / "a.glb", out, data))
    assert [placed.name for placed in scene.objects] == ["n8", "n10", "n9"]
    assert len(scene.definitions) == 1


def test_meshes_that_differ_in_colour_alone_do_not_share(tmp_path):
    out, data = gltf_parts(ONE)
    out["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [k, 0.5, 0, 1]}} for k in (0, 1)]
    out["meshes"].append({"primitives": [dict(out["meshes"][0]["primitives"][0], material=1)]})
    out["meshes"][0]["primitives"][0]["material"] = 0
    out["nodes"] = [{"mesh": 0, "name": "a"}, {"mesh": 1, "name": "b", "translation": [9, 0, 0]}]
    out["scenes"] = [{"nodes": [0, 1]}]
    scene = read(written(tmp_path / "a.glb", out, data))
    assert [shape.lods[0].colours[0].tolist() for shape in scene.definitions] == [[0, 128, 0, 255], [255, 128, 0, 255]]


def test_vertex_colours_are_averaged(tmp_path):
    out, data = gltf_parts(ONE)
    shades = np.zeros((8, 4), np.uint8)
    shades[:, 0], shades[:, 3] = 255, 255
    shade = add_accessor(out, data, shades, "VEC4", normalized=True)
    out["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = shade
    (shape,) = read(written(tmp_path / "a.glb", out, data)).definitions
    assert (shape.lods[0].colours == [255, 0, 0, 255]).all()


CLEAR = {
    "blend": {"alphaMode": "BLEND"},
    "mask": {"alphaMode": "MASK"},
    "alpha": {"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5]}},
    "transmission": {"extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.4}}},
    "diffuse alpha": {"extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [1, 1, 1, 0.3]}}},
    "name": {"name": "Verglasung"},
}
SOLID = {
    "opaque": {"alphaMode": "OPAQUE", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1]}},
    "no transmission": {"extensions": {"KHR_materials_transmission": {}}},
    "solid diffuse": {"extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [1, 1, 1, 1]}}},
}


@pytest.mark.parametrize("case", [*CLEAR, *SOLID])
def test_materials_say_what_is_glass(tmp_path, case):
    out, data = gltf_parts(TWO)
    out["materials"] = [(CLEAR | SOLID)[case]]
    out["meshes"][1]["primitives"][0]["material"] = 0
    post = read(written(tmp_path / "a.glb", out, data)).objects[1]
    assert post.role is (Role.TRANSPARENT if case in CLEAR else Role.OCCLUDER)
    assert bool(post.why) is (case in CLEAR)


def test_what_has_no_triangles_is_skipped(tmp_path):
    out, data = gltf_parts(TWO)
    extra = {"lines": {"mode": 1}, "points": {"mode": 0}, "nothing": {"indices": add_accessor(
        out, data, np.zeros((0, 1), np.uint16), "SCALAR")}}  # fmt: skip
    for name, change in extra.items():
        out["nodes"].append({"mesh": len(out["meshes"]), "name": name})
        out["meshes"].append({"primitives": [out["meshes"][0]["primitives"][0] | change]})
    out["nodes"].append({"mesh": len(out["meshes"]) - 1, "name": "nothing again"})
    out["nodes"] += [{"mesh": 0, "skin": 0, "name": "dancer"}, {"mesh": 1, "name": "ghost"}]
    out["nodes"][-1]["extensions"] = {"KHR_node_visibility": {"visible": False}}
    out["meshes"].append({"primitives": [], "name": "spare"})
    out["scenes"] = [{"nodes": list(range(len(out["nodes"])))}]
    scene = read(written(tmp_path / "a.glb", out, data))
    assert [placed.name for placed in scene.objects] == ["wall", "post"]
    assert {one["what"] for one in scene.skipped} == {*extra, "nothing again", "dancer", "ghost", "spare"}


def test_strips_fans_and_left_over_corners(tmp_path):
    out, data = gltf_parts(TWO)
    strip = np.array([[0], [1], [2], [3], [3], [4], [4], [5], [6], [7]], np.uint8)
    out["meshes"][0]["primitives"] = [
        {"attributes": {"POSITION": 0}, "indices": add_accessor(out, data, strip, "SCALAR"), "mode": 5},
        {"attributes": {"POSITION": 0}, "indices": add_accessor(out, data, strip[:4], "SCALAR"), "mode": 6},
        {"attributes": {"POSITION": 0}, "indices": add_accessor(out, data, strip[:5], "SCALAR")},
    ]
    scene = read(written(tmp_path / "a.glb", out, data))
    # Of 8 triangles of the strip 4 turn the corner; the fan has 2, the list 1.
    assert scene.triangle_counts[0] == 4 + 2 + 1
    assert [note["why"] for note in scene.notes] == ["2 corners beyond the last whole triangle: ignored"]


@pytest.mark.parametrize(("mode", "corners"), [(4, [0, 1, 3, 0, 3, 2]), (5, [0, 1, 2, 3]), (6, [0, 1, 3, 2])])
def test_a_quad_in_every_mode_turns_one_way(tmp_path, mode, corners):
    out, data = gltf_parts(ONE)
    index = add_accessor(out, data, np.array(corners, np.uint32).reshape(-1, 1), "SCALAR")
    out["meshes"][0]["primitives"] = [{"attributes": {"POSITION": 0}, "indices": index, "mode": mode}]
    corners = read(written(tmp_path / "a.glb", out, data)).triangles()[0] * 2.0**-10
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert normals.tolist() == [[-3, 0, 0]] * 2
    # A strip has the edge from 1 to 2 twice, the others that from 0 to 3.
    shared = {tuple(point) for point in corners[0].tolist()} & {tuple(point) for point in corners[1].tolist()}
    assert shared == ({(0, 0, 1), (0, 1, -2)} if mode == 5 else {(0, 0, -2), (0, 1, 1)})


def test_morphs_move_what_they_weigh(tmp_path):
    out, data = gltf_parts(ONE)
    moves = add_accessor(out, data, np.tile(np.array([[4, 0, 0]], np.float32), (8, 1)), "VEC3")
    out["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": moves}]
    out["meshes"][0]["weights"] = [0.5]
    assert box_of(read(written(tmp_path / "a.glb", out, data)), "wall") == [[2, 0, 0], [6, 1, 3]]
    out["nodes"][0]["weights"] = [0.0]
    assert box_of(read(written(tmp_path / "a.glb", out, data)), "wall") == [[0, 0, 0], [4, 1, 3]]


def test_instances_have_places_turns_and_sizes(tmp_path):
    out, data = gltf_parts(ONE)
    attributes = {
        "TRANSLATION": add_accessor(out, data, np.array([[0, 0, 0], [10, 0, 0]], np.float32), "VEC3"),
        "ROTATION": add_accessor(
            out, data, np.array([[0, 0, 0, 127], [0, 127, 0, 0]], np.int8), "VEC4", normalized=True
        ),
        "SCALE": add_accessor(out, data, np.array([[1, 1, 1], [2, 1, 1]], np.float32), "VEC3"),
    }
    out["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    scene = read(written(tmp_path / "a.glb", out, data))
    assert box_of(scene, "wall #1") == [[0, 0, 0], [4, 1, 3]]
    # Half a turn about the axis that points up.
    assert box_of(scene, "wall #2") == [[2, -1, 0], [10, 0, 3]]
    out["accessors"][attributes["SCALE"]]["count"] = 1
    assert "instances" in refused(written(tmp_path / "a.glb", out, data))


def test_draco_is_decoded(tmp_path):
    from builders.model_files import draco_glb

    (tmp_path / "a.glb").write_bytes(draco_glb())
    scene = read(tmp_path / "a.glb")
    for name, box in HOUSE.items():
        assert np.abs(np.subtract(box_of(scene, name), box)).max() < 0.002


def test_what_is_packed_beside_its_fallback_is_read(tmp_path):
    out, data = gltf_parts(ONE)
    out["extensionsUsed"] = ["EXT_meshopt_compression"]
    out["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": {"buffer": 1, "byteLength": 4}}
    assert box_of(read(written(tmp_path / "a.glb", out, data)), "wall") == [[0, 0, 0], [4, 1, 3]]


def test_animated_nodes_are_noted(tmp_path):
    out, data = gltf_parts(ONE)
    out["animations"] = [{"channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}], "samplers": []}]
    assert [note["what"] for note in read(written(tmp_path / "a.glb", out, data)).notes] == ["1 animated nodes"]
