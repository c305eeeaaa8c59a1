"""DXF through ezdxf: faces by layer and by placed block, units, colours, what is left out."""

import numpy as np
import pytest
from builders.model_files import HOUSE, draw_house, dxf
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.scene import GRID_M, Role

SQUARE = [(0, 0, 0), (4, 0, 0), (4, 0, 3), (0, 0, 3)]


def written(path, draw, **options):
    path.write_bytes(dxf(draw, **options))
    return path


def size(scene) -> list[float]:
    return (np.ptp(scene.bounds(), axis=0) * scene.grid_m).tolist()


def square(drawing, **attributes):
    return drawing.modelspace().add_3dface(SQUARE, dxfattribs=attributes)


@pytest.mark.parametrize("version", ["R2000", "R2010", "R2018"])
def test_layers_and_blocks_are_objects(tmp_path, version):
    scene = read(written(tmp_path / "a.dxf", draw_house, version=version))
    assert {placed.name for placed in scene.objects} == set(HOUSE)
    bounds = scene.object_bounds() * scene.grid_m + scene.origin
    assert {placed.name: box.tolist() for placed, box in zip(scene.objects, bounds, strict=True)} == {
        name: [list(low), list(high)] for name, (low, high) in HOUSE.items()
    }


UNITS = {0: 1, 1: 0.0254, 2: 0.3048, 4: 0.001, 5: 0.01, 6: 1, 14: 0.1, 21: 1200 / 3937}


@pytest.mark.parametrize("number", UNITS)
def test_units_are_those_of_the_drawing(tmp_path, number):
    path = written(tmp_path / "a.dxf", lambda drawing: square(drawing, layer="wall"), units=number)
    scene = read(path, grid_m=GRID_M / 64)
    np.testing.assert_allclose(size(scene), np.array([4, 0, 3]) * UNITS[number], atol=GRID_M / 32)
    assert [note["what"] for note in scene.notes] == (["$INSUNITS"] if number == 0 else [])
    assert size(read(path, unit="metre")) == [4, 0, 3]


def test_polyface_and_polygon_meshes(tmp_path):
    from ezdxf.render.forms import cube

    def draw(drawing):
        cube().translate(5, 0, 0).render_polyface(drawing.modelspace(), dxfattribs={"layer": "cube"})
        mesh = drawing.modelspace().add_polymesh((3, 4), dxfattribs={"layer": "net"})
        for m in range(3):
            for n in range(4):
                mesh.set_mesh_vertex((m, n), (m, n, 0))

    scene = read(written(tmp_path / "a.dxf", draw))
    assert [placed.name for placed in scene.objects] == ["cube", "net"]
    assert scene.triangle_counts.tolist() == [12, 12]


@pytest.mark.parametrize(("m_close", "n_close", "quads"), [(0, 0, 6), (1, 0, 9), (0, 1, 8), (1, 1, 12)])
def test_polygon_meshes_close_where_they_say(tmp_path, m_close, n_close, quads):
    """Three rings of four: the fourth quad of each, and the strip from the last ring to the first."""

    def draw(drawing):
        mesh = drawing.modelspace().add_polymesh((3, 4), dxfattribs={"layer": "net"})
        for m in range(3):
            for n, (x, y) in enumerate([(1, 0), (0, 1), (-1, 0), (0, -1)]):
                mesh.set_mesh_vertex((m, n), ((m % 2 + 1) * x, (m % 2 + 1) * y, m))
        mesh.close(m_close=bool(m_close), n_close=bool(n_close))

    assert read(written(tmp_path / "a.dxf", draw)).triangle_counts.tolist() == [2 * quads]


def test_a_polygon_mesh_with_too_few_vertices_is_one_line(tmp_path):
    content = dxf(lambda drawing: drawing.modelspace().add_polymesh((3, 4)), version="R2000")
    for said in (b" 71\n999999999\n", b" 71\n4\n"):
        (tmp_path / "a.dxf").write_bytes(content.replace(b" 71\n3\n", said))
        with pytest.raises(InputError, match=r"polygon mesh of 9*4? by 4 with 12 vertices"):
            read(tmp_path / "a.dxf")


def test_an_array_is_scaled_with_the_block_that_holds_it(tmp_path):
    def draw(drawing):
        drawing.blocks.new("leaf").add_3dface(SQUARE)
        rows = {"column_count": 3, "column_spacing": 5, "row_count": 2, "row_spacing": 7, "rotation": 90}
        drawing.blocks.new("row").add_blockref("leaf", (1, 0, 0), dxfattribs=rows)
        drawing.modelspace().add_blockref("row", (9, 0, 0), dxfattribs={"xscale": 2, "yscale": 3})

    # Along the array's rows, x: 9 + 2 (1 - 7), y: 3 (2 * 5 + 4)
    scene = read(written(tmp_path / "a.dxf", draw))
    assert (scene.bounds() * scene.grid_m + scene.origin).tolist() == [[-3, 0, 0], [11, 42, 3]]
    assert scene.triangle_counts.tolist() == [12]


def test_a_turned_block_is_sheared_by_the_block_that_holds_it(tmp_path):
    """At 45 degrees and three times as wide, it points 3 to 1 and the corners are right no more."""

    def draw(drawing):
        drawing.blocks.new("leaf").add_3dface([(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0)])
        drawing.blocks.new("set").add_blockref("leaf", (1, 0, 0), dxfattribs={"rotation": 45})
        drawing.modelspace().add_blockref("set", (9, 0, 0), dxfattribs={"xscale": 3})

    scene = read(written(tmp_path / "a.dxf", draw))
    half = 4 * np.sqrt(0.5)
    expected = [[12 - 3 * half, 0, 0], [12 + 3 * half, 2 * half, 0]]
    np.testing.assert_allclose(scene.bounds() * scene.grid_m + scene.origin, expected, atol=2 * GRID_M)


def test_numbered_signs_of_names_are_read(tmp_path):
    def draw(drawing):
        drawing.layers.add("\u5899 Glas", color=1)
        drawing.layers.add("T\xfcr \u5899").off()
        square(drawing, layer="wall")
        square(drawing, layer="\u5899 Glas")
        square(drawing, layer="T\xfcr \u5899")
        drawing.blocks.new("T\u016fr")
        drawing.blocks.new("Fen\xeatre \u5899").add_3dface(SQUARE)
        for name in ("Fen\xeatre \u5899", "T\u016fr"):
            drawing.modelspace().add_blockref(name, (9, 0, 0))

    scene = read(written(tmp_path / "plain.dxf", draw))
    content = dxf(draw, version="R2000")
    for sign in "\u5899\xfc\u016f\xea":
        content = content.replace(sign.encode(), b"\\U+%04X" % ord(sign))
    (tmp_path / "a.dxf").write_bytes(content)
    numbered = read(tmp_path / "a.dxf")
    assert [(one.name, one.role) for one in numbered.objects] == [(one.name, one.role) for one in scene.objects]
    assert [(one.name, one.role) for one in scene.objects] == [
        ("wall", Role.OCCLUDER),
        ("\u5899 Glas", Role.TRANSPARENT),
        ("Fen\xeatre \u5899", Role.TRANSPARENT),
    ]
    assert numbered.skipped == scene.skipped and len(scene.skipped) == 2


def test_what_is_beside_faces_in_a_block_is_listed(tmp_path):
    def draw(drawing):
        block = drawing.blocks.new("leaf")
        block.add_3dface(SQUARE)
        block.add_line((0, 0), (1, 1))
        block.add_3dface(SQUARE, dxfattribs={"layer": "off"})
        drawing.layers.add("off").off()
        rows = {"column_count": 3, "column_spacing": 5, "row_count": 10**6}
        drawing.modelspace().add_blockref("leaf", (0, 0), dxfattribs=rows)

    scene = read(written(tmp_path / "a.dxf", draw))
    assert [placed.name for placed in scene.objects] == ["leaf", "leaf #2", "leaf #3"]
    assert {one["what"] for one in scene.skipped} == {"3 of LINE", "3 entities of layer off"}


def test_blocks_within_blocks_in_rows(tmp_path):
    def draw(drawing):
        inner = drawing.blocks.new("leaf")
        inner.add_3dface(SQUARE)
        inner.add_3dface([(x, 1, z) for x, _, z in SQUARE], dxfattribs={"layer": "Glas"})
        drawing.blocks.new("door set").add_blockref("leaf", (1, 0, 0), dxfattribs={"xscale": -1})
        turn = {"rotation": 90, "layer": "A-DOOR", "column_count": 2, "column_spacing": 10}
        drawing.modelspace().add_blockref("door set", (100, 0, 0), dxfattribs=turn)
        square(drawing, layer="wall")

    scene = read(written(tmp_path / "a.dxf", draw))
    names = [placed.name for placed in scene.objects]
    assert names == ["wall", "door set: A-DOOR", "door set: Glas", "door set: A-DOOR #2", "door set: Glas #2"]
    boxes = scene.object_bounds() * scene.grid_m + scene.origin
    assert boxes[1].tolist() == [[100, -3, 0], [100, 1, 3]]
    assert boxes[3].tolist() == [[100, 7, 0], [100, 11, 3]]
    assert [placed.role for placed in scene.objects] == [Role.OCCLUDER] + [Role.TRANSPARENT] * 4


def test_colours_of_entities_and_layers(tmp_path):
    def draw(drawing):
        drawing.layers.add("red", color=1)
        drawing.layers.add("clear").transparency = 0.5
        square(drawing, layer="red")
        square(drawing, layer="blue", color=5)
        square(drawing, layer="true").rgb = (10, 20, 30)
        square(drawing, layer="clear", color=3)

    scene = read(written(tmp_path / "a.dxf", draw))
    shades = {shape.name: shape.lods[0].colours[0].tolist() for shape in scene.definitions}
    assert shades["red"] == [255, 0, 0, 255] and shades["blue"] == [0, 0, 255, 255]
    assert shades["true"] == [10, 20, 30, 255] and shades["clear"][:3] == [0, 255, 0]
    assert shades["clear"][3] == pytest.approx(128, abs=2)
    roles = {placed.name: placed.role for placed in scene.objects}
    assert roles == {"red": "occluder", "blue": "occluder", "true": "occluder", "clear": "transparent"}


def test_what_is_no_face_is_listed(tmp_path):
    def draw(drawing):
        space = drawing.modelspace()
        square(drawing, layer="wall")
        space.add_line((0, 0), (1, 1))
        space.add_line((0, 0), (2, 1))
        space.add_3dsolid().sat = ["700 0 1 0", "@8 nobody 1 @ 0", "End-of-ACIS-data"]
        drawing.blocks.new("plan").add_line((0, 0), (1, 1))
        space.add_blockref("plan", (0, 0))
        space.add_blockref("gone", (0, 0))
        drawing.layers.add("hidden").off()
        square(drawing, layer="hidden")

    scene = read(written(tmp_path / "a.dxf", draw))
    assert [placed.name for placed in scene.objects] == ["wall"]
    assert {one["what"]: one["why"] for one in scene.skipped} == {
        "1 of 3DSOLID": "an ACIS solid, which is not read",
        "3 of LINE": "no triangles",
        "1 of block gone": "no faces that are shown",
        "1 of block plan": "no faces that are shown",
        "1 entities of layer hidden": "the layer is off or frozen",
    }


def test_unusable_drawings_are_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr("viewcell.data.readers.dxf.POLYGONS", 10_000)

    def many(drawing):
        drawing.blocks.new("leaf").add_3dface(SQUARE)
        rows = {"column_count": 30000, "row_count": 30000, "column_spacing": 1, "row_spacing": 1}
        drawing.modelspace().add_blockref("leaf", (0, 0), dxfattribs=rows)

    def endless(drawing):
        drawing.blocks.new("leaf").add_blockref("leaf", (1, 0, 0))
        drawing.modelspace().add_blockref("leaf", (0, 0))

    def branching(drawing):
        for k in range(30):
            block = drawing.blocks.new(f"b{k}")
            for x in (1, 2):
                block.add_blockref(f"b{k + 1}", (x, 0, 0))
        drawing.blocks.new("b30").add_3dface(SQUARE)
        drawing.modelspace().add_blockref("b0", (0, 0))

    def heavy(drawing):
        block = drawing.blocks.new("leaf")
        for _ in range(1000):
            block.add_3dface(SQUARE)
        rows = {"column_count": 300, "row_count": 300, "column_spacing": 1, "row_spacing": 1}
        drawing.blocks.new("rows").add_blockref("leaf", (0, 0), dxfattribs=rows)
        drawing.modelspace().add_blockref("rows", (0, 0))

    found = {
        "many": "placed blocks",
        "endless": "deep",
        "branching": "placed blocks",
        "heavy": "polygons",
        "empty": "found",
    }
    for name, draw in zip(found, (many, endless, branching, heavy, lambda drawing: None), strict=True):
        with pytest.raises(InputError, match=found[name]) as error:
            read(written(tmp_path / f"{name}.dxf", draw))
        assert "\n" not in str(error.value)
    whole = dxf(draw_house)
    (tmp_path / "cut.dxf").write_bytes(whole[: len(whole) * 2 // 3])
    with pytest.raises(InputError, match="expected EOF"):
        read(tmp_path / "cut.dxf")
