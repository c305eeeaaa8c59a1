"""Chains of levels: each within its error, watertight where the mesh is, the same every time."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import trimesh
from builders.shapes import BALL, BOWL, FIN, HEAP, MESHES, RING, box, corners, scene_of
from viewcell.data.buildings.office import make_office
from viewcell.data.lod import simplified, watertight, welded
from viewcell.data.scene import Definition, Mesh
from viewcell.kernels.deviation import launch_deviation
from viewcell.kernels.launch import Device
from viewcell.solvers.levels import chain as chains
from viewcell.solvers.levels.chain import lod_chain, with_lods


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
    (one, notes), (two, again) = (with_lods(scene, device=Device(threads=n)) for n in (1, 3))
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
