import struct

import numpy as np
import pytest
from builders import corridors
from builders.four_rooms import write_graph
from builders.places import SHARED
from viewcell import InputError, bake
from viewcell.data.store.graph_folder import read_graph
from viewcell.data.store.quake import UNIT_STEPS, axial_graph, is_axial, read_bsp, read_prt, write_prt
from viewcell.verify.rays.windings import WindingLines
from viewcell.workbench.check.run import check

CASES = SHARED / "cases" / "readers"
# What the four rooms see: all but the first and the last see each other.
SEEN = np.ones((4, 4), bool)
SEEN[0, 3] = SEEN[3, 0] = False


@pytest.fixture
def rooms(tmp_path):
    graph, _ = read_graph(write_graph(tmp_path / "rooms"))
    write_prt(graph, tmp_path / "rooms.prt")
    return graph, tmp_path / "rooms.prt"


def write_bsp(path, graph, potential, version=29, coded=True):
    """A .bsp with leaves, sets and a model, and nothing in its other parts."""
    rows, offsets = bytearray(), []
    for row in potential:
        offsets.append(len(rows))
        for byte in np.packbits(row, bitorder="little").tobytes():
            rows += bytes([byte]) if byte else bytes([0, 1])
    boxes = graph.cells / UNIT_STEPS
    big = version == b"BSP2"
    leaves = bytes(44 if big else 28)
    for box, offset in zip(boxes, offsets, strict=True):
        head = struct.pack("<ii", -1, offset if coded else -1)
        corners = struct.pack("<6f", *box.ravel()) if big else struct.pack("<6h", *box.ravel().astype(int))
        leaves += head + corners + bytes(12 if big else 8)
    model = bytes(52) + struct.pack("<i", len(potential)) + bytes(8)
    parts = {4: bytes(rows), 10: leaves, 14: model}
    head, body = (version if big else struct.pack("<i", version)), b""
    for number in range(15):
        part = parts.get(number, b"")
        head += struct.pack("<ii", 4 + 8 * 15 + len(body), len(part))
        body += part
    path.write_bytes(head + body)
    return path


def turned(source, path, angle=0.2):
    """The portals of a .prt turned about the z axis."""
    portals, lines = read_prt(source), []
    c, s = np.cos(angle), np.sin(angle)
    for row, (a, b) in enumerate(portals.leaves):
        corners = portals.corners[portals.starts[row] : portals.starts[row + 1]]
        corners = np.column_stack([c * corners[:, 0] - s * corners[:, 1], s * corners[:, 0] + c * corners[:, 1]])
        heights = portals.corners[portals.starts[row] : portals.starts[row + 1], 2]
        words = [f"({x:.6f} {y:.6f} {z:.6f} )" for (x, y), z in zip(corners, heights, strict=True)]
        lines.append(f"{len(words)} {a} {b} {' '.join(words)}")
    path.write_text("\n".join(["PRT1", str(portals.leaf_count), str(len(lines)), *lines]) + "\n")
    return path


def test_a_graph_written_as_prt_is_read_back(rooms):
    graph, path = rooms
    portals = read_prt(path)
    assert portals.leaf_count == 4 and is_axial(portals)
    again = axial_graph(portals, "rooms")
    assert np.array_equal(again.portals, graph.portals)
    assert np.array_equal(again.portal_cells, graph.portal_cells)
    # The first room's only portal is in its high face: the least box about it is thin, and lies inside the room.
    assert (again.cells[:, 0] >= graph.cells[:, 0]).all() and (again.cells[:, 1] <= graph.cells[:, 1]).all()


def test_windings_face_their_first_leaf(rooms):
    portals = read_prt(rooms[1])
    for row in range(len(portals.leaves)):
        a, b, c = portals.corners[portals.starts[row] : portals.starts[row] + 3]
        axis = rooms[0].portal_axis[row]
        assert np.cross(b - a, c - b)[axis] < 0


@pytest.mark.parametrize("version", [29, 30, b"BSP2"])
def test_bsp_sets_are_decoded(rooms, tmp_path, version):
    sets = read_bsp(write_bsp(tmp_path / "rooms.bsp", rooms[0], SEEN, version))
    assert np.array_equal(sets.potential, SEEN) and sets.without == 0
    assert np.array_equal(sets.boxes * UNIT_STEPS, rooms[0].cells)


def test_long_runs_of_zeros_are_decoded(rooms, tmp_path):
    wide = np.zeros((100, 100), bool)
    np.fill_diagonal(wide, True)
    boxes = np.tile(rooms[0].cells[:1], (100, 1, 1))
    graph = type("Graph", (), {"cells": boxes})
    assert np.array_equal(read_bsp(write_bsp(tmp_path / "wide.bsp", graph, wide)).potential, wide)


def test_leaves_without_a_set_claim_everything(rooms, tmp_path):
    write_bsp(tmp_path / "rooms.bsp", rooms[0], SEEN, coded=False)
    result = check(tmp_path / "rooms.bsp")
    assert result.ok and result.claimed["cell"].all()
    assert "4 leaves have no set" in result.notes[0]


def test_check_of_a_compiled_map_is_exact(rooms, tmp_path):
    result = check(write_bsp(tmp_path / "rooms.bsp", rooms[0], SEEN))
    assert result.ok and result.exact and "exact" in result.confidence_line()
    assert np.array_equal(result.seen["cell"], SEEN)


@pytest.mark.parametrize("oblique", [False, True])
def test_check_finds_what_a_map_hides(rooms, tmp_path, oblique):
    _, prt = rooms
    if oblique:
        prt = turned(prt, tmp_path / "turned.prt")
    claims = SEEN.copy()
    claims[3, 1] = claims[0, 2] = False
    result = check(prt, claims, rays=40_000)
    assert result.exact is not oblique
    assert {(w.cell, w.target) for w in result.wrong} == {(3, 1), (0, 2)}
    assert {w.portals for w in result.wrong} == {(0, 1), (2, 1)}
    assert all(w.margin > 0 for w in result.wrong)
    assert "cell 3 sees cell 1" in result.table() and "units" in result.table()


def test_a_line_that_rationals_do_not_confirm_accuses_nobody(rooms, tmp_path, monkeypatch):
    monkeypatch.setattr(WindingLines, "path", lambda *_: None)
    result = check(turned(rooms[1], tmp_path / "turned.prt"), np.eye(4, dtype=bool), rays=40_000)
    assert result.ok and result.grazes > 0


def test_sampled_lines_say_how_sure_they_are(rooms, tmp_path):
    result = check(turned(rooms[1], tmp_path / "turned.prt"), SEEN, rays=40_000)
    assert result.ok and "95 % confidence no leaf hides more than 0.04" in result.confidence_line()
    assert np.array_equal(result.seen["cell"] | np.eye(4, dtype=bool), SEEN)


def test_lines_prove_the_same_whichever_way_windings_run(rooms, tmp_path):
    text = rooms[1].read_text().split("\n")
    back = [line.split("(") for line in text[3:] if line]
    lines = [f"{line[0]}{' '.join('(' + corner.strip() for corner in line[:0:-1])}" for line in back]
    (tmp_path / "back.prt").write_text("\n".join(text[:3] + lines) + "\n")
    for path in (rooms[1], tmp_path / "back.prt"):
        _, suspects = WindingLines(read_prt(path)).sample(np.eye(4, dtype=bool), 2000, 0)
        assert {(a, b) for a, b, *_ in suspects} == {(a, b) for a, b in np.argwhere(SEEN) if a != b}


@pytest.mark.parametrize("name", ["office", "w48"])
def test_sampled_lines_stay_within_what_stabbing_proves(name, tmp_path):
    folder = corridors.graph_folder(name, tmp_path)
    graph, _ = read_graph(folder)
    graph.inhabitable[:] = True
    write_prt(graph, tmp_path / "map.prt")
    truth = bake(corridors.write_graph(graph, tmp_path / "all"), tmp_path / "made.bake").potential_cells
    exact = check(tmp_path / "map.prt", truth)
    assert exact.ok and np.array_equal(exact.seen["cell"], truth)
    sampled = check(turned(tmp_path / "map.prt", tmp_path / "turned.prt"), truth, rays=400_000)
    assert sampled.ok and not sampled.exact
    assert (sampled.seen["cell"] & truth).sum() > 0.6 * truth.sum()


BAD_PRT = {
    "": "expected the first line PRT1, found ''",
    "PRT2\n1\n1\n0\n": "expected the first line PRT1, found 'PRT2'",
    "PRT1\n": "line 2: expected the number of leaves",
    "PRT1\n4\nmany\n": "line 3: expected the number of portals",
    "PRT1\n4\n2\n4 0 1 (0 0 0 ) (0 1 0 ) (0 1 1 ) (0 0 1 )\n": "expected 2 portals, found 1",
    "PRT1\n4\n1\n4 0 1 (0 0 0 ) (0 1 0 ) (0 1\n": "line 4: expected at least 3 corners",
    "PRT1\n4\n1\n4 0 9 (0 0 0 ) (0 1 0 ) (0 1 1 ) (0 0 1 )\n": "line 4: expected two leaves from 0 to 3, found 0 and 9",
    "PRT1\n4\n1\n4 0 1 (0 0 0 ) (0 1 0 ) (0 1 nan ) (0 0 1 )\n": "line 4: expected at least 3 corners",
}


@pytest.mark.parametrize("text", BAD_PRT)
def test_bad_prt_is_refused(tmp_path, text):
    (tmp_path / "bad.prt").write_text(text)
    with pytest.raises(InputError) as error:
        check(tmp_path / "bad.prt", SEEN)
    assert BAD_PRT[text] in str(error.value) and "\n" not in str(error.value)


def test_bad_bsp_is_refused(rooms, tmp_path):
    good = write_bsp(tmp_path / "rooms.bsp", rooms[0], SEEN).read_bytes()
    cases = {
        b"IBSP" + good[4:]: "expected a .bsp of version",
        good[:60]: "expected a directory",
        good[:-10]: "found the end of the file",
        good[: 4 + 8 * 4] + struct.pack("<ii", 0, 0) + good[4 + 8 * 5 :]: "not run through vis",
        good[: 4 + 8 * 4] + struct.pack("<ii", 124, 2) + good[4 + 8 * 5 :]: "expected 1 bytes of a set",
    }
    for data, said in cases.items():
        (tmp_path / "bad.bsp").write_bytes(data)
        with pytest.raises(InputError, match=said):
            check(tmp_path / "bad.bsp", cells=rooms[1])


def test_files_of_two_maps_are_refused(rooms, tmp_path):
    write_bsp(tmp_path / "rooms.bsp", rooms[0], SEEN)
    moved = rooms[1].read_text().replace("128", "1280")
    (tmp_path / "other.prt").write_text(moved)
    with pytest.raises(InputError, match=r"expected portals of the map in the \.bsp, found portal 0 outside leaf 0"):
        check(tmp_path / "rooms.bsp", cells=tmp_path / "other.prt")
    (tmp_path / "more.prt").write_text(rooms[1].read_text().replace("PRT1\n4", "PRT1\n5"))
    with pytest.raises(InputError, match=r"expected 4 leaves as in the \.bsp, found 5"):
        check(tmp_path / "rooms.bsp", cells=tmp_path / "more.prt")


def test_a_leaf_without_portals_sees_itself_alone(rooms, tmp_path):
    path = tmp_path / "more.prt"
    path.write_text(rooms[1].read_text().replace("PRT1\n4", "PRT1\n5"))
    result = check(path, np.pad(SEEN, (0, 1)))
    assert result.ok and result.seen["cell"][4].tolist() == [False] * 4 + [True]


def test_a_leaf_of_an_oblique_map_sees_itself(rooms, tmp_path):
    claims = np.eye(4, dtype=bool)
    turned(rooms[1], tmp_path / "turned.prt")
    result = check(tmp_path / "turned.prt", SEEN, rays=40_000)
    assert np.array_equal(result.seen["cell"], SEEN)
    assert result.claimed["cell"].sum() == result.seen["cell"].sum() == 14
    alone = check(tmp_path / "turned.prt", claims, rays=4)
    assert (np.diag(alone.seen["cell"])).all()


@pytest.mark.skipif(not CASES.is_dir(), reason="no shared cases folder beside the checkout")
def test_the_shared_oblique_map():
    result = check(CASES / "turned.bsp")
    assert result.seen["cell"].sum() == 14 and not result.wrong
