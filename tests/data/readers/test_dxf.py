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


def test_unusable_drawings_are_one_line(tmp_path):
    def many(drawing):
        drawing.blocks.new("leaf").add_3dface(SQUARE)
        rows = {"column_count": 30000, "row_count": 30000, "column_spacing": 1, "row_spacing": 1}
        drawing.modelspace().add_blockref("leaf", (0, 0), dxfattribs=rows)

    def endless(drawing):
        drawing.blocks.new("leaf").add_blockref("leaf", (1, 0, 0))
        drawing.modelspace().add_blockref("leaf", (0, 0))

    for name, draw in {"many": many, "endless": endless, "empty": lambda drawing: None}.items():
        with pytest.raises(InputError) as error:
            read(written(tmp_path / f"{name}.dxf", draw))
        assert "\n" not in str(error.value)
    whole = dxf(draw_house)
    (tmp_path / "cut.dxf").write_bytes(whole[: len(whole) * 2 // 3])
    with pytest.raises(InputError, match="expected EOF"):
        read(tmp_path / "cut.dxf")
