from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import trimesh
import viewcell
from viewcell.data import lod
from viewcell.data.buildings.office import make_office
from viewcell.data.errors import InputError
from viewcell.data.lod import drawn_bounds, object_errors, simplified, split_components, watertight, welded
from viewcell.data.scene import GRID_M, Definition, Instance, Mesh, Role, Scene
from viewcell.data.store.database import CELL_LODS
from viewcell.kernels.deviation import launch_deviation
from viewcell.solvers.levels import chain as chains
from viewcell.solvers.levels.chain import lod_chain, with_lods
from viewcell.solvers.levels.pixel_error import PixelLimit
from viewcell.workbench.bake.run import Settings
from viewcell.workbench.cli import main


def mesh(shape, move=(0, 0, 0)):
    return Mesh(np.round((np.array(shape.vertices) + move) / GRID_M) * GRID_M, np.array(shape.faces, np.int32))


def joined(*parts):
    starts = np.cumsum([0, *[len(part.vertices) for part in parts]])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return Mesh(np.concatenate([part.vertices for part in parts]), np.concatenate(faces).astype(np.int32))


def box(low, high, inwards=False):
    made = trimesh.creation.box(bounds=[low, high])
    made = mesh(made)
    return replace(made, faces=made.faces[:, ::-1]) if inwards else made


def soup(mesh):
    """Every triangle with corners of its own."""
    return Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size, dtype=np.int32).reshape(-1, 3))


BALL = mesh(trimesh.creation.icosphere(subdivisions=2))
RING = mesh(trimesh.creation.torus(1.0, 0.3, major_sections=20, minor_sections=12))
BOWL = replace(BALL, faces=BALL.faces[BALL.vertices[BALL.faces].mean(axis=1)[:, 2] < 0.3])
# Two balls that share a vertex, one edge with three triangles, and a heap of 40 boxes.
PINCHED = joined(BALL, replace(BALL, vertices=BALL.vertices + BALL.vertices[0] - BALL.vertices[5]))
FIN = joined(BALL, Mesh(np.vstack([BALL.vertices[BALL.faces[0][:2]], [[0, 0, 2.0]]]), np.array([[0, 1, 2]], np.int32)))
HEAP = joined(*[box([i % 7, i % 5, i], [i % 7 + 2, i % 5 + 1.5, i + 0.5]) for i in range(40)])
MESHES = {"ball": BALL, "ring": RING, "bowl": BOWL, "pinched": PINCHED, "fin": FIN, "heap": HEAP, "soup": soup(RING)}


def corners(level):
    return level.vertices[level.faces]


def scene_of(*shapes, transforms=None):
    transforms = transforms or [np.eye(4)] * len(shapes)
    definitions = [Definition(f"shape {i}", (shape,)) for i, shape in enumerate(shapes)]
    objects = [Instance(f"thing {i}", "thing", i, t, Role.DETAIL) for i, t in enumerate(transforms)]
    return Scene(definitions, objects)


@pytest.mark.parametrize("name", MESHES)
def test_levels_halve_stay_within_their_error_and_stay_watertight(name):
    chain = lod_chain(MESHES[name])
    finest, *coarser = chain.levels
    assert finest is not None and np.array_equal(finest.vertices, MESHES[name].vertices) and finest.error_m == 0
    counts = [len(level.faces) for level in chain.levels]
    assert coarser and all(b <= 0.75 * a for a, b in pairwise(counts))
    assert counts[-1] <= 100 and not chain.ended
    errors = [level.error_m for level in chain.levels]
    assert errors == sorted(errors) and errors[1] > 0
    assert chain.watertight == (name not in ("bowl", "fin"))
    for level, low in zip(coarser, chain.lower_m[1:], strict=True):
        assert np.array_equal(level.vertices, level.vertices.astype(np.float32))
        assert watertight(welded(level, "level")) or not chain.watertight
        found = launch_deviation(corners(welded(finest, "")), corners(level))
        assert found.lower.max() <= level.error_m and low <= found.upper.max()


@pytest.mark.parametrize("name", ["ball", "bowl", "heap"])
def test_no_sampled_point_is_farther_than_error_m(name):
    assert_samples_within(lod_chain(MESHES[name]).levels, 150)


def assert_samples_within(levels, count):
    rng = np.random.default_rng(0)
    for level in levels[1:]:
        for one, two in ((levels[0], level), (level, levels[0])):
            a, b = corners(one), corners(two)
            weights = rng.dirichlet((0.4, 0.4, 0.4), count)
            points = np.einsum("nk,nkc->nc", weights, a[rng.integers(0, len(a), count)])
            best = np.full(count, np.inf)
            for k, point in enumerate(points):
                nearest = trimesh.triangles.closest_point(b, np.repeat(point[None], len(b), axis=0))
                best[k] = np.linalg.norm(nearest - point, axis=1).min()
            assert best.max() <= level.error_m


@pytest.mark.slow
def test_no_sampled_point_is_farther_on_the_shapes_of_soda_hall():
    office = make_office(like="soda-hall")
    for shape in office.definitions:
        assert_samples_within(lod_chain(shape.lods[0]).levels, 2000)


def test_chains_are_the_same_every_time():
    scene = scene_of(BALL, FIN, HEAP)
    (one, notes), (two, again) = (with_lods(scene, threads=n) for n in (1, 3))
    assert notes == again and {note["what"] for note in notes} == {"shape 1"}
    for a, b in zip(one.definitions, two.definitions, strict=True):
        assert len(a.lods) == len(b.lods) > 1
        for x, y in zip(a.lods, b.lods, strict=True):
            assert np.array_equal(x.vertices, y.vertices) and np.array_equal(x.faces, y.faces)
            assert x.error_m == y.error_m


def test_definitions_that_have_levels_keep_them():
    scene = scene_of(BALL)
    given = Definition("given", (BALL, replace(RING, error_m=0.5)))
    scene.definitions[0] = given
    assert with_lods(scene)[0].definitions[0] is given


def test_a_small_mesh_is_its_own_chain():
    chain = lod_chain(box([0, 0, 0], [1, 1, 1]))
    assert len(chain.levels) == 1 and not chain.ended


def test_a_level_that_loses_watertightness_is_refused(monkeypatch):
    def torn(mesh, target, original=simplified):
        return [replace(level, faces=level.faces[1:]) for level in original(mesh, target)]

    monkeypatch.setattr(chains, "simplified", torn)
    chain = lod_chain(BALL)
    assert len(chain.levels) == 1 and chain.ended == f"nothing simpler found below {len(BALL.faces)} triangles"
    assert len(lod_chain(BOWL).levels) > 1


def test_errors_do_not_fall_along_a_chain(monkeypatch):
    errors = iter([0.5, 0.25, 0.75, 0.1, 0.1, 0.1])

    def best(finest, surface, count, closed, device):
        return replace(BALL, faces=BALL.faces[: count // 2], error_m=next(errors)), 0.0

    monkeypatch.setattr(chains, "_best", best)
    assert [level.error_m for level in lod_chain(BALL, coarsest=40).levels] == [0, 0.5, 0.5, 0.75]


def test_meshes_without_surface_are_kept_and_told():
    empty = Mesh(np.zeros((3, 3)), np.zeros((0, 3), np.int32))
    line = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.array([[0, 1, 2]] * 200, np.int32))
    for shape in (empty, line):
        chain = lod_chain(shape)
        assert len(chain.levels) == 1 and chain.ended == "no triangle that has an area"
    _, notes = with_lods(scene_of(empty, BALL))
    assert notes == [{"what": "shape 0", "why": "no triangle that has an area"}]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"vertices": np.full((3, 3), np.nan)}, "definition 0 'shape 0': expected finite"),
        ({"vertices": np.zeros((2, 3))}, "definition 0 'shape 0': expected vertex indices below 2"),
    ],
)
def test_broken_meshes_are_told_in_one_line(change, said):
    broken = replace(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32)), **change)
    for function in (with_lods, split_components):
        with pytest.raises(InputError, match=said):
            function(scene_of(broken))


def test_clustering_keeps_closed_surfaces_closed(monkeypatch):
    monkeypatch.setattr(lod, "AGGRESSIVENESS", ())
    for name in ("ball", "ring", "heap", "soup"):
        (made,) = simplified(welded(MESHES[name], name), 60)
        assert 0 < len(made.faces) <= 60 and watertight(made)


def test_components_become_objects_that_share_definitions():
    pair = joined(box([0, 0, 0], [1, 1, 1]), box([5, 0, 0], [6, 1, 1]))
    moved = np.eye(4)
    moved[:3, 3] = [0, 8, 0]
    scene = scene_of(pair, BALL, transforms=[np.eye(4), moved])
    scene.objects.append(replace(scene.objects[0], name="another", transform=moved))
    made = split_components(scene)
    assert [shape.name for shape in made.definitions] == ["shape 0 #0", "shape 0 #1", "shape 1"]
    names = [placed.name for placed in made.objects]
    assert names == ["thing 0 #0", "thing 0 #1", "thing 1", "another #0", "another #1"]
    assert [placed.definition_id for placed in made.objects] == [0, 1, 2, 0, 1]
    assert all(watertight(welded(shape.lods[0], "")) for shape in made.definitions)
    before, after = (np.unique(x.triangles()[0].reshape(-1, 9), axis=0) for x in (scene, made))
    assert np.array_equal(before, after)


def test_triangles_are_connected_by_position():
    assert len(split_components(scene_of(soup(RING))).definitions) == 1


def test_a_hollow_solid_stays_one_object():
    # Its inner shell alone, or its outer, would be solid all through, and hide what is in the cavity.
    shells = box([0, 0, 0], [4, 4, 4]), box([1, 1, 1], [3, 3, 3], inwards=True)
    apart = box([9, 0, 0], [10, 1, 1])
    torn = replace(shells[1], faces=shells[1].faces[2:])
    for inner in (shells[1], torn):
        made = split_components(scene_of(joined(shells[0], inner, apart)))
        assert [len(shape.lods[0].faces) for shape in made.definitions] == [12 + len(inner.faces), 12]


def test_definitions_with_levels_are_not_split():
    pair = joined(box([0, 0, 0], [1, 1, 1]), box([5, 0, 0], [6, 1, 1]))
    scene = scene_of(pair)
    scene.definitions[0] = Definition("given", (pair, box([0, 0, 0], [6, 1, 1])))
    assert split_components(scene).definitions == scene.definitions


def turned(scale):
    """A rotation, stretched along one axis."""
    matrix = np.eye(4)
    matrix[:3, :3] = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])[:3, :3] @ np.diag([1, scale, 1])
    return matrix


def test_drawn_bounds_hold_every_level():
    scene, _ = with_lods(scene_of(BALL, RING, transforms=[turned(3.0), turned(0.5)]))
    for levels in (None, np.array([1, 1]), np.array([0, -1])):
        bounds = drawn_bounds(scene, levels)
        for object_id, placed in enumerate(scene.objects):
            last = len(scene.definitions[placed.definition_id].lods) - 1
            level = last if levels is None or levels[object_id] < 0 else levels[object_id]
            world = scene.world_vertices(object_id, level)
            assert (bounds[object_id, 0] <= world.min(axis=0)).all() and (
                world.max(axis=0) <= bounds[object_id, 1]
            ).all()
    assert (drawn_bounds(scene)[:, 1] > drawn_bounds(scene, np.zeros(2, int))[:, 1]).all()
    with pytest.raises(InputError, match="levels"):
        drawn_bounds(scene, np.array([99, 0]))


def test_deviations_are_stretched_by_transforms():
    scene, _ = with_lods(scene_of(BALL, BALL, transforms=[turned(3.0), turned(0.5)]))
    errors, starts = object_errors(scene)
    levels = np.array([level.error_m for level in scene.definitions[0].lods])
    assert np.allclose(errors[starts[0] : starts[1]], 3 * levels, rtol=1e-9)
    assert np.allclose(errors[starts[1] : starts[2]], levels, rtol=1e-9)
    for object_id, placed in enumerate(scene.objects):
        shape = [mesh.vertices @ placed.transform[:3, :3].T for mesh in scene.definitions[object_id].lods]
        faces = [mesh.faces for mesh in scene.definitions[object_id].lods]
        found = launch_deviation(shape[0][faces[0]], shape[-1][faces[-1]])
        assert found.lower.max() <= errors[starts[object_id + 1] - 1]


@pytest.fixture(scope="module")
def office():
    """A small office whose furniture has one level."""
    scene = make_office(floors=1, rooms_per_side=3)
    return replace(scene, definitions=[Definition(shape.name, shape.lods[:1]) for shape in scene.definitions])


@pytest.fixture(scope="module")
def bakes(office, tmp_path_factory):
    folder = tmp_path_factory.mktemp("lods")
    settings = Settings(lods=True, image="320x200", pixels=2.0)
    plain = viewcell.bake(office, folder / "plain", settings=Settings())
    return plain, viewcell.bake(office, folder / "lods", settings=settings), settings


def test_levels_change_no_set(bakes):
    plain, made, _ = bakes
    assert made.cell_to_object.equals(plain.cell_to_object)
    assert made.cell_to_cell.equals(plain.cell_to_cell)
    assert plain.cell_lods.num_rows == 0 and plain.cell_lods.column_names == list(CELL_LODS)


def test_the_bake_holds_levels_and_where_they_do(bakes):
    _, made, settings = bakes
    scene, limit = made.scene, settings.pixel_limit
    assert limit == PixelLimit(2.0, (320, 200), 60.0)
    assert any(len(shape.lods) > 2 for shape in scene.definitions)
    for key in ("pixels", "image", "fov_deg"):
        assert made.manifest["settings"][key] == getattr(settings, key)
    assert made.manifest["lod_notes"] == []
    rows = np.column_stack([made.cell_lods[name].to_numpy() for name in CELL_LODS])
    assert len(rows) and (rows[:, 2] > 0).all()
    errors, starts = object_errors(scene)
    cells, boxes = made.graph.cells * GRID_M, scene.object_bounds() * GRID_M
    for cell, item, level in rows:
        assert made.potential_objects[cell, item]
        error = errors[starts[item] : starts[item + 1]][level]
        apart = np.maximum(boxes[item, 0] - cells[cell, 1], cells[cell, 0] - boxes[item, 1])
        assert error <= limit.deviation_per_distance * np.linalg.norm(np.maximum(apart - error, 0))


def test_splitting_on_the_command_line(office, tmp_path, capsys):
    from viewcell.data.store.scene_folder import write_scene

    write_scene(office, tmp_path / "office.scene")
    asked = ["bake", str(tmp_path / "office.scene"), "--out", str(tmp_path / "out"), "--no-progress"]
    assert main([*asked, "--split", "--lods", "--resolution", "640x480", "--fov", "50", "--pixels", "3"]) == 0
    made = viewcell.load(tmp_path / "out")
    assert len(made.scene.objects) > len(office.objects)
    assert made.manifest["settings"]["image"] == "640x480" and made.manifest["settings"]["fov_deg"] == 50
    capsys.readouterr()
    for more, said in (
        (["--resolution", "640"], "resolution: expected WIDTHxHEIGHT in pixels, found '640'"),
        (["--fov", "180"], "fov: expected degrees above 0 and below 180, found 180.0"),
        (["--pixels", "0"], "pixels: expected a number above 0, found 0.0"),
    ):
        assert main([*asked, *more]) == 2
        assert capsys.readouterr().err == f"viewcell: {said}\n"


def test_a_bare_graph_has_nothing_to_simplify(graph, tmp_path):
    for option in ("lods", "split"):
        with pytest.raises(InputError, match="expected a model to split or to simplify, found a bare graph"):
            viewcell.bake(graph, tmp_path / "out", settings=Settings(**{option: True}))
