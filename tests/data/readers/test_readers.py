from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.readers.triangulate import polygon_triangles
from viewcell.data.readers.units import metres_per_unit
from viewcell.data.scene import GRID_M, Role, Scene
from viewcell.data.store.scene_folder import write_scene

CUBE = trimesh.creation.box(bounds=[[5, 6, 7], [6, 8, 10]])  # away from its frame's origin


def by_name(scene: Scene) -> dict[str, tuple[str, Role]]:
    return {placed.name: (placed.kind, placed.role) for placed in scene.objects}


def size(scene: Scene) -> list[float]:
    bounds = scene.object_bounds()
    return ((bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0)) * scene.grid_m).tolist()


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def refused(path, **options) -> str:
    with pytest.raises(InputError) as error:
        read(path, **options)
    assert "\n" not in str(error.value)
    assert "expected" in str(error.value) and "found" in str(error.value)
    return str(error.value)


SQUARE = "v 0 0 0\nv 4 0 0\nv 4 0 3\nv 0 0 3\n"


@pytest.mark.parametrize("suffix", ["glb", "gltf", "obj", "ply", "stl"])
def test_every_format_gives_the_box(tmp_path, suffix):
    files = CUBE.export(file_type="glb") if suffix == "glb" else None
    path = tmp_path / f"box.{suffix}"
    if suffix == "gltf":
        for name, content in trimesh.Scene(CUBE).export(file_type="gltf").items():
            (tmp_path / name).write_bytes(content)
        path = tmp_path / "model.gltf"
    elif files is not None:
        path.write_bytes(files)
    else:
        CUBE.export(path)
    scene = read(path, up="z")
    assert size(scene) == [1, 2, 3]
    assert len(scene.triangles()[0]) == 12
    assert len(scene.definitions[0].lods[0].vertices) == 8  # welded, also from STL
    assert len(scene.sha256) == 64


@pytest.mark.parametrize(("suffix", "habit"), [("glb", "y"), ("obj", "z"), ("ply", "z"), ("stl", "z")])
def test_up_axis_follows_the_format_unless_told(tmp_path, suffix, habit):
    CUBE.export(tmp_path / f"box.{suffix}")
    sizes = {"z": [1, 2, 3], "y": [1, 3, 2]}
    assert size(read(tmp_path / f"box.{suffix}")) == sizes[habit]
    for up, expected in sizes.items():
        assert size(read(tmp_path / f"box.{suffix}", up=up)) == expected


def test_y_up_keeps_the_model_right_handed(tmp_path):
    path = write(tmp_path / "a.obj", "v 0 0 0\nv 2 0 0\nv 0 4 0\nv 0 0 6\nf 1 2 3\nf 1 3 4\nf 1 4 2\n")
    scene = read(path, up="y")
    corners = {tuple(v + scene.origin) for v in scene.definitions[0].lods[0].vertices}
    assert corners == {(0, 0, 0), (2, 0, 0), (0, 0, 4), (0, -6, 0)}


@pytest.mark.parametrize(
    ("unit", "metres"), [("mm", 0.001), ("Feet", 0.3048), ("inches", 0.0254), ("metres", 1), (0.125, 0.125), ("2", 2)]
)
def test_units(unit, metres):
    assert metres_per_unit(unit)[0] == metres


def test_unit_scales_the_model(tmp_path):
    path = write(tmp_path / "a.obj", SQUARE + "f 1 2 3 4\n")
    scene = read(path, unit="inch")
    np.testing.assert_allclose(size(scene), [4 * 0.0254, 0, 3 * 0.0254], atol=GRID_M)
    assert scene.unit == "inch"


def test_instances_share_a_definition(tmp_path):
    model = trimesh.Scene()
    for i in range(3):
        turn = trimesh.transformations.rotation_matrix(i, [0, 0, 1], [1, 2, 3])
        model.add_geometry(CUBE, node_name=f"n{i}", geom_name="cube", transform=turn)
    model.export(tmp_path / "a.glb")
    scene = read(tmp_path / "a.glb", up="z")
    assert len(scene.definitions) == 1
    expected = [trimesh.transform_points(CUBE.vertices, model.graph[f"n{i}"][0]) for i in range(3)]
    for object_id, points in enumerate(expected):
        got = scene.world_vertices(object_id) * GRID_M + scene.origin
        assert np.abs(np.sort(got, axis=0) - np.sort(points, axis=0)).max() <= GRID_M / 2 + 1e-6


def test_far_model_comes_back_to_a_whole_metre_origin_unmoved(tmp_path):
    far = np.array([4_500_000.0, 5_300_000.0, 812.0])
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in np.array([[0, 0, 0], [0.125, 0, 0], [0, 3.25, 0]]) + far)
    scene = read(write(tmp_path / "a.obj", text + "f 1 2 3\n"))
    assert (scene.origin == np.round(scene.origin)).all()
    assert np.abs(scene.origin - far).max() < 3
    assert scene.max_snap_m() == 0
    assert size(scene) == [0.125, 3.25, 0]


def test_obj_groups_and_materials_are_objects(tmp_path):
    write(tmp_path / "m.mtl", "newmtl veil\nd 0.4\nnewmtl wood\nd 1\nnewmtl mist\nTr 0.7\n")
    body = "".join(
        f"g {name}\nusemtl {material}\nf 1 2 3\n"
        for name, material in [
            ("wall", "wood"),
            ("curtain", "veil"),
            ("fog", "mist"),
            ("screen", "Translucent_Glass_Gray"),
            ("door 3", "wood"),
            ("outdoors", "wood"),
            ("7|IfcSlabStandardCase|floor", "wood"),
            ("8|IfcDoor|exit", "wood"),
            ("9|IfcFlowTerminal|sink", "wood"),
            ("wall", "glass"),
        ]
    )
    path = write(tmp_path / "a.obj", "mtllib m.mtl\n" + SQUARE + body)
    solid, clear = Role.OCCLUDER, Role.TRANSPARENT
    assert [(placed.name, placed.kind, placed.role) for placed in read(path).objects] == [
        ("wall", "Mesh", solid),
        ("curtain", "Mesh", clear),
        ("fog", "Mesh", clear),
        ("screen", "Mesh", clear),
        ("door 3", "Mesh", clear),
        ("outdoors", "Mesh", solid),
        ("7|IfcSlabStandardCase|floor", "IfcSlabStandardCase", solid),
        ("8|IfcDoor|exit", "IfcDoor", clear),
        ("9|IfcFlowTerminal|sink", "IfcFlowTerminal", Role.DETAIL),
        ("wall #2", "Mesh", clear),
    ]
    closed = by_name(read(path, doors="closed"))
    assert closed["door 3"][1] is solid and closed["8|IfcDoor|exit"][1] is solid and closed["screen"][1] is clear
    assert len(read(path).openings) == 1


def test_gltf_alpha_is_transparent(tmp_path):
    model = trimesh.Scene()
    for name, options in {
        "solid": {"baseColorFactor": [255, 0, 0, 255]},
        "pale": {"baseColorFactor": [255, 0, 0, 90], "alphaMode": "OPAQUE"},
        "blend": {"alphaMode": "BLEND"},
        "leaf": {"alphaMode": "MASK"},
    }.items():
        mesh = CUBE.copy()
        mesh.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(name=name, **options))
        model.add_geometry(mesh, node_name=name, geom_name=name)
    model.export(tmp_path / "a.glb")
    roles = {name: role for name, (_, role) in by_name(read(tmp_path / "a.glb")).items()}
    assert roles == {"solid": "occluder", "pale": "transparent", "blend": "transparent", "leaf": "transparent"}


SEEN_THROUGH = [
    "Glass",
    "glazing",
    "translucent sheet",
    "Transparent_3",
    "verre",
    "glas",
    "window 3",
    "Fenster",
    "fenêtre",
]
SEEN_THROUGH += ["fenetre", "7|IfcWindow|a", "7|IfcWindowStandardCase|a", "7|IfcCurtainWall|a", "7|IfcPlate|a"]
SOLID = ["wall", "glastonbury", "outdoor", "7|IfcWall|glass", "7|IfcMember|a", "winding road"]


@pytest.mark.parametrize("suffix", ["obj", "glb"])
def test_names_say_what_is_seen_through(tmp_path, suffix):
    """In any language of the list; an IFC class in a name outweighs its other words."""
    names = SEEN_THROUGH + SOLID
    if suffix == "obj":
        path = write(tmp_path / "a.obj", SQUARE + "".join(f"g {name}\nf 1 2 3\n" for name in names))
    else:
        model, path = trimesh.Scene(), tmp_path / "a.glb"
        for name in names:
            model.add_geometry(CUBE, node_name=name, geom_name=f"shape {names.index(name)}")
        model.export(path)
    roles = {name: role for name, (_, role) in by_name(read(path)).items()}
    assert [name for name in SEEN_THROUGH if roles[name] is not Role.TRANSPARENT] == []
    assert [name for name in SOLID if roles[name] is not Role.OCCLUDER] == []


@pytest.mark.parametrize("material", ["Glass", "some glazing", "verre", "TRANSPARENT"])
def test_a_material_of_glass_outweighs_every_name(tmp_path, material):
    body = "".join(f"g {name}\nusemtl {material}\nf 1 2 3\n" for name in ("wall", "7|IfcWall|a"))
    path = write(tmp_path / "a.obj", SQUARE + "g solid\nf 1 2 3\n" + body)
    assert [placed.role for placed in read(path).objects] == [Role.OCCLUDER, Role.TRANSPARENT, Role.TRANSPARENT]


def test_anything_less_than_opaque_is_transparent(tmp_path):
    """In 8 bits: the last step below opaque may be rounding, the one below it is not. Libraries add up."""
    kinds = {
        "d 1": 1,
        "d 0.998": 1,
        "d 0.99": 0,
        "d 0": 0,
        "Tr 0": 1,
        "Tr 0.01": 0,
        "Tr 0.9": 0,
        "Tr 1": 0,
        "d -halo 0.3": 0,
    }
    for half in (0, 1):
        lines = [f"newmtl m{n}\n{kind}\n" for n, kind in enumerate(kinds) if n % 2 == half]
        write(tmp_path / f"m{half}.mtl", "".join(lines))
    body = "".join(f"g part{n}\nusemtl m{n}\nf 1 2 3\n" for n in range(len(kinds)))
    path = write(tmp_path / "a.obj", "mtllib m0.mtl\nmtllib m1.mtl\n" + SQUARE + body)
    assert [int(placed.role is Role.OCCLUDER) for placed in read(path).objects] == list(kinds.values())
    model = trimesh.Scene()
    for alpha in (255, 254, 253, 0):
        mesh = CUBE.copy()
        material = trimesh.visual.material.PBRMaterial(name="m", baseColorFactor=[9, 9, 9, alpha])
        mesh.visual = trimesh.visual.TextureVisuals(material=material)
        model.add_geometry(mesh, node_name=f"part{alpha}", geom_name=f"shape{alpha}")
    model.export(tmp_path / "a.glb")
    roles = {name: role for name, (_, role) in by_name(read(tmp_path / "a.glb")).items()}
    assert {int(name[4:]) for name, role in roles.items() if role is Role.OCCLUDER} == {254, 255}


def test_obj_syntax(tmp_path):
    text = "o a\nv 0 0 0 1 1 1\nv 1 0 0\nv 1 1 0\nvt 0 0\nvn 0 0 1\nf -3/1/1 -2//1 \\\n  3\n"
    text += "l 1 2\n# f 9 9 9\nf 1/1 2/1 3/1\n"
    scene = read(write(tmp_path / "a.obj", text))
    assert len(scene.triangles()[0]) == 2


BAD_OBJ = {
    "unknown vertex": SQUARE + "f 1 2 9\n",
    "vertex 0": SQUARE + "f 0 1 2\n",
    "two corners": SQUARE + "f 1 2\n",
    "no number": "v 0 zero 0\n",
    "short vertex": "v 0 0\n",
    "no faces": SQUARE,
    "empty": "",
    "nan": SQUARE.replace("4", "nan") + "f 1 2 3\nf 1 2 4\n",
    "infinite": SQUARE.replace("4", "inf") + "f 1 2 3\n",
    "too large": SQUARE.replace("4", "1e9") + "f 1 2 3\n",
    "overflowing": SQUARE.replace("4", "1e308").replace("3", "-1e308") + "f 1 2 3\n",
    "flat": SQUARE + "f 1 1 2\nf 1 2 2\n",
    "all glass": SQUARE + "usemtl glass\nf 1 2 3\n",
}


@pytest.mark.parametrize("case", BAD_OBJ)
def test_unusable_obj_is_one_clear_line(tmp_path, case):
    assert "a.obj" in refused(write(tmp_path / "a.obj", BAD_OBJ[case]))


def test_one_bad_part_is_skipped_and_listed(tmp_path):
    text = SQUARE + "v nan 0 0\ng good\nf 1 2 3\nf 1 1 3\ng bad\nf 1 2 5\ng flat\nf 1 2 1\n"
    scene = read(write(tmp_path / "a.obj", text))
    assert [placed.name for placed in scene.objects] == ["good"]
    assert scene.skipped == [
        {"what": "bad", "why": "Mesh: a coordinate is not finite"},
        {"what": "flat", "why": "Mesh: no area on the grid"},
        {"what": "1 triangle", "why": "no area on the grid"},
    ]


@pytest.mark.parametrize("suffix", ["glb", "gltf", "ply", "stl", "obj", "ifc"])
@pytest.mark.parametrize("content", [b"", b"\x00\xff garbage \n" * 20, b"solid\n", b"ISO-10303-21;\nHEADER;\n"])
def test_garbage_is_one_clear_line(tmp_path, suffix, content):
    (tmp_path / f"a.{suffix}").write_bytes(content)
    refused(tmp_path / f"a.{suffix}")


def test_truncated_files_are_one_clear_line(tmp_path):
    for suffix in ("glb", "stl", "ply"):
        path = tmp_path / f"a.{suffix}"
        path.write_bytes(CUBE.export(file_type=suffix)[:300])
        assert "module" not in refused(path)
    (tmp_path / "a.gltf").write_bytes(trimesh.Scene(CUBE).export(file_type="gltf")["model.gltf"])
    refused(tmp_path / "a.gltf")  # its buffer is not beside it


def test_unusable_arguments(tmp_path):
    path = write(tmp_path / "a.obj", SQUARE + "f 1 2 3\n")
    assert "nothing" in refused(tmp_path / "b.obj")
    for options in ({"up": "x"}, {"unit": "cubit"}, {"unit": -1}, {"unit": "nan"}, {"doors": "ajar"}, {"grid_m": 0.0}):
        refused(path, **options)
    refused(write(tmp_path / "a.txt", ""))
    refused(tmp_path)
    refused(write(tmp_path / "a.ifc", "ISO-10303-21;"), unit="foot")


def test_scene_folder_is_read(tmp_path):
    write_scene(read(write(tmp_path / "a.obj", SQUARE + "f 1 2 3\n")), tmp_path / "a.scene")
    assert size(read(tmp_path / "a.scene")) == [4, 0, 3]
    refused(tmp_path / "a.scene", grid_m=0.5)


def area(points: np.ndarray) -> float:
    x, y = points.T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


@given(st.lists(st.integers(1, 9), min_size=4, max_size=12), st.integers(0, 2), st.booleans())
def test_star_shaped_polygons_keep_their_area(radii, axis, clockwise):
    angles = np.arange(len(radii)) * 2 * np.pi / len(radii)
    flat = np.stack([np.cos(angles), np.sin(angles)], axis=1) * np.array(radii)[:, None]
    flat = flat[::-1] if clockwise else flat
    points = np.insert(flat, axis, 0.0, axis=1)
    triangles = polygon_triangles(points.tolist(), list(range(len(radii))))
    assert len(triangles) == len(radii) - 2
    signed = [area(flat[list(corners)]) for corners in triangles]
    assert min(signed) * max(signed) >= -1e-9  # none turned over, so none overlap
    assert sum(signed) == pytest.approx(area(flat))
