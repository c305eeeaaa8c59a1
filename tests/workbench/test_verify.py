"""The checker finds what is planted, and nothing in a house whose every verdict is exact."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from builders import corridors, small_house, turned_house
from builders.room_sets import assert_room_sets
from viewcell.data.buildings.office import make_office
from viewcell.data.errors import InputError
from viewcell.data.graph import OTHER_AXES, CellGraph
from viewcell.data.store.scene_folder import write_scene
from viewcell.data.verdict import Verdict
from viewcell.verify.cases.case_file import WrongHidden, load_cases, read_case, write_case
from viewcell.verify.exact.plan import inside_plans
from viewcell.verify.exact.segment import meets_flat_box
from viewcell.verify.exact.sightline import Sightlines
from viewcell.verify.exact.trace import contact_links, portal_links
from viewcell.verify.findings import VerifyResult
from viewcell.verify.proofs.certified import Certified
from viewcell.verify.rays.adjudicate import Judge, Judgement
from viewcell.verify.rays.free_space import FreeSpace
from viewcell.verify.rays.starts import aim_points, cell_origins, frontier_points
from viewcell.workbench import verify as workbench_verify
from viewcell.workbench.bake.run import bake
from viewcell.workbench.bench import __main__ as benches
from viewcell.workbench.bench import models as models_bench
from viewcell.workbench.verify import make_judge, replay, verify_bake

GRID = 2.0**-10
RAYS = 100_000


@pytest.fixture
def house(tmp_path):
    return small_house.small_house(tmp_path)


@pytest.fixture
def bare(tmp_path):
    return small_house.small_house(tmp_path, bare=True)


def changed(table, row, **values):
    """The table with some values of one row changed."""
    rows = table.to_pylist()
    rows[row].update(values)
    return pa.Table.from_pylist(rows, schema=table.schema)


def row_of(table, cell, target, column="reached_cell_id"):
    pairs = list(zip(table["cell_id"].to_pylist(), table[column].to_pylist(), strict=True))
    return pairs.index((cell, target))


def refusal(bake, **values):
    """The reason why the witness of cell 0 to cell 4 is refuted after the change."""
    bake.cell_to_cell = changed(bake.cell_to_cell, row_of(bake.cell_to_cell, 0, 4), **values)
    result = verify_bake(bake, rays=0)
    assert not result.ok and result.cell_witnesses.refuted == 1
    assert result.cell_witnesses.examples[0].startswith("cell 0")
    return result.cell_witnesses.examples[0].partition(": ")[2]


def test_a_true_bake_stands(house):
    result = verify_bake(house, rays=RAYS)
    assert result.ok and result.wrong_hidden == 0 and result.case is None
    assert result.rays >= RAYS and result.dark_cells == 0
    assert result.cell_witnesses.confirmed == house.potential_cells.sum()
    inhabitable, others, objects = result.counts
    assert inhabitable.potential == inhabitable.by_rays == inhabitable.seen == 14
    assert others.overestimate == 1.0 and others.unknown_percent == 0.0
    assert objects.potential == house.potential_objects.sum() and objects.seen == 0
    # The pane is seen although no ray stops there.
    assert objects.by_rays >= objects.potential - 3


def test_a_true_bare_graph_stands(bare):
    result = verify_bake(bare, rays=RAYS)
    assert result.ok and not result.embree_rates and result.rate_ratio == 0
    assert result.cell_rays == result.rays
    # Cell 1 shows itself to one ray in 20,000 from cell 5.
    assert result.counts[0].by_rays >= result.counts[0].potential - 1


def test_same_seed_same_findings(house):
    first, second = (verify_bake(house, rays=RAYS, seed=3) for _ in range(2))
    assert first.counts == second.counts and first.grazes == second.grazes


@pytest.mark.parametrize("kind", ["house", "bare"])
def test_a_lot_of_cells_at_a_time(kind, request, monkeypatch):
    """Whether their sets fit into memory together changes neither what is counted nor what is found."""
    bake = request.getfixturevalue(kind)
    together = verify_bake(bake, rays=RAYS)
    monkeypatch.setattr(workbench_verify, "MARKS_MOST", 1)
    apart = verify_bake(bake, rays=RAYS)
    assert apart.ok and apart.rays >= together.rays and apart.cell_rays >= together.cell_rays
    # A cell that claims everything alone in its lot leaves nothing to look for.
    assert len(apart.random_rays) == len(together.random_rays) and apart.guided_rays >= 0.7 * together.guided_rays
    for one, other in zip(apart.counts, together.counts, strict=True):
        assert (one.name, one.potential, one.seen) == (other.name, other.potential, other.seen)
        assert 0.9 * other.by_rays <= one.by_rays <= one.potential
    last = int(np.flatnonzero(bake.graph.inhabitable)[-1])
    target = int(np.flatnonzero(bake.potential_cells[last] & (np.arange(7) != last))[-1])
    bake.potential_cells[last, target] = False
    found = verify_bake(bake, rays=RAYS)
    assert found.wrong_hidden == 1 and read_case(found.case).cell == last


@pytest.mark.parametrize("kind", ["house", "bare"])
def test_every_planted_hidden_cell_is_found(kind, request):
    bake = request.getfixturevalue(kind)
    for cell, target in np.argwhere(bake.potential_cells):
        if cell != target:
            bake.potential_cells[cell, target] = False
            result = verify_bake(bake, rays=RAYS)
            assert result.wrong_hidden == 1 and not result.ok, (cell, target)
            case = read_case(result.case)
            assert (case.cell, case.kind, case.target) == (cell, "cell", target)
            again = replay(result.case, bake)
            assert again.hidden and again.judgement is Judgement.VISIBLE and not again.ok
            bake.potential_cells[cell, target] = True
            assert replay(result.case, bake).ok


@pytest.mark.parametrize("target", [0, 17, 18])
def test_every_planted_hidden_object_is_found(house, target):
    """The floor, the desk, the pane."""
    house.potential_objects[2, target] = False
    result = verify_bake(house, rays=RAYS)
    assert result.wrong_hidden == 1
    case = read_case(result.case)
    assert (case.cell, case.kind, case.target) == (2, "object", target)
    again = replay(result.case, house)
    assert not again.ok and again.line().startswith("wrong-hidden: cell 2 (room), object")


@pytest.mark.parametrize(("kind", "target"), [("cell", 4), ("object", 4), ("object", 17), ("object", 18)])
def test_even_rays_find_what_is_planted(house, kind, target, monkeypatch):
    """Alone: the guided rays are left out. The last is the pane, which stops no ray."""
    monkeypatch.setattr(workbench_verify, "_hunt", lambda *_: None)
    (house.potential_cells if kind == "cell" else house.potential_objects)[2, target] = False
    result = verify_bake(house, rays=RAYS)
    case = read_case(result.case)
    assert result.wrong_hidden == 1 and (case.cell, case.kind, case.target) == (2, kind, target)


@pytest.mark.parametrize("kind", ["cell", "object"])
def test_guided_rays_find_what_is_planted(house, kind, monkeypatch):
    """Alone: the even rays are left out."""
    monkeypatch.setattr(workbench_verify, "_cast_all", lambda *_: 0.0)
    (house.potential_cells if kind == "cell" else house.potential_objects)[2, 4] = False
    result = verify_bake(house, rays=RAYS)
    assert result.wrong_hidden == 1 and not result.ok and "confidence" not in result.table()
    case = read_case(result.case)
    assert (case.cell, case.kind, case.target) == (2, kind, 4) and not replay(result.case, house).ok


@pytest.mark.parametrize("hidden", [True, False])
@pytest.mark.parametrize(("y", "judgement"), [(640, "VISIBLE"), (961, "BLOCKED"), (960, "GRAZE")])
def test_a_case_is_fixed_unless_it_is_hidden_and_visible(hidden, y, judgement, house):
    """A line of sight that something else stops now accuses no more."""
    house.potential_cells[0, 2] = not hidden
    case = WrongHidden(str(house.folder), "", 0, "cell", 2, (2500.0, float(y), 640.0), (1100.0, 0.0, 0.0))
    again = replay(write_case(case), house)
    assert again.judgement is Judgement[judgement] and again.hidden == hidden
    assert again.ok == (not hidden or judgement != "VISIBLE")
    assert again.line().startswith("fixed" if again.ok else "wrong-hidden")


def test_verify_says_how_sure_it_is(house, bare):
    result = verify_bake(house, rays=RAYS)
    assert result.guided_rays == RAYS // 4 and len(result.random_rays) == house.graph.inhabitable.sum()
    assert "with 95 % confidence no view cell of 4 hides more than" in result.table()
    assert "confidence" not in verify_bake(bare, rays=1000).table()


def test_a_missing_portal_is_found(house):
    """The walk goes by contact, not by the portals under test."""
    graph = house.graph
    keep = np.arange(graph.portal_count) != 0
    house.graph = dataclasses.replace(
        graph, portal_cells=graph.portal_cells[keep], portal_axis=graph.portal_axis[keep], portals=graph.portals[keep]
    )
    house.potential_cells[0] = False
    house.potential_cells[0, 0] = True
    assert verify_bake(house, rays=RAYS).wrong_hidden == 1


def test_what_is_seen_through_a_closed_crack_is_a_leak(house):
    """Doorway 1 closed: that excuses what is seen through it, another does not."""
    judge = make_judge(house)
    origin, end = np.array([2500.0, 640.0, 640.0]), np.array([3600.0, 640.0, 640.0])
    assert judge.judge("cell", 0, 2, origin, end) is Judgement.VISIBLE
    crosses = [meets_flat_box(origin, end, portal[None]) for portal in house.graph.portals]
    assert 0 < sum(crosses) < len(crosses)
    for crossed, outcome in ((False, Judgement.VISIBLE), (True, Judgement.LEAK)):
        house.cracks = house.graph.portals[np.array(crosses) == crossed]
        assert make_judge(house).judge("cell", 0, 2, origin, end) is outcome
    house.potential_cells[0] = [True, False, False, False, False, False, False]
    result = verify_bake(house, rays=RAYS)
    assert result.leaks > 0


@pytest.mark.parametrize("outcome", [Judgement.GRAZE, Judgement.LEAK, Judgement.BLOCKED])
def test_only_what_the_judge_calls_visible_accuses(outcome, house, monkeypatch):
    house.potential_cells[0, 4] = house.potential_objects[0, 17] = False
    monkeypatch.setattr(Judge, "judge", lambda *_: outcome)
    result = verify_bake(house, rays=RAYS)
    assert (result.grazes + result.leaks + result.blocked > 0) and result.wrong_hidden == 0
    assert result.ok and result.case is None
    counts = {Judgement.GRAZE: result.grazes, Judgement.LEAK: result.leaks, Judgement.BLOCKED: result.blocked}
    assert [kind for kind, count in counts.items() if count] == [outcome]


@pytest.mark.parametrize(
    "fault", ["wrong_hidden", "cell_witnesses", "object_witnesses", "failed_proofs", "failed_occluders", "uncovered"]
)
def test_each_finding_alone_is_enough(fault):
    result = VerifyResult(certificates=Certified(3))
    assert result.ok
    if fault.endswith("witnesses"):
        getattr(result, fault).count[5] = 1
    else:
        setattr(result if fault == "wrong_hidden" else result.certificates, fault, 1)
    assert not result.ok


def test_grazes_are_not_violations(house):
    judge = make_judge(house)
    along_edge = np.array([2500.0, 960.0, 640.0]), np.array([3600.0, 960.0, 640.0])
    assert judge.judge("cell", 0, 2, *along_edge) is Judgement.GRAZE
    through = np.array([2500.0, 961.0, 640.0]), np.array([3600.0, 961.0, 640.0])
    assert judge.judge("cell", 0, 2, *through) is Judgement.BLOCKED
    from_wall = np.array([-10.0, 640.0, 640.0]), np.array([3600.0, 640.0, 640.0])
    assert judge.judge("cell", 0, 2, *from_wall) is Judgement.BLOCKED


def test_an_object_is_seen_only_before_all_others(house):
    """Past the desk (object 17, its top at height 8) to the wall behind it (object 12)."""
    judge = make_judge(house)

    def look(target, height, start=46):
        origin, end = np.array([[start, 36, height], [90, 36, height]]) * 64.0
        return judge.judge("object", 2, target, origin, end)

    assert look(17, 3) is Judgement.VISIBLE
    assert look(12, 3) is Judgement.BLOCKED
    assert look(12, 8) is Judgement.GRAZE
    assert look(12, 9) is Judgement.VISIBLE
    assert look(17, 9) is Judgement.GRAZE
    assert look(17, 3, start=63) is Judgement.BLOCKED, "from inside the desk"


@pytest.mark.parametrize("kind", ["house", "bare"])
def test_every_witness_is_looked_at(kind, request, monkeypatch):
    """A few at a time; a false one wherever it stands."""
    bake = request.getfixturevalue(kind)
    monkeypatch.setattr(workbench_verify, "CHUNK", 5)
    true, whole = bake.cell_to_cell, bake.potential_cells.sum()
    assert verify_bake(bake, rays=0).cell_witnesses.confirmed == whole
    for row in (0, 4, 5, len(true) - 1):
        bake.cell_to_cell = changed(true, row, origin_x=-1.0)
        found = verify_bake(bake, rays=0).cell_witnesses
        assert (found.refuted, found.confirmed) == (1, whole - 1)


@pytest.mark.parametrize("kind", ["house", "bare"])
def test_false_witnesses_are_refuted(kind, request, tmp_path):
    def fresh():
        return small_house.small_house(tmp_path, bare=kind == "bare")

    table = fresh().cell_to_cell
    true = table.to_pylist()[row_of(table, 0, 4)]
    portals, direction = true["portals"], true["direction_x"]
    assert refusal(fresh(), origin_x=None) == "no sightline stored"
    assert refusal(fresh(), origin_x=0.0) == "starts outside its cell"
    assert refusal(fresh(), direction_x=direction + 20) == "ends outside the reached cell"
    assert refusal(fresh(), portals=portals[::-1]) == "does not pass its portals in order"
    assert refusal(fresh(), portals=portals[:-1]) == "does not pass its portals in order"
    assert refusal(fresh(), portals=[*portals[:-1], 99]) == "does not pass its portals in order"
    turned = {"origin_y": true["origin_y"] + true["direction_y"], "direction_y": -true["direction_y"]}
    assert refusal(fresh(), **turned) in ("does not pass its portals in order", "is blocked")


def test_witness_through_a_wall_or_a_desk_is_blocked(house):
    line = {"origin_x": 46 / 16, "origin_y": 35 / 16, "direction_x": 35 / 16, "direction_y": 0.0, "direction_z": 0.0}
    row = row_of(house.cell_to_cell, 2, 2)
    for height, outcome in ((3, "is blocked"), (4, "grazes a triangle"), (8, "grazes a triangle")):
        house.cell_to_cell = changed(house.cell_to_cell, row, **line, origin_z=height / 16)
        assert verify_bake(house, rays=0).cell_witnesses.examples == [f"cell 2 (room) sees cell 2 (room): {outcome}"]


def test_witness_from_inside_the_desk(house):
    row = row_of(house.cell_to_cell, 2, 2)
    inside = {"origin_x": 63 / 16, "origin_y": 35 / 16, "origin_z": 4 / 16}
    house.cell_to_cell = changed(house.cell_to_cell, row, **inside)
    assert verify_bake(house, rays=0).cell_witnesses.examples == [
        "cell 2 (room) sees cell 2 (room): starts on or inside a solid"
    ]


def object_witness(house, target, end, start=(46, 20, 10)):
    """Give cell 2 a witness for an object, in 1/16 m; return the outcome."""
    vector = {f"origin_{a}": s / 16 for a, s in zip("xyz", start, strict=True)}
    vector |= {f"direction_{a}": (e - s) / 16 for a, s, e in zip("xyz", start, end, strict=True)}
    row = row_of(house.cell_to_object, 2, target, "object_id")
    house.cell_to_object = changed(house.cell_to_object, row, verdict="visible", **vector)
    result = verify_bake(house, rays=0)
    return result.object_witnesses.examples or result.object_witnesses.confirmed


def test_object_witnesses(house):
    desk, pane, floor = 17, 18, 0
    assert object_witness(house, desk, (60, 35, 4)) == 1
    assert object_witness(house, desk, (59.995, 35, 4)) == 1
    assert object_witness(house, desk, (59, 35, 4)) == ["cell 2 (room) sees object 17: misses the object"]
    assert object_witness(house, desk, (63, 35, 8)) == 1
    assert object_witness(house, pane, (85, 30, 10)) == 2
    assert object_witness(house, pane, (85, 39, 10)) == ["cell 2 (room) sees object 18: misses the object"]
    assert object_witness(house, pane, (85, 30, 10)) == 2
    assert object_witness(house, floor, (62, 35, 0), start=(62, 35, 12)) == ["cell 2 (room) sees object 0: is blocked"]


def test_contact_links_cover_every_face(house):
    """In the house contacts are the portals; a face shared by three neighbours is shared out."""
    cells = house.graph.cells
    links, portals = contact_links(cells), portal_links(house.graph)
    assert len(links.cells) == len(portals.cells) == 12
    assert np.array_equal(np.sort(links.rectangles, axis=0), np.sort(portals.rectangles, axis=0))
    split = np.array([[[0, 0, 0], [8, 8, 8]], [[8, 0, 0], [9, 4, 8]], [[8, 4, 0], [9, 9, 3]], [[8, 4, 3], [9, 9, 9]]])
    links = contact_links(split.astype(np.int32))
    row = slice(links.starts[1], links.starts[2])
    assert sorted(links.cells[row].tolist()) == [1, 2, 3]
    assert np.prod(np.diff(links.rectangles[row].reshape(-1, 2, 2), axis=2), axis=1).sum() == 64


def test_origins_and_aims(house):
    triangles, owners = house.scene.triangles()
    lines = Sightlines(triangles, owners)
    spots = cell_origins(house.graph, np.array([0, 2]), 100, lines, seed=1)
    assert len(spots[0]) == 100 and 80 < len(spots[1]) < 100
    assert lines.outside_solids(spots[1].astype(float)).all()
    aims = aim_points(triangles, owners, 30_000, seed=1)
    desk = house.scene.object_bounds()[17]
    assert ((aims >= desk[0]) & (aims <= desk[1])).all(axis=1).sum() > len(aims) / len(house.scene.objects) * 0.8


def test_frontier_is_hidden_and_beside_the_set(house):
    potential = np.zeros((2, 7), bool)
    potential[0, [0, 1]] = True
    potential[1] = True
    points = frontier_points(contact_links(house.graph.cells), house.graph.cells, potential, 50, seed=1)
    low, high = house.graph.cells[2]
    assert ((points[0] >= low) & (points[0] <= high)).all()
    assert points.shape == (2, 50, 3) and points[1, :, 0].min() < 2560 < points[1, :, 0].max()


def test_a_cell_inside_a_solid_has_no_rays(house):
    house.graph.cells[0] = np.array([[85, 1, 1], [87, 4, 4]]) * 64
    house.cell_to_cell = house.cell_to_cell.slice(0, 0)
    house.potential_cells[:, 0] = house.potential_cells[0] = True
    result = verify_bake(house, rays=RAYS)
    assert result.dark_cells == 1 and result.wrong_hidden == 0


def test_table_names_the_findings(house):
    house.potential_cells[0, 4] = False
    result = verify_bake(house, rays=RAYS)
    assert "wrong-hidden | 1 (case file" in result.table()
    assert "| cells, inhabitable | 13 |" in result.table()


def test_case_files(tmp_path):
    case = WrongHidden(str(tmp_path / "b"), "m.ifc", 3, "cell", 4, (0.1, 2.0**-40, 1e17), (1 / 3, -0.0, 5e-324))
    first, second = write_case(case), write_case(case)
    assert (first.name, second.name) == ("b-case-1.json", "b-case-2.json")
    assert read_case(first) == case
    fields = json.loads(first.read_text())
    for broken in (
        {**fields, "origin": [1, 2]},
        {**fields, "kind": "room"},
        {**fields, "extra": 1},
        {"format": "x"},
        [],
    ):
        second.write_text(json.dumps(broken))
        with pytest.raises(InputError, match=r"expected .* found [^\n]*$"):
            read_case(second)
    with pytest.raises(InputError, match="found nothing readable"):
        read_case(tmp_path / "none.json")


def test_bad_arguments(house, tmp_path):
    with pytest.raises(InputError, match="expected 0 or more, found -1"):
        verify_bake(house, rays=-1)
    case = WrongHidden(str(house.folder), "", 0, "cell", 700, (0.0,) * 3, (1.0,) * 3)
    with pytest.raises(InputError, match="found cell 0, target 700"):
        replay(write_case(case), house)
    cases = tmp_path / "cases.txt"
    cases.write_text("# nothing\nodd; open; ++; 0 0 0, 1 1 1; here\n")
    with pytest.raises(InputError, match="line 2: expected"):
        load_cases(cases)


def graph_of(folder):
    """A cell graph of a folder on a grid of 1/32 m."""
    cells, portals = (pq.read_table(folder / f"{name}.parquet") for name in ("cells", "portals"))
    box = np.array([[cells[f"{side}_{a}"].to_numpy() for a in "xyz"] for side in ("min", "max")])
    axis = portals["axis"].to_numpy().astype(np.int8)
    flat = np.zeros((len(axis), 2, 3))
    row = np.arange(len(axis))
    for side, name in enumerate(("min", "max")):
        flat[row, side, axis] = portals["coordinate"].to_numpy()
        for k, u in enumerate("uv"):
            flat[row, side, OTHER_AXES[axis, k]] = portals[f"{name}_{u}"].to_numpy()
    sides = np.column_stack([portals["cell_a"].to_numpy(), portals["cell_b"].to_numpy()]).astype(np.int32)
    names = np.array(cells["name"].to_pylist())
    to_steps = (box.transpose(2, 0, 1) * 32).round().astype(np.int32)
    return CellGraph(
        to_steps, cells["inhabitable"].to_numpy(), names, sides, axis, (flat * 32).round().astype(np.int32)
    )


@pytest.mark.parametrize(("name", "visible"), [("office", 23.4), ("w48", 38.6)])
def test_rays_through_a_building_stay_in_the_transitive_closure(bare, name, visible, tmp_path):
    """All cells within reach of portals are potential: no ray may leave them; most of the visible ones are reached."""
    graph = graph_of(corridors.graph_folder(name, tmp_path))
    reach = np.eye(graph.cell_count, dtype=bool)
    low, high = graph.portal_cells.T
    reach[low, high] = reach[high, low] = True
    for _ in range(10):
        reach = reach @ reach
    reach[~graph.inhabitable] = False
    bake = dataclasses.replace(bare, graph=graph, grid_m=1 / 32, potential_cells=reach)
    bake = dataclasses.replace(bake, cell_to_cell=bare.cell_to_cell.slice(0, 0))
    bake = dataclasses.replace(bake, potential_objects=np.zeros((graph.cell_count, 0), bool))
    result = verify_bake(bake, rays=200_000)
    assert result.wrong_hidden == 0 and result.blocked == 0
    assert visible / 2 < sum(c.by_rays for c in result.counts[:2]) / graph.inhabitable.sum() <= visible


def columns_of(printed):
    """The table's columns: head to the text of its only row."""
    head, _, row = ([cell.strip() for cell in line.strip("|").split("|")] for line in printed.splitlines())
    return dict(zip(head, row, strict=True))


@pytest.mark.parametrize(
    ("name", "numbers", "cut"),
    [("office", ("43", "70", "234"), "10 of 10, 0 cut"), ("w48", ("182", "236", "6,994"), "182 of 182, 0 cut")],
)
def test_bench_of_a_bare_graph(name, numbers, cut, capsys, tmp_path):
    assert benches.main(["flood", str(corridors.graph_folder(name, tmp_path)), "--repeats", "1"]) == 0
    row = columns_of(capsys.readouterr().out)
    assert (row["cells"], row["portals"], row["ordered pairs"]) == numbers
    assert row["unknown"] == row["asymmetric pairs"] == "0" and row["its sources, cut"] == cut
    assert benches.main(["flood", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_bench_of_a_model(capsys, tmp_path):
    write_scene(make_office(floors=1, rooms_per_side=1, furnished=False), tmp_path / "tiny.scene")
    assert benches.main(["models", str(tmp_path / "tiny.scene"), "--rays", "20000"]) == 0
    row = columns_of(capsys.readouterr().out)
    assert row["model"] == "tiny.scene" and row["wrong hidden"] == "0" and "flood" in row["seconds by phase"]
    assert row["undecided % of all pairs of cells"] == "0.0000" and row["witnesses confirmed, refuted"].endswith(", 0")


def test_undecided_pairs_are_counted_among_the_unknown(tmp_path, monkeypatch):
    made = bake(make_office(floors=1, rooms_per_side=1, furnished=False), tmp_path / "b")
    verdicts = made.cell_to_cell["verdict"].to_pylist()
    pairs = zip(made.cell_to_cell["cell_id"].to_pylist(), made.cell_to_cell["reached_cell_id"].to_pylist(), strict=True)
    changed_row = next(number for number, (cell, reached) in enumerate(pairs) if cell != reached)
    found = SimpleNamespace(verdict=np.array([Verdict.UNKNOWN]))

    def search(tree, boxes, rows, device):
        return SimpleNamespace(verdict=found.verdict[: len(rows)])

    monkeypatch.setattr(models_bench, "search_rounds", search)
    assert "unknown" not in verdicts and models_bench.undecided_percent(made) == 0
    made.cell_to_cell = changed(made.cell_to_cell, changed_row, verdict="unknown")
    size = made.graph.inhabitable.sum() * made.graph.cell_count
    assert models_bench.undecided_percent(made) == pytest.approx(100 / size)
    found.verdict[:] = Verdict.VISIBLE
    assert models_bench.undecided_percent(made) == 0


@pytest.fixture(scope="module")
def turned(tmp_path_factory):
    return turned_house.turned_bake(tmp_path_factory.mktemp("turned") / "turned.bake", certify=True)


def test_rooms_with_view_cells_at_an_angle_claim_nothing_of_each_other(turned):
    assert_room_sets(turned)
    assert turned.rooms["claims_rooms"].to_pylist() == [False, False]
    assert turned.room_to_room["verdict"].to_pylist() == ["visible", "unknown", "unknown", "visible"]


def test_a_bake_with_prisms_stands(turned):
    assert turned.manifest["format"] == 2 and len(turned.graph.plans.rows) == 2
    hidden = ~turned.potential_objects[turned.graph.plans.rows]
    assert hidden.sum() == 3
    result = verify_bake(turned, rays=RAYS)
    assert result.ok and result.wrong_hidden == 0 and result.object_witnesses.refuted == 0
    assert result.object_witnesses.confirmed > 15 and result.dark_cells == 0
    found = result.certificates
    assert (found.failed_proofs, found.uncovered, found.covered) == (0, 0, 3) and found.proofs >= 3


def test_certificates_hold_all_faces_of_walls_that_others_cover(tmp_path):
    """Walls of an office a little off the axes end at each other, where nobody sees their faces."""
    office = make_office(floors=1, rooms_per_side=1, yaw_deg=0.15, furnished=False)
    result = verify_bake(bake(office, tmp_path / "a.bake", yaw="0", certify=True, threads=1), rays=1000)
    found = result.certificates
    assert (found.failed_proofs, found.uncovered) == (0, 0) and found.covered > 200


def test_what_is_left_out_of_a_prisms_rows_is_found(turned):
    """Each object that a witness shows from a prism is missed when it is called hidden."""
    kept = turned.potential_objects.copy()
    shown = zip(turned.cell_to_object["cell_id"].to_pylist(), turned.cell_to_object["object_id"].to_pylist(),
                turned.cell_to_object["verdict"].to_pylist(), strict=True)  # fmt: skip
    found = 0
    for cell, target, verdict in shown:
        if verdict == "visible" and found < 6:
            left = kept.copy()
            left[cell, target] = False
            turned.__dict__["object_sets"] = small_house.sets_of(left)
            result = verify_bake(turned, rays=RAYS)
            assert result.wrong_hidden == 1 and not result.ok and result.certificates.uncovered == 1, (cell, target)
            found += 1
    assert found == 6


def beside_prism(bake):
    """Object 2 is the end wall: a point within the box around the first prism but beyond the wall, and one inside it.

    With the prism's cell, and the middle of the wall.
    """
    cell, plan = int(bake.graph.plans.rows[0]), bake.graph.plans.corners[0].astype(float)
    low = bake.graph.cells[cell, 0].astype(float)
    triangles, owners = bake.scene.triangles()
    wall = np.round(triangles[owners == 2].reshape(-1, 3).mean(axis=0))
    wall[2] = 1024.0
    inside, outside = np.array([*np.round(plan.mean(axis=0)), 1024.0]), np.array([low[0] + 1, low[1] + 1, 1024.0])
    return cell, inside, outside, wall


def test_eyes_beside_a_prism_but_in_its_box_are_no_eyes(turned):
    """From beyond the wall its outer face is in plain view, but no eye of the cell is there."""
    judge = make_judge(turned)
    cell, inside, outside, wall = beside_prism(turned)
    for origin, expected in ((inside, Judgement.VISIBLE), (outside, Judgement.BLOCKED)):
        assert judge.judge("object", cell, 2, origin, wall) == expected
        rows = np.array([cell]), np.array([2]), origin[None], wall[None]
        assert judge.judge_all("object", *rows)[0] == expected


def test_rays_start_inside_prisms(turned):
    sources = turned.graph.plans.rows
    lines = make_judge(turned).lines
    spots = cell_origins(turned.graph, sources, 64, lines, seed=0)
    for cell, own in zip(sources, spots, strict=True):
        assert len(own) > 8 and inside_plans(turned.graph.plans, np.full(len(own), cell), own.astype(float)).all()
    plans = turned.graph.plans.take(sources, turned.graph.cell_count)
    free = FreeSpace(turned.graph.cells[sources], spots, lines, plans)
    rows = np.repeat(np.arange(len(sources)), 2000)
    points, fresh, _ = free.draw(rows, np.random.default_rng(0))
    assert fresh.mean() > 0.9 and inside_plans(plans, rows[fresh], points[fresh].astype(float)).all()


def test_a_witness_from_beside_a_prism_is_refuted(turned):
    table = turned.cell_to_object
    cell, inside, outside, wall = beside_prism(turned)
    row = row_of(table, cell, 2, "object_id")
    for origin, refuted in ((inside, 0), (outside, 1)):
        way = (wall - origin) * GRID
        names = ("origin_x", "origin_y", "origin_z", "direction_x", "direction_y", "direction_z")
        values = dict(zip(names, [*(origin * GRID), *way], strict=True))
        turned.cell_to_object = changed(table, row, **values)
        result = verify_bake(turned, rays=0)
        turned.cell_to_object = table
        assert result.object_witnesses.refuted == refuted
