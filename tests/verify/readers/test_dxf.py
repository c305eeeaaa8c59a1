"""The second reader of DXF: nothing found on sound files, planted faults named, and what a format means by itself."""

import random

import numpy as np
import pytest
from builders.model_files import HOUSE, draw_house, dxf
from builders.planted import SAID, planted
from viewcell.data.readers import read
from viewcell.verify.readers.dxf import found_in_dxf
from viewcell.verify.readers.referee import differences
from viewcell.workbench.inspect.run import inspect

SQUARE = [(0, 0, 0), (4, 0, 0), (4, 0, 3), (0, 0, 3)]
VERSIONS = ["R12", "R2000", "R2004", "R2007", "R2018"]
GRID = {"column_count": 3, "column_spacing": 5, "row_count": 2, "row_spacing": 7}


def written(path, draw, **options):
    path.write_bytes(dxf(draw, **options))
    return path


def boxes(path) -> dict[str, list]:
    return {one.key: np.round(one.box, 9).tolist() for one in found_in_dxf(path)}


def square(drawing, **attributes):
    return drawing.modelspace().add_3dface(SQUARE, dxfattribs=attributes)


def leaf(drawing, **attributes) -> None:
    """Two squares, the second on a layer of its own, in a block within a block."""
    inner = drawing.blocks.new("leaf", base_point=(1, 2, 3))
    inner.add_3dface(SQUARE)
    inner.add_3dface([(x, 1, z) for x, _, z in SQUARE], dxfattribs={"layer": "Glas"})
    drawing.blocks.new("door set").add_blockref("leaf", (1, 0, 0), dxfattribs=attributes)


def draw_forms(drawing) -> None:
    """A cube of faces that share corners, a net, what is on paper, hidden, flat, or no face at all."""
    from ezdxf.render.forms import cube

    space, paper = drawing.modelspace(), drawing.layout("Layout1")
    cube().translate(5, 0, 0).render_polyface(space, dxfattribs={"layer": "cube"})
    cube().scale(7, 7, 7).render_polyface(paper, dxfattribs={"layer": "cube"})
    mesh = space.add_polymesh((3, 4), dxfattribs={"layer": "net"})
    for m in range(3):
        for n in range(4):
            mesh.set_mesh_vertex((m, n), (m, n, 0))
    drawing.layers.add("Hidden").off()
    drawing.layers.add("Frozen").freeze()
    for layer in ("wall", "Wall", "HIDDEN", "frozen"):
        square(drawing, layer=layer)
    space.add_3dface(SQUARE[:3], dxfattribs={"layer": "corner"})
    space.add_3dface([SQUARE[0], SQUARE[1]] * 2, dxfattribs={"layer": "flat"})
    space.add_solid([(0, 0), (1, 0), (0, 1), (1, 1)], dxfattribs={"layer": "solid"})
    space.add_line((0, 0), (1, 1))
    space.add_blockref("gone", (0, 0))
    drawing.blocks.new("plan").add_line((0, 0), (1, 1))
    space.add_blockref("plan", (0, 0))


def draw_blocks(drawing) -> None:
    leaf(drawing, xscale=-1)
    space = drawing.modelspace()
    turn = {"rotation": 90, "layer": "A-DOOR", "column_count": 2, "column_spacing": 10, "row_count": 4}
    space.add_blockref("DOOR SET", (100, 0, 0), dxfattribs=turn)
    space.add_blockref("leaf", (0, 9, 0), dxfattribs={"extrusion": (0, 0, -1), "rotation": 30, **GRID})
    odd = {"extrusion": (0.3, -0.5, 0.2), "rotation": 33, "xscale": 2, "yscale": -0.5, "zscale": 3, "layer": "B"}
    space.add_blockref("leaf", (5, 6, 7), dxfattribs=odd)
    space.add_blockref("leaf", (5, 6, 7), dxfattribs={"extrusion": (0.01, 0.01, 1)})
    square(drawing, layer="wall")


def draw_names(drawing) -> None:
    for name in ("Küche", "Küche #2", "100%"):
        drawing.layers.add(name)
        square(drawing, layer=name)


def saved(path, draw, version: str, form: str):
    """A file in its version's own coding, as text ("asc") or binary ("bin")."""
    import ezdxf

    drawing = ezdxf.new(version)
    draw(drawing)
    drawing.saveas(path, fmt=form)
    return path


@pytest.mark.parametrize("form", ["asc", "bin"])
@pytest.mark.parametrize("draw", [draw_forms, draw_blocks, draw_names])
@pytest.mark.parametrize("version", VERSIONS)
def test_both_readers_agree(tmp_path, version, draw, form):
    path = saved(tmp_path / "a.dxf", draw, version, form)
    assert differences(read(path), found_in_dxf(path)) == []


@pytest.mark.parametrize("form", ["asc", "bin"])
@pytest.mark.parametrize("version", VERSIONS[1:])
def test_both_readers_agree_on_a_house(tmp_path, version, form):
    path = saved(tmp_path / "a.dxf", draw_house, version, form)
    assert differences(read(path), found_in_dxf(path)) == []


def test_names_in_every_coding(tmp_path):
    for version in VERSIONS:
        for form in ("asc", "bin"):
            assert list(boxes(saved(tmp_path / "a.dxf", draw_names, version, form))) == ["Küche", "Küche #2", "100%"]


def test_objects_of_the_house(tmp_path):
    path = written(tmp_path / "a.dxf", draw_house)
    assert boxes(path) == {name: [list(low), list(high)] for name, (low, high) in HOUSE.items()}
    assert sum(one.area for one in found_in_dxf(path)) == 367.5


@pytest.mark.parametrize("form", ["asc", "bin"])
@pytest.mark.parametrize("version", VERSIONS[:3])
def test_signs_that_a_coding_lacks_are_numbers(tmp_path, version, form):
    def draw(drawing):
        square(drawing, layer="\u5899 a")
        drawing.blocks.new("T\u0159\xfcr").add_3dface(SQUARE)
        drawing.modelspace().add_blockref("T\u0159\xfcr", (9, 0, 0))

    path = saved(tmp_path / "a.dxf", draw, version, form)
    assert b"\\U+5899" in path.read_bytes()
    assert list(boxes(path)) == ["\u5899 a", "T\u0159\xfcr"]
    assert differences(read(path), found_in_dxf(path)) == []


# What a name says, and what it reads as before R2007.
SPELT = {
    "a\\U+00fcb": "a\xfcb",
    "\\U+00E9\\U+00A0x": "\xe9\xa0x",
    "\\U+D83D\\U+DE00": "\U0001f600",
    "a\\U+D83D": None,
    "\\U+DE00\\U+D83D": None,
    "a\\U+000Ab": None,
    "a\\U+2028b": None,
    "\\U+0001f600": None,
    "\\U+12": None,
    "\\U+\\U+0041": "\\U+A",
    "\\U+0041\\U+zz": "A\\U+zz",
    "\\U+FFFDx": "\ufffdx",
    "\\u+0041": None,
}


@pytest.mark.parametrize("said", SPELT)
def test_numbers_that_are_no_text_stay(tmp_path, said):
    for version in ("R2004", "R2007"):
        content = dxf(lambda drawing: square(drawing, layer="PLACE"), version=version)
        (tmp_path / "a.dxf").write_bytes(content.replace(b"PLACE", said.encode()))
        meant = (SPELT[said] if version == "R2004" else None) or said
        assert list(boxes(tmp_path / "a.dxf")) == [meant]
        scene = read(tmp_path / "a.dxf")
        assert [placed.name for placed in scene.objects] == [meant]


@pytest.mark.parametrize("number", range(25))
def test_units_are_those_of_the_drawing(tmp_path, number):
    path = written(tmp_path / "a.dxf", lambda drawing: square(drawing, layer="wall"), units=number)
    assert differences(read(path), found_in_dxf(path)) == []
    scene = read(path, unit="foot", up="y")
    assert differences(scene, found_in_dxf(path, 0.3048, "y")) == []
    assert differences(scene, found_in_dxf(path, 0.3048)) != []


def test_a_drawing_in_millimetres_is_inspected(tmp_path):
    def draw(drawing):
        for height in (0.0, 3000.0):
            points = [(0, 0, height), (4000, 0, height), (4000, 4000, height), (0, 4000, height)]
            drawing.modelspace().add_3dface(points, dxfattribs={"layer": f"at {height:g}"})

    path = written(tmp_path / "a.dxf", draw, units=4)
    assert inspect(path, referee=True, estimate=False).differences == []
    assert inspect(path, referee=True, estimate=False, unit="centimetre").differences == []


@pytest.mark.parametrize("fault", SAID)
@pytest.mark.parametrize("name", ["floor", "mid low", "box c"])
def test_planted_faults_are_named(tmp_path, name, fault):
    """In a MESH, in 3DFACEs, and in a block."""
    path = written(tmp_path / "a.dxf", draw_house)
    scene = read(path)
    place = [placed.name for placed in scene.objects].index(name)
    (line,) = differences(planted(scene, place)[fault], found_in_dxf(path))
    assert line.startswith(f"{name!r}: {SAID[fault]}")


@pytest.mark.parametrize("seed", range(12))
def test_both_readers_agree_on_blocks_at_random(tmp_path, seed):
    chance = random.Random(seed)

    def point(reach: float = 5.0) -> tuple[float, ...]:
        return tuple(chance.uniform(-reach, reach) for _ in range(3))

    def turned(size: float) -> dict:
        extrusion = chance.choice([(0, 0, 1), (0, 0, -1), point()])
        scale = {"xscale": size, "yscale": size * chance.choice([1, 0.5]), "zscale": size * chance.choice([1, -2])}
        return {"rotation": chance.uniform(0, 360), "extrusion": extrusion, "layer": chance.choice("0CD"), **scale}

    def rows() -> dict:
        if chance.random() < 0.5:
            return {}
        spacing = {"column_spacing": point()[0], "row_spacing": chance.choice([0, 4])}
        return {"column_count": 3, "row_count": 2, **spacing}

    def draw(drawing):
        names = [f"block {k}" for k in range(5)]
        for k, name in enumerate(names):
            block = drawing.blocks.new(name, base_point=point())
            for _ in range(2):
                block.add_3dface([point(), point(), point()], dxfattribs={"layer": chance.choice("0AB")})
            if k:
                place = turned(chance.choice([1, 2, -1])) | rows()
                block.add_blockref(chance.choice(names[:k]), point(), dxfattribs=place)
        for _ in range(4):
            place = turned(chance.uniform(0.5, 2)) | rows()
            drawing.modelspace().add_blockref(chance.choice(names), point(20), dxfattribs=place)

    path = written(tmp_path / "a.dxf", draw)
    assert differences(read(path), found_in_dxf(path)) == []


def test_an_array_is_scaled_with_the_block_that_holds_it(tmp_path):
    def draw(drawing):
        drawing.blocks.new("leaf").add_3dface(SQUARE)
        drawing.blocks.new("row").add_blockref("leaf", (1, 0, 0), dxfattribs=GRID)
        drawing.modelspace().add_blockref("row", (9, 0, 0), dxfattribs={"xscale": 2, "yscale": 3, "layer": "D"})

    # x: 9 + 2 (1 + 2 * 5 + 4), y: 3 * 7
    path = written(tmp_path / "a.dxf", draw)
    assert boxes(path) == {"row": [[11, 0, 0], [39, 21, 3]]}
    assert found_in_dxf(path)[0].area == 6 * 24
    assert differences(read(path), found_in_dxf(path)) == []


def test_a_turned_block_is_stretched_with_the_block_that_holds_it(tmp_path):
    def draw(drawing):
        drawing.blocks.new("leaf").add_3dface(SQUARE)
        drawing.blocks.new("set").add_blockref("leaf", (1, 0, 0), dxfattribs={"rotation": 30})
        drawing.modelspace().add_blockref("set", (9, 0, 0), dxfattribs={"xscale": 3})

    reach = round(12 + 3 * 4 * np.cos(np.pi / 6), 9)
    path = written(tmp_path / "a.dxf", draw)
    assert boxes(path) == {"set": [[12, 0, 0], [reach, 2, 3]]}
    assert differences(read(path), found_in_dxf(path)) == []


@pytest.mark.parametrize(("m_close", "n_close", "area"), [(0, 0, 6.0), (1, 0, 12.0), (0, 1, 12.0), (1, 1, 24.0)])
def test_nets_close_where_they_say(tmp_path, m_close, n_close, area):
    """The closing quads lie on the others: in area, not in the box."""

    def draw(drawing):
        mesh = drawing.modelspace().add_polymesh((3, 4), dxfattribs={"layer": "net"})
        for m in range(3):
            for n in range(4):
                mesh.set_mesh_vertex((m, n), (m, n, 0))
        mesh.close(m_close=bool(m_close), n_close=bool(n_close))

    path = written(tmp_path / "a.dxf", draw)
    (one,) = found_in_dxf(path)
    assert one.area == area and one.box.tolist() == [[0, 0, 0], [2, 3, 0]]
    assert differences(read(path), found_in_dxf(path)) == []


def test_a_smoothed_net_is_its_surface(tmp_path):
    def vertex(x, y, z, flags):
        return f"0\nVERTEX\n8\nnet\n10\n{x}\n20\n{y}\n30\n{z}\n70\n{flags}\n"

    frame = "".join(vertex(x, y, 5, 64 + 16) for x in (0, 1) for y in (0, 1))
    surface = "".join(vertex(x, y, 1, 64 + 8) for x in (0, 1, 2) for y in (0, 1, 2))
    head = "0\nSECTION\n2\nENTITIES\n0\nPOLYLINE\n8\nnet\n66\n1\n70\n20\n71\n2\n72\n2\n73\n3\n74\n3\n"
    (tmp_path / "a.dxf").write_text(head + frame + surface + "0\nSEQEND\n0\nENDSEC\n0\nEOF\n")
    assert boxes(tmp_path / "a.dxf") == {"net": [[0, 0, 1], [2, 2, 1]]}
    assert differences(read(tmp_path / "a.dxf"), found_in_dxf(tmp_path / "a.dxf")) == []


def test_comments_and_line_ends_of_any_kind(tmp_path):
    path = written(tmp_path / "a.dxf", draw_house)
    whole = path.read_bytes().replace(b"\r\n", b"\n")
    path.write_bytes(b"999\r\nby hand\r\n" + whole.replace(b"\n", b"\r\n"))
    assert differences(read(path), found_in_dxf(path)) == []
