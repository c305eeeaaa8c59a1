"""Line trees: what the search hides has one, what can be seen has none, and every kind of tampering is refused."""

import shutil
from itertools import combinations
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from builders import blocker_scenes, certified_bake, four_rooms, small_house
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog
from viewcell.data.buildings.office import make_office
from viewcell.data.errors import InputError
from viewcell.data.scene import GRID_M
from viewcell.kernels.blockers import blocker_tree
from viewcell.kernels.launch import Device
from viewcell.kernels.line_tree import launch_line_trees
from viewcell.kernels.target import launch_target_search
from viewcell.verify.proofs.line_tree import (
    Blocker,
    check_certificates,
    contradict,
    graph_blocks,
    has_certificates,
    hides,
)
from viewcell.verify.proofs.ways import End
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.baked import load
from viewcell.workbench.cli import main
from viewcell.workbench.summary import summary

with_value, step = certified_bake.with_value, certified_bake.step


def hidden_cases(seeds):
    """(source, target, blockers, closed, words) of random scenes with a target that only several blockers hide."""
    for seed in seeds:
        source, target, boxes, closed = blocker_scenes.screened(seed)
        ends, tree, rows = (
            np.stack([source, target]),
            blocker_tree(blocker_scenes.blockers_of(boxes)),
            np.array([[0, 1, int(closed)]]),
        )
        answers = launch_target_search(tree, ends, rows, cap=5000)
        if answers.verdict[0] == 0:
            trees = launch_line_trees(tree, ends, rows, answers.nodes)
            yield source, target, boxes, closed, trees.words.tolist()


def as_blockers(boxes):
    """Flat boxes by number as the checker takes them."""
    return {n: Blocker(int((box[0] == box[1]).argmax()), box.tolist()) for n, box in enumerate(boxes)}


@pytest.fixture(scope="module")
def cases():
    return list(hidden_cases(range(400)))


def check(case, words=None, *, boxes=None, source=None, target=None, closed=None):
    """What the checker says of a case with some of it replaced."""
    known = as_blockers(case[2] if boxes is None else boxes)
    ends = [End((case[i] if new is None else new).tolist()) for i, new in enumerate((source, target))]
    return hides(*ends, case[3] if closed is None else closed, case[4] if words is None else words, known)


def test_every_hidden_pair_has_a_tree_that_holds(cases):
    assert len(cases) > 100 and sum(len(case[4]) > 20 for case in cases) > 20
    assert all(check(case) for case in cases)


@pytest.mark.slow
def test_every_hidden_pair_has_a_tree_that_holds_in_many_cases():
    assert all(check(case) for case in hidden_cases(range(10_000, 25_000)))


def test_a_tree_hides_nothing_that_random_segments_show(cases):
    """Blockers shrunk, the target or the source grown: where a random segment is clear, the tree must not hold."""
    random, shown = np.random.default_rng(0), 0
    for case in cases:
        for _ in range(8):
            boxes, source, target = case[2].copy(), case[0].copy(), case[1].copy()
            change = random.integers(3)
            if change == 0:
                number = random.integers(len(boxes))
                boxes[number] = boxes[number, 0] + (boxes[number] - boxes[number, 0]) // 2
            elif change == 1:
                target[random.integers(2), random.integers(3)] += random.integers(-4, 5)
            else:
                source[random.integers(2), random.integers(3)] += random.integers(-4, 5)
            if (source[0] >= source[1]).any() or (target[0] > target[1]).any():
                continue
            if ((source[0] < target[1]) & (target[0] < source[1])).all():
                continue
            if blocker_scenes.shown(source, target, boxes, case[3], int(random.integers(2**31)), 500):
                shown += 1
                assert not check(case, boxes=boxes, source=source, target=target)
    assert shown > 40


def test_no_word_of_a_tree_can_be_spared_or_changed_freely(cases):
    for case in cases[:40]:
        words = case[4]
        for place in range(len(words)):
            assert not check(case, words[:place] + words[place + 1 :])
        assert not check(case, [*words, words[-1]]) and not check(case, words[:-1]) and not check(case, [])


def in_sight(case, random):
    """A case whose blockers are so much smaller that a random segment passes, or None."""
    boxes = case[2].copy()
    for number in random.permutation(len(boxes))[: random.integers(1, 3)]:
        boxes[number] = boxes[number, 0] + (boxes[number] - boxes[number, 0]) // 2
    shown = blocker_scenes.shown(case[0], case[1], boxes, case[3], int(random.integers(2**31)), 400)
    return boxes if shown else None


@pytest.fixture(scope="module")
def visible_cases(cases):
    """Cases without one of their blockers' halves, where something is seen: what no tree may hide."""
    random = np.random.default_rng(1)
    found = [(case, boxes) for case in cases for _ in range(3) if (boxes := in_sight(case, random)) is not None]
    assert len(found) > 40
    return found


@given(st.data())
def test_no_change_of_words_hides_what_can_be_seen(visible_cases, data):
    """The tree of the whole blockers with words changed, dropped, doubled or put in from another tree."""
    case, boxes = data.draw(st.sampled_from(visible_cases))
    words = list(case[4])
    spare = [*words, *data.draw(st.sampled_from(visible_cases))[0][4]]
    for _ in range(data.draw(st.integers(0, 3))):
        place = data.draw(st.integers(0, max(0, len(words) - 1)))
        new = data.draw(st.one_of(st.sampled_from(spare), st.integers(-(2**26), 2**12)))
        change = data.draw(st.integers(0, 2))
        words[place : place + (change > 0)] = [new] if change < 2 else []
    assert not check(case, words, boxes=boxes)


@given(st.data())
def test_leaves_of_any_tags_hide_nothing_that_can_be_seen(visible_cases, data):
    """The nodes as they are, every leaf anything."""
    case, boxes = data.draw(st.sampled_from(visible_cases))
    tag = st.builds(lambda cycle, a, b, c: cycle + 8 * (a + 128 * (b + 128 * c)), *[st.integers(0, 4)] * 4)
    leaf = st.builds(
        lambda tags: [-1 - tags[0] - 2**24 * (len(tags) - 1), *(-1 - t for t in tags[1:])],
        st.lists(tag, min_size=1, max_size=3),
    )
    words, rest = [], iter(case[4])
    for word in rest:
        if word >= 0:
            words.append(word)
        else:
            for _ in range((-1 - word) // 2**24):
                next(rest)
            words += data.draw(leaf)
    assert not check(case, words, boxes=boxes)


def test_a_side_may_not_be_left_out():
    """Beyond the side that comes first and short of it is a contradiction, which would close a way that is open."""
    source, target = [[0, 0, 0], [2, 2, 2]], [[8, 4, 4], [10, 6, 6]]
    whole, low = ({0: Blocker(0, [[5, -40, -40], [5, 40, top]])} for top in (40, 3))
    sides, leaves = [0, 1, 2, 3], [-17, -3081, -19]
    first = sum(side << 2 * n for n, side in enumerate(sides))
    assert hides(End(source), End(target), False, [first, *leaves, -3083], whole)
    assert not hides(End(source), End(target), False, [first, *leaves, -3083], low)
    # Row 3 from axis 0 to 1 is beyond the side, row 2 from axis 1 to 0 short of it.
    both = -1 - 8 * (3 + 128 * 2)
    assert not hides(End(source), End(target), False, [first & 0b111111, *leaves, both], low)


def test_boxes_that_overlap_have_no_tree(cases):
    for case in cases:
        for octants in range(1, 9):
            assert not check(case, case[4] * octants, target=case[0])
        wide = np.stack([np.minimum(case[0][0], case[1][0]) - 1, np.maximum(case[0][1], case[1][1]) + 1])
        assert not check(case, source=wide) and not check(case, target=wide)


def test_a_blocker_on_the_near_face_hides_a_cell_but_not_an_object():
    source, target = [[0, 0, 0], [2, 2, 2]], [[8, 0, 0], [12, 2, 2]]
    wall = np.array([[[8, -40, -40], [8, 40, 40]]], np.int32)
    tree, boxes = blocker_tree(blocker_scenes.blockers_of(wall)), np.array([source, target], np.int32)
    rows = np.array([[0, 1, 0]])
    answers = launch_target_search(tree, boxes, rows)
    words = launch_line_trees(tree, boxes, rows, answers.nodes).words.tolist()
    assert hides(End(source), End(target), False, words, as_blockers(wall))
    assert not hides(End(source), End(target), True, words, as_blockers(wall))


def test_many_trees_at_once_are_those_of_one_at_a_time(cases):
    boxes = np.concatenate([case[2] for case in cases[:30]])
    tree = blocker_tree(blocker_scenes.blockers_of(boxes))
    ends = np.concatenate([np.stack(case[:2]) for case in cases[:30]])
    rows = np.column_stack([np.arange(0, 60, 2), np.arange(1, 60, 2), np.zeros(30, int)])
    answers = launch_target_search(tree, ends, rows, cap=5000)
    rows, nodes = rows[answers.verdict == 0], answers.nodes[answers.verdict == 0]
    together = launch_line_trees(tree, ends, rows, nodes, device=Device(threads=2))
    for number, row in enumerate(rows):
        alone = launch_line_trees(tree, ends, row[None], nodes[number : number + 1])
        begin, end = together.starts[number : number + 2]
        assert together.words[begin:end].tolist() == alone.words.tolist() and end > begin


def test_a_tree_without_room_is_not_written(cases):
    source, target, boxes, closed, _ = max(cases, key=lambda case: len(case[4]))
    tree, rows = blocker_tree(blocker_scenes.blockers_of(boxes)), np.array([[0, 1, int(closed)]])
    trees = launch_line_trees(tree, np.stack([source, target]), rows, np.zeros(1, int))
    assert trees.starts.tolist() == [0, 0]


numbers = st.integers(-6, 6)


@given(st.lists(st.tuples(numbers, numbers, numbers), min_size=1, max_size=6))
def test_cuts_contradict_exactly_where_a_linear_programme_finds_no_direction(cuts):
    """The largest margin m with g . w <= -m, w >= m, sum w = 1: positive where some w > 0 is inside all cuts."""
    table = np.array(cuts, float)
    rows = np.vstack([np.column_stack([table, np.ones(len(table))]), np.column_stack([-np.eye(3), np.ones(3)])])
    found = linprog([0, 0, 0, -1], rows, np.zeros(len(rows)), [[1, 1, 1, 0]], [1], bounds=[(None, None)] * 4)
    inside = -found.fun > 1e-7
    few = [part for size in (1, 2, 3) for part in combinations(cuts, size)]
    assert any(contradict([list(g) for g in part]) for part in few) != inside


def test_more_than_three_cuts_are_not_looked_at():
    assert contradict([[1, 0, 0]]) and not contradict([[1, 0, 0]] * 4)


def test_what_blocks_in_a_bare_graph():
    graph = small_house.small_graph()
    beside = [[0, 0], [5, 30]], [[15, 0], [40, 30]], [[5, 20], [15, 30]], [[-90, 40], [90, 99]]
    wall = [np.array(rectangle) * 64 for rectangle in beside]
    assert all(graph_blocks(graph, 0, 40 * 64, r) for r in wall)
    for r in wall[:3]:
        for side, axis, way in ((0, 0, -1), (0, 1, -1), (1, 0, 1), (1, 1, 1)):
            grown = r.copy()
            grown[side, axis] += way
            doorway = (grown[0] < [15 * 64, 20 * 64]).all() and (grown[1] > [5 * 64, 0]).all()
            assert graph_blocks(graph, 0, 40 * 64, grown) != doorway
    # Inside a cell nothing blocks.
    assert not graph_blocks(graph, 0, 41 * 64, np.array([[4, 0], [6, 2]]) * 64)


@pytest.fixture(scope="module")
def bakes(tmp_path_factory):
    """Plain and certified bakes of the house by every method, of an office, and of the four rooms."""
    folder = tmp_path_factory.mktemp("bakes")
    house, office = small_house.small_scene(), make_office(floors=1, rooms_per_side=2)
    rooms = four_rooms.write_graph(folder / "rooms")
    cells = folder / "cells.csv"
    cells.write_text("min_x,min_y,min_z,max_x,max_y,max_z\n0.5,0.5,0.5,2,2,1.5\n4,1,0.5,5,2,1.5\n6,1,0.5,7,2,1\n")
    wanted = {f"house {method}": (house, {"method": method}) for method in ("auto", "portals", "both", "occluders")}
    wanted |= {"office portals": (office, {}), "rooms": (rooms, {})}
    wanted |= {f"cells {method}": (house, {"method": method, "cells": str(cells)}) for method in ("portals", "both")}
    return {
        name: [
            bake(model, folder / f"{name} {certify}.bake", settings=Settings(certify=certify, **options), threads=1)
            for certify in (False, True)
        ]
        for name, (model, options) in wanted.items()
    }


NAMES = ["house auto", "house portals", "house both", "house occluders", "office portals", "rooms"]
NAMES += ["cells portals", "cells both"]


@pytest.mark.parametrize("name", NAMES)
def test_certified_bakes_hold_and_are_about_as_tight(name, bakes):
    plain, made = bakes[name]
    found = check_certificates(load(made.folder))
    assert found.failed == 0 and found.examples == [] and found.proofs > 0 and found.leaves >= found.proofs
    hidden = int((~made.potential_objects[made.graph.inhabitable]).sum())
    if made.claims_cells:
        hidden += int((~made.potential_cells[made.graph.inhabitable]).sum())
    assert found.covered == hidden > 0
    assert made.potential_objects.sum() <= 1.05 * plain.potential_objects.sum()
    assert made.claims_cells == plain.claims_cells
    if made.claims_cells:
        assert made.potential_cells.sum() <= 1.05 * plain.potential_cells.sum()


def test_certified_bakes_of_bare_graphs_hide_the_same(bakes):
    plain, made = bakes["rooms"]
    assert (plain.potential_cells == made.potential_cells).all() and not made.potential_cells.all()
    assert made.cell_to_cell["verdict"].to_pylist() == plain.cell_to_cell["verdict"].to_pylist()


@pytest.mark.parametrize("name", ["house auto", "rooms", "cells both"])
def test_certified_bakes_pass_every_check(name, bakes):
    result = load(bakes[name][1].folder).verify(rays=20_000)
    assert result.ok and f"| certificates | {result.certificates.line()} |" in result.table()


@pytest.fixture(scope="module")
def honest(bakes):
    return bakes["house auto"][1].folder


@pytest.fixture
def tampered(honest, bakes, tmp_path):
    """What a check finds after a change of the rows of some tables; of the house unless told otherwise."""

    def tamper(name=None, **changes):
        folder = honest if name is None else bakes[name][1].folder
        return certified_bake.tamper(folder, tmp_path / "tampered.bake", **changes)

    return tamper


def changed_words(honest, change):
    """A change of the longest tree."""
    trees = pq.read_table(honest / "trees.parquet")["words"].to_pylist()
    longest = max(range(len(trees)), key=lambda row: len(trees[row]))
    return with_value(longest, words=change)


def test_a_dropped_child(tampered, honest):
    assert tampered(trees=changed_words(honest, lambda words: words[:1] + words[2:])).failed_proofs == 1


def test_a_dropped_octant(tampered, honest):
    def without_last(words):
        """The last octant's tree begins where what is before it can be read alone."""
        need, last = 0, 0
        for place, word in enumerate(words):
            last = place if need == 0 else last
            need = max(need - 1, 0) if word < 0 else need + 3
        return words[:last] if last else words[:-1]

    assert tampered(trees=changed_words(honest, without_last)).failed_proofs == 1


def test_a_replaced_cut(tampered, honest):
    def swap(words):
        place = next(place for place, word in enumerate(words) if word < 0)
        return [*words[:place], -1 - ((-1 - words[place]) ^ 0b1), *words[place + 1 :]]

    assert tampered(trees=changed_words(honest, swap)).failed_proofs == 1


def test_a_wrong_blocker(tampered, honest):
    ids = pq.read_table(honest / "blockers.parquet")["blocker_id"].to_pylist()

    def swap(words):
        other = next(number for number in ids if number != words[0] // 256)
        return [other * 256 + words[0] % 256, *words[1:]]

    assert tampered(trees=changed_words(honest, swap)).failed_proofs == 1


def test_an_unknown_blocker(tampered, honest):
    assert tampered(trees=changed_words(honest, lambda words: [2**30, *words[1:]])).failed_proofs == 1


@pytest.mark.parametrize("axis", "xyz")
def test_a_box_as_large_as_the_house(axis, tampered):
    far = {f"min_{axis}": lambda _: -0.25, f"max_{axis}": lambda _: 8.25}
    found = tampered(proofs=lambda rows: [row | {name: f(0) for name, f in far.items()} for row in rows])
    assert found.failed_proofs > 0


@pytest.mark.parametrize("side", ["min_u", "min_v", "max_u", "max_v"])
def test_a_grown_blocker(side, tampered, honest):
    sign = -1 if side.startswith("min") else 1
    found = tampered(blockers=lambda rows: [row | {side: row[side] + sign * 8.0} for row in rows])
    assert found.failed_occluders == pq.read_table(honest / "blockers.parquet").num_rows
    assert found.failed_proofs == found.proofs and "does not block" in found.examples[0]


@pytest.mark.parametrize("name", ["house auto", "rooms"])
def test_a_blocker_moved_off_its_wall(name, tampered):
    """Inside a room nothing blocks."""
    found = tampered(name, blockers=lambda rows: [row | {"coordinate": row["coordinate"] + 1.0} for row in rows])
    assert found.failed_occluders > 0 and found.failed_proofs > 0 and found.uncovered > 0


@pytest.mark.parametrize("name", ["house auto", "rooms"])
def test_removed_proofs(name, tampered):
    found = tampered(
        name,
        proofs=lambda rows: [row for row in rows if row["cell_id"] != 0],
        trees=lambda rows: [],
        leaves=lambda rows: [],
    )
    assert found.uncovered > 0 and found.failed_proofs == found.proofs


@pytest.mark.parametrize("side", ["min", "max"])
@pytest.mark.parametrize("axis", "xyz")
def test_a_proof_of_nearly_all_of_a_cell_hides_it_not(axis, side, tampered):
    """What reaches over the side of the box by a step is not in it."""
    inwards = GRID_M if side == "min" else -GRID_M
    found = tampered(
        "rooms", proofs=lambda rows: [row | {f"{side}_{axis}": row[f"{side}_{axis}"] + inwards} for row in rows]
    )
    assert found.failed_proofs < found.proofs and found.uncovered > 0 and "in no box" in found.examples[-1]
    assert found.covered == 0


def test_a_proof_without_a_tree(tampered):
    assert tampered(trees=lambda rows: rows[1:]).failed_proofs == 1


def test_a_proof_about_cells_hides_no_objects(tampered):
    found = tampered(proofs=lambda rows: [row | {"closed": False} for row in rows])
    assert found.uncovered > 0 and "object" in found.examples[-1]


def test_an_object_hidden_without_proof(tampered):
    assert tampered(cell_to_object=lambda rows: rows[1:]).uncovered == 1


def test_a_cell_hidden_without_proof(tampered):
    """Followed back it is hidden without proof, too, if the other end is inhabitable; the row itself is one pair."""
    found = tampered("rooms", cell_to_cell=lambda rows: [row for row in rows if row["cell_id"] != 0])
    assert found.uncovered == 3 and found.examples[0].startswith("cell 0, cell 0")


def test_a_wall_made_transparent(tampered):
    found = tampered(objects=lambda rows: [row | {"role": "transparent"} for row in rows])
    assert found.failed_occluders > 0 and found.failed_proofs == found.proofs and found.uncovered > 0


def test_a_portal_opened_in_a_wall(tampered):
    """In a bare graph the portals say what blocks."""
    found = tampered("rooms", portals=lambda rows: [row | {"min_u": 0.0, "max_u": 4.0} for row in rows[:2]] + rows[2:])
    assert found.failed_occluders > 0 and found.uncovered > 0


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ({"trees": with_value(0, proof_id=lambda _: -1)}, "proof_id of a row"),
        ({"trees": lambda rows: [*rows, rows[0]]}, "every proof_id once"),
        ({"proofs": lambda rows: [*rows, rows[0]]}, "every proof_id once"),
        ({"proofs": with_value(0, cell_id=lambda _: 10**6)}, "cell_id of a row"),
        ({"proofs": with_value(0, min_x=lambda x: x + 1e-6)}, "expected multiples"),
        ({"blockers": lambda rows: [*rows, rows[0]]}, "every blocker_id once"),
        ({"blockers": with_value(0, axis=lambda _: 5)}, "axis from 0 to 2 or"),
        ({"blockers": with_value(0, min_u=lambda x: x + GRID_M / 3)}, "expected multiples"),
    ],
)
def test_broken_tables_are_bad_input(changes, wanted, tampered):
    with pytest.raises(InputError, match=wanted):
        tampered(**changes)


@pytest.mark.parametrize("name", ["proofs", "trees", "blockers", "leaves", "occluders"])
def test_a_missing_table_is_bad_input(name, honest, tmp_path, capsys):
    folder = Path(shutil.copytree(honest, tmp_path / "copy.bake"))
    (folder / f"{name}.parquet").unlink()
    with pytest.raises(InputError, match="found nothing there"):
        check_certificates(load(folder))
    # It promised them.
    with pytest.raises(InputError, match="found nothing there"):
        load(folder).verify(rays=0)
    assert main(["verify", str(folder), "--certificates"]) == 2
    assert name in capsys.readouterr().err


def test_a_bake_without_certificates_is_not_asked_for_them(bakes):
    made = load(bakes["rooms"][0].folder)
    assert not has_certificates(made) and made.verify(rays=0).certificates is None
    assert has_certificates(load(bakes["rooms"][1].folder))
    assert main(["verify", str(made.folder), "--certificates"]) == 2


def test_the_command_that_checks_certificates_alone(honest, tmp_path, capsys):
    folder = Path(shutil.copytree(honest, tmp_path / "copy.bake"))
    assert main(["verify", str(folder), "--certificates"]) == 0
    assert " proofs hold" in capsys.readouterr().out
    table = pq.read_table(folder / "trees.parquet")
    pq.write_table(table.slice(1), folder / "trees.parquet")
    assert main(["verify", str(folder), "--certificates"]) == 1
    assert "refuted: proof " in capsys.readouterr().out
    assert main(["verify", str(folder), "--rays", "0", "--no-progress"]) == 1


def test_the_summary_tells_the_size_of_proofs(bakes):
    plain, made = bakes["rooms"]
    proofs = pq.read_table(made.folder / "proofs.parquet")
    assert proofs.schema.field("closed").type == pa.bool_()
    assert f"{proofs.num_rows} proofs, a proof " in summary(made) and "proofs" not in summary(plain)
