"""Whole bakes: two-sided, symmetric, repeatable, resumable, and conservative against brute force."""

import shutil
from collections import Counter
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
import viewcell
from builders import corridors, random_buildings
from builders.pages import follow
from builders.places import ROOT, SHARED
from builders.random_buildings import box_triangles as box
from builders.random_buildings import scene_of, tetrahedron
from builders.room_sets import assert_room_sets
from viewcell.data.buildings.office import make_office
from viewcell.data.errors import InputError
from viewcell.data.scene import Role
from viewcell.solvers.visibility.portal_engine import PortalEngine
from viewcell.verify.exact.sightline import Sight, Sightlines
from viewcell.verify.rays.witness import visible_rows
from viewcell.workbench.bake import blocks, manifest, place
from viewcell.workbench.bake import run as baking
from viewcell.workbench.bake.settings import Settings
from viewcell.workbench.baked import load

METRE = 1024
TABLES = ("cell_to_cell", "cell_to_object")
ROOM_TABLES = ("rooms", "room_to_object", "room_to_room")


@pytest.fixture(scope="module")
def office():
    return make_office(floors=1, rooms_per_side=2)


@pytest.fixture(scope="module")
def office_bake(office, tmp_path_factory):
    return viewcell.bake(office, tmp_path_factory.mktemp("bake") / "office", threads=1)


@pytest.fixture(scope="module")
def shell():
    """The office without furniture: as many cells, a fifth of the objects."""
    return make_office(floors=1, rooms_per_side=2, furnished=False)


@pytest.fixture(scope="module")
def shell_bake(shell, tmp_path_factory):
    return viewcell.bake(shell, tmp_path_factory.mktemp("bake") / "shell", threads=1)


def same_tables(one, other):
    return all(getattr(one, name).equals(getattr(other, name)) for name in (*TABLES, *ROOM_TABLES)) and all(
        (one.folder / f"{name}.parquet").read_bytes() == (other.folder / f"{name}.parquet").read_bytes()
        for name in ("cells", "portals")
    )


def pairs(table, target):
    return set(zip(table["cell_id"].to_pylist(), table[target].to_pylist(), strict=True))


def check_two_sided(bake, rays):
    """Seen is in potential, cells see each other, rows are of inhabitable cells, and nothing refutes the bake."""
    inhabitable = bake.graph.inhabitable
    for table, target in ((bake.cell_to_cell, "reached_cell_id"), (bake.cell_to_object, "object_id")):
        every = pairs(table, target)
        assert len(every) == table.num_rows and pairs(visible_rows(table), target) <= every
        assert inhabitable[table["cell_id"].to_numpy()].all()
    both = bake.potential_cells[np.ix_(inhabitable, inhabitable)]
    np.testing.assert_array_equal(both, both.T, "A sees B exactly when B sees A")
    assert both.diagonal().all()
    result = bake.verify(rays=rays)
    assert result.wrong_hidden == 0 and result.refuted == 0, result.table()
    seen = sum(visible_rows(getattr(bake, name)).num_rows for name in TABLES)
    assert result.cell_witnesses.confirmed + result.object_witnesses.confirmed == seen
    return result


def test_office_is_two_sided(office_bake):
    check_two_sided(office_bake, rays=50_000)
    counts = office_bake.manifest["counts"]
    assert counts["cell_pairs_seen"] == counts["cell_pairs"]
    assert counts["object_pairs"] < 1.05 * counts["object_pairs_seen"]
    cell = int(np.flatnonzero(office_bake.graph.inhabitable)[0])
    assert set(office_bake.seen(cell)) <= set(office_bake.potential(cell))
    assert 0 < len(office_bake.potential(cell)) < counts["objects"]


def test_rooms_see_what_their_cells_see(office, office_bake):
    assert_room_sets(office_bake)
    rooms = office_bake.rooms
    assert rooms["name"].to_pylist() == [space.name for space in office.spaces] and rooms["claims_rooms"].to_pylist()
    # Every inhabitable cell belongs to the room that it is called after, and rooms do not see all of each other.
    names = office_bake.graph.cell_names
    assert {cell for own in rooms["cells"].to_pylist() for cell in own} == set(np.flatnonzero(names != "").tolist())
    for row in rooms.to_pylist():
        assert row["covered"] > 0.95 and {names[cell] for cell in row["cells"]} == {row["name"]}
    assert office_bake.room_to_room.num_rows < rooms.num_rows**2


def test_the_joins_of_the_guide_are_right(office_bake, tmp_path, monkeypatch):
    """The guide, run as it stands, against plain loops over the tables."""
    (tmp_path / "house.bake").symlink_to(office_bake.folder)
    monkeypatch.chdir(tmp_path)
    made = follow(ROOT / "docs/bim.md")
    names = office_bake.rooms["name"].to_pylist()
    objects, rows = office_bake.scene.objects, office_bake.room_to_object.to_pylist()
    own = Counter((objects[r["object_id"]].kind, r["verdict"]) for r in rows if names[r["room_id"]] == "1.101 office")
    assert own and Counter((row["kind"], row["verdict"]) for row in made["found"].to_pylist()) == own
    pairs = [(names[row["room_id"]], names[row["reached_room_id"]]) for row in office_bake.room_to_room.to_pylist()]
    reached = [(row["name"], row["reached"]) for row in made["named"].to_pylist()]
    assert reached and sorted(reached) == sorted((a, b) for a, b in pairs if a != b)
    doors = [(r["object_id"], names[r["room_id"]]) for r in rows if objects[r["object_id"]].kind == "IfcDoor"]
    assert doors and sorted((row["object_id"], row["room"]) for row in made["touched"].to_pylist()) == sorted(doors)


def test_rooms_of_a_bake_of_view_cells_claim_nothing_of_each_other(office, tmp_path):
    options = {"cells": "octree", "cell_size_m": 6.0, "depth": 0, "method": "occluders"}
    made = viewcell.bake(office, tmp_path / "views", settings=Settings(**options))
    assert_room_sets(made)
    assert not any(made.rooms["claims_rooms"].to_pylist()) and made.room_to_room.num_rows == made.rooms.num_rows**2
    # Cells reach over walls, so a room has more of them than it fills; all of it lies in some.
    assert min(made.rooms["covered"].to_pylist()) > 0.95


@pytest.mark.parametrize(("name", "rows"), [("office", None), ("w48", round(38.42857 * 182))])
def test_bare_graph_is_two_sided(name, rows, tmp_path):
    """As many pairs as an exact search finds, or were published."""
    folder = corridors.graph_folder(name, tmp_path)
    bake = viewcell.bake(folder, tmp_path / "made")
    check_two_sided(bake, rays=50_000)
    if name == "office":
        rows = int(random_buildings.reached_matrix(bake.graph)[bake.graph.inhabitable].sum())
    assert bake.cell_to_cell.num_rows == rows and bake.cell_to_object.num_rows == 0


@pytest.mark.parametrize(
    ("model", "threads", "block"),
    [("shell", 1, 24), ("shell", 2, 24), ("shell", 2, 1), ("shell", 1, 3), ("shell", 2, 5), ("office", 2, 3)],
)
def test_repeats_threads_and_blocks_change_nothing(model, threads, block, tmp_path, monkeypatch, request):
    scene, before = request.getfixturevalue(model), request.getfixturevalue(f"{model}_bake")
    monkeypatch.setattr(blocks, "BLOCK", block)
    assert same_tables(viewcell.bake(scene, tmp_path / "again", threads=threads), before)


@pytest.mark.parametrize("name", ["office", "w48"])
def test_bare_graph_repeats(name, tmp_path):
    folder = corridors.graph_folder(name, tmp_path)
    bakes = [viewcell.bake(folder, tmp_path / f"made {threads}", threads=threads) for threads in (1, 2)]
    assert same_tables(*bakes)


class Stopped(Exception):
    pass


def stop_after(count, monkeypatch):
    """Interrupt a bake before it saves one more block than so many."""
    save = blocks.Store.save
    left = [count]

    def counted(self, number, part):
        if not left[0]:
            raise Stopped
        left[0] -= 1
        save(self, number, part)

    monkeypatch.setattr(blocks.Store, "save", counted)


@pytest.mark.parametrize("lost", [None, 0, 1])
def test_resuming_equals_never_stopping(lost, shell, shell_bake, tmp_path, monkeypatch):
    """Stopped after two blocks; one of them is lost or cut short on top."""
    monkeypatch.setattr(blocks, "BLOCK", 3)
    with monkeypatch.context() as patch:
        stop_after(2, patch)
        with pytest.raises(Stopped):
            viewcell.bake(shell, tmp_path / "shell", threads=1)
    assert not (tmp_path / "shell").exists()
    partial = next(tmp_path.iterdir())
    if lost == 0:
        (partial / "0.arrow").unlink()
    if lost == 1:
        (partial / "1.arrow").write_bytes((partial / "1.arrow").read_bytes()[:100])
    assert same_tables(viewcell.bake(shell, tmp_path / "shell"), shell_bake)
    assert [path.name for path in tmp_path.iterdir()] == ["shell"]


def test_blocks_of_another_size_are_not_taken_for_ours(shell, shell_bake, tmp_path, monkeypatch):
    """What an older version left behind may be cut into blocks differently."""
    monkeypatch.setattr(blocks, "BLOCK", 3)
    with monkeypatch.context() as patch:
        stop_after(2, patch)
        with pytest.raises(Stopped):
            viewcell.bake(shell, tmp_path / "shell", threads=1)
    monkeypatch.setattr(blocks, "BLOCK", 5)
    assert same_tables(viewcell.bake(shell, tmp_path / "shell"), shell_bake)


def test_blocks_of_other_settings_are_not_taken_for_ours(shell, shell_bake, tmp_path, monkeypatch):
    """A bake that was stopped does not go on as one of other settings."""
    monkeypatch.setattr(blocks, "BLOCK", 3)
    with monkeypatch.context() as patch:
        stop_after(2, patch)
        with pytest.raises(Stopped):
            viewcell.bake(shell, tmp_path / "shell", threads=1)
    wanted, made = (
        viewcell.bake(shell, tmp_path / name, settings=Settings(seed=5), threads=1) for name in ("whole", "shell")
    )
    assert not same_tables(wanted, shell_bake) and same_tables(made, wanted)


def test_no_budget_leaves_everything_unknown(office, tmp_path):
    bake = viewcell.bake(office, tmp_path / "office", budget_s=1e-6)
    cells, objects = bake.graph.cell_count, bake.manifest["counts"]["objects"]
    sources = int(bake.graph.inhabitable.sum())
    assert bake.cell_to_cell.num_rows == sources * cells and bake.cell_to_object.num_rows == sources * objects
    for name in TABLES:
        assert set(getattr(bake, name)["verdict"].to_pylist()) == {"unknown"}
    assert check_two_sided(bake, rays=20_000).ok


def test_what_is_seen_at_a_glance_is_kept_when_the_budget_ends(office, office_bake, tmp_path, monkeypatch):
    """Nothing else is done: all is kept, and much of it is known to be seen."""
    monkeypatch.setattr(PortalEngine, "visible", lambda engine, block, aim=True: engine.unknown(block))
    bake = viewcell.bake(office, tmp_path / "office", budget_s=60.0)
    seen = pc.sum(pc.equal(bake.cell_to_object["verdict"], "visible")).as_py()
    whole = office_bake.manifest["counts"]["object_pairs_seen"]
    assert bake.potential_objects.sum() == bake.potential_objects[bake.graph.inhabitable].size
    assert 0.5 * whole < seen <= bake.manifest["counts"]["object_pairs_seen"] <= 1.01 * whole
    assert check_two_sided(bake, rays=20_000).ok


def test_a_spent_budget_is_made_up_for(shell, shell_bake, tmp_path):
    """A bake that ran out of time is not taken for a finished one."""
    viewcell.bake(shell, tmp_path / "shell", budget_s=1e-6)
    assert same_tables(viewcell.bake(shell, tmp_path / "shell"), shell_bake)


def test_a_finished_bake_is_kept_and_a_changed_one_is_not(shell, shell_bake, tmp_path):
    first = viewcell.bake(shell, tmp_path / "shell")
    path = first.folder / "manifest.json"
    stamp = path.stat().st_mtime_ns
    viewcell.bake(shell, tmp_path / "shell")
    assert path.stat().st_mtime_ns == stamp
    with pytest.raises(InputError, match="expected a bake of this model with these settings, found one with seed 0;"):
        viewcell.bake(shell, tmp_path / "shell", settings=Settings(seed=5))
    assert path.stat().st_mtime_ns == stamp
    other = viewcell.bake(shell, tmp_path / "shell", settings=Settings(seed=5), overwrite=True)
    assert path.stat().st_mtime_ns != stamp and other.manifest["settings"]["seed"] == 5
    assert pairs(load(tmp_path / "shell").cell_to_cell, "reached_cell_id") == pairs(
        shell_bake.cell_to_cell, "reached_cell_id"
    )


def small_scene():
    """Two solids, a room and a hole."""
    return replace(random_buildings.two_solids(), openings=np.array([[[0.0, 0.5, 0.5], [0.1, 1.0, 1.0]]]))


def with_mesh(scene, **changes):
    shape = scene.definitions[0]
    return replace(
        scene, definitions=[replace(shape, lods=(replace(shape.lods[0], **changes),)), *scene.definitions[1:]]
    )


def with_first(scene, of, **changes):
    first, *rest = getattr(scene, of)
    return replace(scene, **{of: [replace(first, **changes), *rest]})


INGREDIENTS = {
    "corners": lambda s: with_mesh(s, vertices=s.definitions[0].lods[0].vertices * 1.5),
    "faces": lambda s: with_mesh(s, faces=s.definitions[0].lods[0].faces[::-1]),
    "error": lambda s: with_mesh(s, error_m=0.25),
    "name": lambda s: with_first(s, "objects", name="else"),
    "kind": lambda s: with_first(s, "objects", kind="else"),
    "shape": lambda s: with_first(s, "objects", definition_id=1),
    "role": lambda s: with_first(s, "objects", role=Role.DETAIL),
    "place": lambda s: with_first(s, "objects", transform=s.objects[0].transform + np.eye(4, k=3)),
    "order": lambda s: replace(s, objects=s.objects[::-1]),
    "room's name": lambda s: with_first(s, "spaces", name="else"),
    "room": lambda s: with_first(s, "spaces", vertices=s.spaces[0].vertices * 0.5),
    "room's faces": lambda s: with_first(s, "spaces", faces=s.spaces[0].faces[::-1]),
    "openings": lambda s: replace(s, openings=s.openings + 0.125),
    "grid": lambda s: replace(s, grid_m=s.grid_m / 2),
    "origin": lambda s: replace(s, origin=np.array([16.0, 0, 0])),
}


@pytest.fixture(scope="module")
def small_bake(tmp_path_factory):
    return viewcell.bake(small_scene(), tmp_path_factory.mktemp("small") / "small", threads=1)


@pytest.fixture
def asked_again(small_bake, tmp_path, monkeypatch):
    """What a bake to where a finished one is comes to: it is kept, refused, or begun anew."""
    out = Path(shutil.copytree(small_bake.folder, tmp_path / "small"))

    class BegunError(Exception):
        pass

    def begin(*_):
        raise BegunError

    def ask(scene, overwrite=False, **changes):
        monkeypatch.setattr(baking, "PreparedModel", begin)
        before = (out / "manifest.json").stat().st_mtime_ns
        try:
            viewcell.bake(scene, out, settings=Settings(**changes), threads=1, overwrite=overwrite)
        except BegunError:
            return "begun"
        except InputError as error:
            assert "--overwrite" in str(error) and (out / "manifest.json").stat().st_mtime_ns == before
            return "refused"
        return "kept"

    return ask


@pytest.mark.parametrize("part", INGREDIENTS)
def test_a_bake_of_another_model_is_not_kept(part, asked_again):
    other = INGREDIENTS[part](small_scene())
    assert [asked_again(scene) for scene in (small_scene(), other)] == ["kept", "refused"]
    assert asked_again(other, overwrite=True) == "begun"


OTHER = {
    "threshold_m2": 0.5, "seed": 1, "doors": "closed", "method": "both", "cells": "octree", "cell_size_m": 2.0,
    "depth": 1, "refine_triangles": 7, "refine_gap": 0.5, "refine_kept": 2.0, "largest_cell": 3.0, "certify": True,
    "clusters": 6, "objective": "centre", "resolution": 64, "split": True, "lods": True, "pixels": 2.0,
    "image": "64x64", "fov_deg": 70.0, "seal": 0.01, "yaw": "17", "glass": "pane", "doors_by": "gate",
    "leave_out": "tree",
}  # fmt: skip


@pytest.mark.parametrize("name", [field.name for field in fields(Settings)])
def test_a_bake_of_other_settings_is_not_kept(name, asked_again):
    assert asked_again(small_scene(), **{name: OTHER[name]}) == "refused"
    assert asked_again(small_scene(), overwrite=True, **{name: OTHER[name]}) == "begun"


def test_a_bake_of_another_version_is_not_kept(asked_again, monkeypatch):
    monkeypatch.setattr(manifest, "__version__", "0.0.0-else")
    monkeypatch.setattr(place, "__version__", "0.0.0-else")
    assert asked_again(small_scene()) == "refused" and asked_again(small_scene(), overwrite=True) == "begun"


@pytest.mark.parametrize("name", ["cells", "portals"])
def test_a_bake_of_a_graph_that_was_changed_is_not_kept(name, tmp_path):
    """Under the same name."""
    folder = corridors.write_graph(corridors.corridor(4), tmp_path / "graph")
    first = viewcell.bake(folder, tmp_path / "b", threads=1)
    assert viewcell.bake(folder, tmp_path / "b", threads=1).manifest == first.manifest
    table = pq.read_table(folder / f"{name}.parquet")
    pq.write_table(table, folder / f"{name}.parquet", compression="none")
    with pytest.raises(InputError, match="another model, or of an earlier state of it"):
        viewcell.bake(folder, tmp_path / "b", threads=1)
    again = viewcell.bake(folder, tmp_path / "b", threads=1, overwrite=True)
    assert again.manifest["fingerprint"] != first.manifest["fingerprint"]


def test_a_bake_of_view_cells_that_were_changed_is_not_kept(tmp_path):
    cells, scene = tmp_path / "cells.csv", small_scene()
    settings = Settings(method="occluders", cells=str(cells))
    for low in (0.25, 0.5):
        cells.write_text(f"min_x,min_y,min_z,max_x,max_y,max_z\n{low},0.5,0.5,0.75,1,1\n")
        if low == 0.5:
            with pytest.raises(InputError, match="--overwrite"):
                viewcell.bake(scene, tmp_path / "b", settings=settings, threads=1)
        made = viewcell.bake(scene, tmp_path / "b", settings=settings, threads=1, overwrite=low == 0.5)
        assert made.graph.cells[0, 0, 0] == low * METRE


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"budget_s": -1.0}, "budget"),
        ({"budget_s": float("nan")}, "budget"),
        ({"threads": 0}, "threads"),
        ({"device": "abacus"}, "device"),
        ({"settings": Settings(threshold_m2=-1.0)}, "threshold"),
        ({"settings": Settings(threshold_m2=float("inf"))}, "threshold"),
        ({"settings": Settings(seal=-0.1)}, "seal"),
        ({"settings": Settings(refine_kept=-1.0)}, "refine-kept"),
        ({"settings": Settings(refine_kept=0.5)}, "refine-kept"),
        ({"settings": Settings(refine_kept=2.0, cells="octree")}, "refine-kept"),
        ({"settings": Settings(method="occluders", cells="portals")}, "cells"),
        # What a scene was not read with, it would do without in silence.
        ({"doors": "closed"}, "doors"),
        ({"glass": "curtain"}, "glass"),
    ],
)
def test_bad_arguments_are_one_line(options, message, office, tmp_path):
    with pytest.raises(InputError, match=f"^{message}: expected") as told:
        viewcell.bake(office, tmp_path / "office", **options)
    assert "\n" not in str(told.value) and list(tmp_path.iterdir()) == []


def random_scene(seed):
    """A hall of 6 x 6 x 3 m with thin walls, solid blocks, slanted solids and furniture."""
    rng = np.random.default_rng(seed)
    size = np.array([6, 6, 3]) * METRE
    parts = [(box((-200, -200, -200), (*(size[:2] + 200), 0)), "occluder")]
    for axis, side in ((0, 0), (0, 1), (1, 0), (1, 1)):
        low, high = np.array([-200, -200, 0]), np.array([*(size[:2] + 200), size[2]])
        low[axis] = (-200, size[axis])[side]
        high[axis] = (0, size[axis] + 200)[side]
        parts.append((box(low, high), "occluder"))
    for _ in range(4):
        low = rng.integers(0, size - METRE) // 128 * 128
        axis = rng.integers(0, 2)
        high = np.minimum(low + rng.integers(2, 4, 3) * METRE, size)
        high[axis] = low[axis] + 128
        parts.append((box(low, high), "occluder"))
    for role in ("occluder", "occluder", "detail", "transparent"):
        parts.append((tetrahedron(rng.integers(0, size, (4, 3))), role))
    for _ in range(3):
        low = rng.integers(0, size - METRE)
        parts.append((box(low, low + rng.integers(200, 900, 3)), "detail"))
    sheet = box((0, 0, 0), (1, 1, 1))[:2] * np.array([1, 2 * METRE, 2 * METRE]) + np.array([3 * METRE, 2 * METRE, 0])
    parts.append((sheet, "occluder"))
    return scene_of(parts, [((0, 0, 0), tuple(size))])


def brute_force(bake, rng, count):
    """Random segments that start in inhabitable cells, with the exact verdict of what they meet.

    Yields the source and the target cell of clear ones, and the source and the object of those that end on an object.
    """
    scene, cells = bake.scene, bake.graph.cells
    triangles, owners = scene.triangles()
    opaque = scene.object_mask(Role.OCCLUDER, Role.DETAIL)[owners]
    lines = Sightlines(triangles[opaque], owners[opaque])

    def points(chosen):
        share = rng.uniform(0.01, 0.99, (count, 3))
        return cells[chosen, 0] + share * (cells[chosen, 1] - cells[chosen, 0])

    sources = rng.choice(np.flatnonzero(bake.graph.inhabitable), count)
    targets = rng.integers(0, len(cells), count)
    origins = points(sources)
    free = lines.outside_solids(origins)
    clear = free & (lines.check(origins, points(targets)) == Sight.CLEAR)
    picked = rng.integers(0, len(triangles), count)
    weight = rng.dirichlet((1, 1, 1), count)
    # A hair in front of the surface, so that the object does not hide itself.
    ends = (weight[:, :, None] * triangles[picked]).sum(axis=1)
    ends = ends + (origins - ends) * 1e-6
    shown = free & (lines.check(origins, ends) == Sight.CLEAR)
    return sources[clear], targets[clear], sources[shown], owners[picked][shown]


@pytest.mark.parametrize("threshold_m2", [0.0, 2.0])
@pytest.mark.parametrize("seed", range(4))
def test_what_brute_force_sees_is_potential(seed, threshold_m2, tmp_path):
    """Trap: a threshold above 0 leaves walls out of the cells, and the answer must stay conservative."""
    scene = random_scene(seed)
    bake = viewcell.bake(scene, tmp_path / "hall", settings=Settings(threshold_m2=threshold_m2))
    a, b, c, d = brute_force(bake, np.random.default_rng(seed), 20_000)
    assert len(a) > 300 and len(c) > 300
    missed = ~bake.potential_cells[a, b]
    assert not missed.any(), f"wrong-hidden cells {a[missed][:3]} to {b[missed][:3]}"
    missed = ~bake.potential_objects[c, d]
    assert not missed.any(), f"wrong-hidden objects {d[missed][:3]} from cells {c[missed][:3]}"
    check_two_sided(bake, rays=20_000)


def two_rooms(screen, role="detail"):
    """Two rooms joined by a doorway, and something in the doorway."""
    m = METRE
    parts = [
        (box((-100, -100, -100), (4 * m + 100, 2 * m + 100, 0)), "occluder"),
        (box((-100, -100, 2 * m), (4 * m + 100, 2 * m + 100, 2 * m + 100)), "occluder"),
        (box((-100, -100, 0), (0, 2 * m + 100, 2 * m)), "occluder"),
        (box((4 * m, -100, 0), (4 * m + 100, 2 * m + 100, 2 * m)), "occluder"),
        (box((0, -100, 0), (4 * m, 0, 2 * m)), "occluder"),
        (box((0, 2 * m, 0), (4 * m, 2 * m + 100, 2 * m)), "occluder"),
        (box((2 * m, 0, 0), (2 * m + 100, 900, 2 * m)), "occluder"),
        (box((2 * m, 1100, 0), (2 * m + 100, 2 * m, 2 * m)), "occluder"),
        (screen, role),
    ]
    return scene_of(parts, [((0, 0, 0), (2 * m, 2 * m, 2 * m)), ((2 * m + 100, 0, 0), (4 * m, 2 * m, 2 * m))])


def room_pair(bake):
    """Verdict of the pair of largest cells of the two rooms, or None if hidden."""
    cells = bake.graph.cells.astype(np.int64)
    volume = np.prod(cells[:, 1] - cells[:, 0], axis=1)
    sides = [cells[:, 1, 0] <= 2 * METRE, cells[:, 0, 0] >= 2 * METRE + 100]
    one, other = (int(np.where(bake.graph.inhabitable & side, volume, 0).argmax()) for side in sides)
    table = bake.cell_to_cell
    row = (table["cell_id"].to_numpy() == one) & (table["reached_cell_id"].to_numpy() == other)
    return table["verdict"].to_pylist()[int(np.flatnonzero(row)[0])] if row.any() else None


def test_trap_line_through_an_oblique_solid_is_not_seen(tmp_path):
    """The portals allow the line; a slanted closed solid fills the doorway, so no line passes and none is claimed."""
    m = METRE
    prism = np.array([(1700, 800), (2400, 600), (2500, 1300), (1800, 1400)])
    flat = [[(x, y, z) for x, y in prism] for z in (-50, 2 * m + 50)]
    low, high = np.array(flat)
    triangles = [low[[0, 2, 1]], low[[0, 3, 2]], high[[0, 1, 2]], high[[0, 2, 3]]]
    for n in range(4):
        k = (n + 1) % 4
        triangles += [np.array([low[n], low[k], high[k]]), np.array([low[n], high[k], high[n]])]
    blocked = viewcell.bake(two_rooms(np.array(triangles)), tmp_path / "blocked")
    assert room_pair(blocked) != "visible"
    check_two_sided(blocked, rays=20_000)
    away = np.array(triangles) * [1, 1, 0.01] + [0, 0, 1900]
    passed = viewcell.bake(two_rooms(away.astype(int)), tmp_path / "open")
    assert room_pair(passed) == "visible"


def test_trap_axial_screen_hides(tmp_path):
    blocked = viewcell.bake(
        two_rooms(box((2010, 0, 0), (2020, 2 * METRE, 2 * METRE)), "occluder"), tmp_path / "blocked"
    )
    assert room_pair(blocked) is None
    check_two_sided(blocked, rays=20_000)


def test_trap_witness_starts_outside_every_solid(tmp_path):
    """A cell that holds a slanted solid: every witness from it starts beside the solid, not in it."""
    solid = tetrahedron([(100, 100, 0), (1900, 200, 0), (300, 1900, 0), (500, 500, 1900)])
    bake = viewcell.bake(two_rooms(solid), tmp_path / "rooms")
    triangles, owners = bake.scene.triangles()
    lines = Sightlines(triangles, owners)
    for name in TABLES:
        rows = visible_rows(getattr(bake, name))
        origins = np.column_stack([rows[f"origin_{axis}"].to_numpy() for axis in "xyz"]) / bake.grid_m
        assert len(origins) > 5 and lines.outside_solids(origins).all()
    held = ~lines.outside_solids(np.random.default_rng(0).uniform(100, 1800, (4000, 3)))
    assert held.mean() > 0.1, "the solid is too small to be a trap"


def test_verify_refutes_a_bake_with_a_row_taken_out(office_bake, tmp_path):
    """The check that the tests above rely on does see a wrong-hidden."""
    spoiled = load(office_bake.folder)
    table = spoiled.cell_to_object
    cell = int(table["cell_id"][0].as_py())
    kept = table["cell_id"].to_numpy() != cell
    assert spoiled.scene is not None and spoiled.potential_cells.any()
    spoiled.__dict__["cell_to_object"] = table.filter(kept)
    spoiled.folder = tmp_path / "spoiled"
    assert spoiled.verify(rays=20_000).wrong_hidden == 1


@pytest.mark.slow
def test_shared_duplex(tmp_path):
    folder = SHARED / "scenes" / "ifc" / "duplex_A"
    if not folder.is_dir():
        pytest.skip("needs duplex_A of the shared scenes folder")
    model = next(path for path in sorted(folder.iterdir()) if path.suffix.lower() == ".ifc")
    bake = viewcell.bake(model, tmp_path / "duplex")
    result = check_two_sided(bake, rays=1_000_000)
    inhabitable, _, objects = result.counts
    print(f"overestimate: cells {inhabitable.overestimate:.3f}, objects {objects.overestimate:.3f}")
    # Two stairwells and the roof are view cells too: of their pairs more are open than elsewhere.
    assert inhabitable.overestimate < 1.2 and objects.overestimate < 1.15
    assert_room_sets(bake)
    foyer = bake.rooms.to_pylist()[bake.rooms["name"].to_pylist().index("A101")]
    assert (foyer["long_name"], foyer["guid"], foyer["storey"]) == ("Foyer", "0BTBFw6f90Nfh9rP1dlXrr", "Level 1")
    again = viewcell.bake(model, tmp_path / "again", threads=1)
    assert same_tables(again, bake)
