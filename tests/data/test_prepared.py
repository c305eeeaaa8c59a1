"""A model prepared once: each part is made once, from the right triangles, and names what it is made of."""

from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import trimesh
from builders import random_solids, small_house
from builders.clocks import lots_take
from viewcell.data import prepared, rasters
from viewcell.data.buildings.arcade import ARCH_M, BAY_M, SPRING_M, make_arcade
from viewcell.data.buildings.shell import OUTER_WALL_M
from viewcell.data.patches import find_patches
from viewcell.data.prepared import PreparedModel, no_patches
from viewcell.data.regions import no_regions
from viewcell.data.scene import GRID_M, OPAQUE, Definition, Instance, Mesh, Role, Scene
from viewcell.verify.proofs.opaque import bounds_disc


def slanted(size, at=(0.0, 0.0, 0.0)):
    """Two triangles of an oblique square [m]."""
    corners = np.array([[0, 0, 0], [1, 0, 0.5], [1, 1, 0.5], [0, 1, 0]]) * size + np.array(at)
    return corners[[0, 1, 2, 0, 2, 3]]


def object_of(*parts):
    corners = np.round(np.concatenate(parts) / GRID_M) * GRID_M
    return Mesh(corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))


def scene_of(*meshes, role=Role.OCCLUDER):
    definitions = [Definition(str(i), (mesh,)) for i, mesh in enumerate(meshes)]
    return Scene(definitions, [Instance(str(i), "", i, np.eye(4), role) for i in range(len(meshes))])


def test_patches_name_their_triangles_among_all_of_their_object():
    """Small triangles before and between the large ones are looked over, but they count."""
    scraps, large = slanted(0.05, (5, 0, 0)), slanted(3.0)
    scene = scene_of(object_of(scraps), object_of(scraps, large[:3], scraps, large[3:]))
    patches = PreparedModel(scene).patches
    assert patches.owner.tolist() == [1] and sorted(patches.members[0].tolist()) == [2, 5]
    triangles, starts = scene.triangles()[0], scene.triangle_starts
    members = triangles[starts[1] + patches.members[0]]
    assert bounds_disc(members, patches.corners.tolist())


def test_objects_that_are_alike_have_the_same_patches_each_where_it_stands():
    """As if they were found for each object; what is not opaque lends its shape and has none."""
    shape = object_of(slanted(3.0), slanted(2.0, (9, 0, 0)), slanted(0.05, (5, 0, 0)))
    scene = scene_of(*[shape] * 4, object_of(slanted(4.0)))
    for number, at in enumerate([(0, 0, 0), (33.25, -7, 2), (-1234.5, 991.75, 12), (1, 1, 1)]):
        scene.objects[number].transform[:3, 3] = at
    scene.objects[0] = replace(scene.objects[0], role=Role.TRANSPARENT)
    found = PreparedModel(scene).patches
    corners, owners = scene.triangles(*OPAQUE)
    wanted = find_patches(corners, owners, least_area=prepared.PATCH_M2 / GRID_M**2)
    assert sorted(found.owner.tolist()) == [1, 1, 2, 2, 3, 3, 4]

    def of(patches):
        loops = zip(patches.starts[:-1], patches.starts[1:], patches.owner, strict=True)
        return {(int(owner), patches.corners[a:b].tobytes()): k for k, (a, b, owner) in enumerate(loops)}

    mine, theirs = of(found), of(wanted)
    assert mine.keys() == theirs.keys()
    for key, k in mine.items():
        j = theirs[key]
        assert (found.boxes[k] == wanted.boxes[j]).all() and (found.normal[k] == wanted.normal[j]).all()
        assert found.area[k] == wanted.area[j] and found.members[k].tolist() == wanted.members[j].tolist()
        # No narrower than the patch itself, in exact arithmetic, and hardly wider.
        points = scene.triangles()[0][scene.triangle_starts[found.owner[k]] + found.members[k]].reshape(-1, 3)
        normal = [Fraction(float(x)) for x in found.normal[k]]
        heights = [sum(int(x) * n for x, n in zip(point, normal, strict=True)) for point in points]
        low, high = (Fraction(float(x)) for x in found.depth[k])
        assert low <= min(heights) and max(heights) <= high
        assert np.abs(found.depth[k] - wanted.depth[j]).max() < 1e-6


def test_every_part_is_made_once(monkeypatch):
    made = []
    for name in ("closed_elements", "opaque_planes", "carved_planes", "find_regions", "find_patches", "find_occludees"):
        work = getattr(prepared, name)
        monkeypatch.setattr(prepared, name, lambda *a, work=work, name=name, **k: (made.append(name), work(*a, **k))[1])
    model = PreparedModel(random_solids.random_solids(1))
    assert not made
    for _ in range(2):
        _ = (
            model.closed,
            model.planes,
            model.blocking_planes,
            model.regions,
            model.patches,
            model.outlines,
            model.occludees,
        )
    assert sorted(made) == sorted(
        ["closed_elements", "opaque_planes", "carved_planes", "find_regions", "find_patches", "find_occludees"]
    )


def test_glass_is_no_part_of_what_hides():
    scene = small_house.small_scene()
    model, glass = PreparedModel(scene), scene.object_mask(Role.TRANSPARENT)
    opaque = PreparedModel(Scene(scene.definitions, [o for o in scene.objects if o.role is not Role.TRANSPARENT]))
    for name in ("planes", "blocking_planes"):
        for mine, other in zip(getattr(model, name).boxes, getattr(opaque, name).boxes, strict=True):
            np.testing.assert_array_equal(mine, other)
    np.testing.assert_array_equal(model.regions.boxes, opaque.regions.boxes)
    assert not glass[[object_id for object_id, _ in model.closed]].any()
    assert len(model.occludees.bounds) == len(scene.objects), "but it may be hidden"


def test_furniture_blocks_if_it_is_large_and_cuts_nothing():
    table, cup = ([2, 2, 0], [4, 3, 1]), ([1, 1, 0], [1.1, 1.1, 0.1])
    wall = random_solids.box([0, 0, 0], [0.2, 5, 3])
    meshes = [wall, random_solids.box(*table), random_solids.box(*cup)]
    roles = [Role.OCCLUDER, Role.DETAIL, Role.DETAIL]
    model = PreparedModel(random_solids.scene_of_meshes(meshes, roles))
    top = [round(table[1][2] / GRID_M), round(cup[1][2] / GRID_M)]
    cuts, blocks = (set(planes.boxes[2][:, 0, 2].tolist()) for planes in (model.planes, model.blocking_planes))
    assert not cuts & set(top) and top[0] in blocks and top[1] not in blocks
    assert [object_id for object_id, _ in model.closed_of(Role.DETAIL)] == [1, 2]
    assert [object_id for object_id, _ in model.closed_of(Role.OCCLUDER)] == [0]
    for boxes in model.blocking_planes.boxes:
        axis = int((boxes[:, 0] == boxes[:, 1]).all(axis=0).argmax()) if len(boxes) else 0
        assert (np.diff(boxes[:, 0, axis]) >= 0).all(), "ordered by plane, as the index wants them"


def test_an_arch_is_carved_from_what_cuts_and_stays_in_what_blocks():
    model = PreparedModel(make_arcade(windows=1, furnished=False))
    low, high = (round((OUTER_WALL_M + (BAY_M + side * ARCH_M) / 2) / GRID_M) for side in (-1, 1))
    above = np.array([[low, round(SPRING_M / GRID_M)], [high, round((SPRING_M + ARCH_M / 2) / GRID_M)]])

    def in_the_arch(planes):
        """Rectangles of the wall's front that reach into the box around the arch."""
        return [r for r in planes.index.rectangles(1, 0) if (r[0] < above[1]).all() and (r[1] > above[0]).all()]

    assert len(in_the_arch(model.surfaces)) > 4 and not in_the_arch(model.planes)
    blocks = {rectangle.tobytes() for rectangle in in_the_arch(model.blocking_planes)}
    assert blocks == {rectangle.tobytes() for rectangle in in_the_arch(model.surfaces)}
    # The rest of the wall is as it was.
    carved = model.surfaces.axial_area - model.surfaces.lost_area - (model.planes.axial_area - model.planes.lost_area)
    assert 0 < carved * GRID_M**2 < 4.0


def test_outlines_are_the_rectangles_of_regions_then_the_patches():
    model = PreparedModel(random_solids.random_solids(4))
    boxes, patches, outlines = model.regions.boxes, model.patches, model.outlines
    assert len(outlines.area) == len(boxes) + len(patches.area)
    np.testing.assert_array_equal(outlines.boxes[: len(boxes)], boxes)
    np.testing.assert_array_equal(outlines.boxes[len(boxes) :], patches.boxes)


@pytest.mark.parametrize("part", [no_regions(), no_patches()])
def test_nothing_hides_nothing(part):
    assert len(part.boxes) == 0


def test_an_empty_scene_can_be_prepared():
    model = PreparedModel(Scene([], []))
    assert len(model.regions.boxes) == len(model.patches.area) == len(model.outlines.area) == len(model.closed) == 0
    assert len(model.occludees.pieces) == 0


def test_curtains_that_take_too_long_are_not_made():
    """Two walls at an angle in two lots: not in no time, and once in any."""
    walls = [random_solids.box([0, 0, 0], [size, 0.4, 3]) for size in (4, 5)]
    for wall in walls:
        wall.apply_transform(trimesh.transformations.rotation_matrix(0.5, [0, 0, 1]))
    model = PreparedModel(random_solids.scene_of_meshes(walls))
    assert not model.make_curtains(0.0) and not model.make_curtains(-1.0)
    assert model.make_curtains(1e6) and model.make_curtains(0.0)
    made = model.curtains
    assert len(made.boxes) > 0 and made is model.curtains
    assert made.boxes.tolist() == PreparedModel(model.scene).curtains.boxes.tolist()


def test_without_time_objects_are_whole_and_nothing_hides():
    model = PreparedModel(random_solids.random_solids(1))
    assert not model.make_plainest(-1.0) and not model.whole
    assert len(model.regions.boxes) == 0
    np.testing.assert_array_equal(model.occludees.pieces, model.occludees.bounds)
    assert model.occludees.starts.tolist() == list(range(len(model.scene.objects) + 1))
    assert not model.make_plainest(1e6), "what was left out stays so: others have used it"


def test_with_time_nothing_is_left_out():
    model, plain = (PreparedModel(random_solids.random_solids(1)) for _ in range(2))
    assert model.make_plainest(1e6) and model.whole
    for name in ("boxes", "region", "open_before", "plane"):
        np.testing.assert_array_equal(getattr(model.regions, name), getattr(plain.regions, name))
    np.testing.assert_array_equal(model.occludees.pieces, plain.occludees.pieces)


@pytest.mark.parametrize("times", [1, 3])
def test_some_regions_are_sound_occluders_too(monkeypatch, times):
    """As many lots of planes as there was time for, from all over the model."""
    monkeypatch.setattr(rasters, "LOT", 16)
    whole = PreparedModel(random_solids.random_solids(1)).regions
    lots_take(monkeypatch, 1.0)
    model = PreparedModel(random_solids.random_solids(1))
    assert not model.make_plainest(times)
    found, every = ({(*box, int(axis)) for box, axis in zip(boxes, axes, strict=True)} for boxes, axes in (
        (part.boxes.reshape(-1, 6).tolist(), part.blockers.axis) for part in (model.regions, whole)
    ))  # fmt: skip
    assert 0 < len(found) < len(every) and found < every
    places = model.regions.places
    assert places[-1].tolist() == [len(model.regions.u), len(model.regions.v), len(model.regions.open_before)]


def test_pieces_take_a_third_of_the_time(monkeypatch):
    told = []

    @contextmanager
    def within(seconds):
        told.append(seconds)
        yield

    monkeypatch.setattr(prepared, "within", within)
    assert PreparedModel(random_solids.random_solids(1)).make_plainest(60.0)
    assert told[0] == 20.0 and 20.0 < told[1] <= 60.0
