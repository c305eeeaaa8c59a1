"""The occlusion method of vLOD: nothing that a ray sees is hidden, and what one occluder plainly hides is."""

from dataclasses import replace

import numpy as np
import pytest
from viewcell.data.buildings.office import make_office
from viewcell.data.errors import InputError
from viewcell.data.patches import find_patches, join_outlines, rectangle_outlines
from viewcell.data.prepared import PreparedModel
from viewcell.data.regions import find_regions, join_regions
from viewcell.data.scene import OPAQUE
from viewcell.data.solids import triangles_meet_boxes
from viewcell.kernels.launch import Device
from viewcell.solvers.visibility.projection import (
    VlodSettings,
    cluster_directions,
    split_cell,
    vlod_hidden,
)
from viewcell.verify.arithmetic import box_corners
from viewcell.verify.exact.umbra import occluder, umbra
from viewcell.verify.rays.embree import embree_scene

STEPS = 1024
CELL = np.array([[[0, 0, 0], [STEPS, STEPS, STEPS]]])
CENTRE = VlodSettings(clusters=1, objective="centre", resolution=256)


class Office:
    """A small office, its occluders and occludees, and what rays see from free cells."""

    def __init__(self, seed):
        scene = make_office(floors=1, rooms_per_side=3, seed=seed)
        model = PreparedModel(scene)
        self.triangles, self.owners = scene.triangles(*OPAQUE)
        patches = find_patches(self.triangles, self.owners, least_area=0.2 * STEPS**2)
        # Without rectangles of furniture: few occluders, so that where a projection point lies matters.
        solids = ([corners for _, corners in model.closed_of(role)] for role in OPAQUE)
        regions = join_regions(find_regions(model.surfaces, *solids, scene.grid_m))
        self.occluders = join_outlines(rectangle_outlines(regions.boxes), patches)
        self.parts, self.count = model.occludees.pieces, len(scene.objects)
        self.part_owners = model.occludees.owners
        self.rng = np.random.default_rng(seed)
        self.embree = embree_scene(self.triangles)
        self.cells = np.array([self.free_cell(size) for size in (500, 1000, 1000, 2200)])

    def free_cell(self, size):
        """A random cube that no opaque triangle meets, between floor and ceiling."""
        low, high = self.triangles.min(axis=(0, 1)), self.triangles.max(axis=(0, 1))
        while True:
            corner = self.rng.integers(low, high - size)
            box = np.stack([corner, corner + size])
            near = (self.triangles.min(axis=1) < box[1]).all(axis=1) & (self.triangles.max(axis=1) > box[0]).all(axis=1)
            part = self.triangles[near]
            if not triangles_meet_boxes(part, np.repeat(box[None], len(part), axis=0)).any() and self.is_indoors(box):
                return box

    def is_indoors(self, box):
        eyes = np.repeat(box.mean(axis=0, keepdims=True), 6, axis=0).astype(np.float32)
        axes = np.concatenate([np.eye(3), -np.eye(3)]).astype(np.float32)
        return (self.embree.run(eyes, axes, output=1)["primID"] >= 0).all()

    def hidden(self, settings, cells=None, **options):
        cells = self.cells if cells is None else cells
        work = (cells, self.occluders, self.parts, self.part_owners, settings)
        return vlod_hidden(*work, objects=self.count, **options)

    def seen(self, cell, targets, rays):
        """Which objects a ray from random eyes at random triangles of the targets, or the first one it meets, is on."""
        chosen = np.flatnonzero(np.isin(self.owners, targets))
        chosen = self.rng.choice(chosen, rays)
        share = self.rng.dirichlet(np.ones(3), rays)
        aims = (self.triangles[chosen] * share[:, :, None]).sum(axis=1)
        eyes = self.rng.uniform(cell[0], cell[1], (rays, 3)).astype(np.float32)
        hits = self.embree.run(eyes, (aims - eyes).astype(np.float32), output=1)["primID"]
        return np.unique(self.owners[hits[hits >= 0]])


@pytest.fixture(scope="module")
def office():
    return Office(3)


SETTINGS = {
    "centre": CENTRE,
    "26 random": VlodSettings(26, objective="random"),
    "26 cone programmes": VlodSettings(26, resolution=256),
    "6 linear programmes": VlodSettings(clusters=6, objective="lp", resolution=256),
    "8 shells": replace(CENTRE, shells=8),
    "6 clusters, split": replace(CENTRE, clusters=6, split=2, resolution=128),
    "all occluders": replace(CENTRE, clusters=14, occluders=10**6),
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if "linear" in name else []) for name in SETTINGS]
)
def test_nothing_that_a_ray_sees_is_hidden(office, name):
    hidden, stats = office.hidden(SETTINGS[name])
    for cell, row in zip(office.cells, hidden, strict=True):
        assert not row[office.seen(cell, np.arange(office.count), 3000)].any()
        assert not row[office.seen(cell, np.flatnonzero(row), 6000)].any()
    assert hidden.mean() > 0.2, "so little that the rays prove nothing"
    assert set(stats.seconds) == {"umbra", "solve", "shrink", "coverage", "occludees"}
    assert 0 < stats.drawn


def test_shells_and_split_cells_hide_more(office):
    one, shells, split = (office.hidden(SETTINGS[n])[0].sum() for n in ("centre", "8 shells", "6 clusters, split"))
    assert one < shells
    assert one < split


def test_projection_points_hide_more_than_the_centre(office):
    centre, socp = (office.hidden(replace(CENTRE, clusters=26, objective=kind))[0].sum() for kind in ("centre", "socp"))
    assert centre < socp


@pytest.mark.parametrize("objective", ["centre", "random"])
def test_cells_threads_and_order_change_nothing(office, objective):
    settings = replace(CENTRE, clusters=6, objective=objective)
    together, _ = office.hidden(settings)
    alone = np.concatenate(
        [office.hidden(settings, office.cells[k : k + 1], device=Device(threads=2))[0] for k in range(4)]
    )
    np.testing.assert_array_equal(together, alone)


def wall(low, high):
    """Opaque rectangle in the plane x = 3 m, between y, z = low and high [m]."""
    return rectangle_outlines(np.array([[[3, low, low], [3, high, high]]]) * STEPS)


@pytest.mark.parametrize(
    ("low", "high", "box", "expected"),
    [
        (-9, 9, ((5, 0, 0), (6, 1, 1)), True),
        (-9, 9, ((1.5, 0, 0), (2, 1, 1)), False),
        (-9, 9, ((2, 0, 0), (4, 1, 1)), False),
        (-9, 9, ((5, 0, 0), (6, 30, 1)), False),
        (0, 1, ((4, -0.25, 0.25), (5, 0.75, 0.75)), False),
        (0.25, 0.75, ((6, 0.49, 0.49), (6.25, 0.51, 0.51)), False),
        (0.1, 0.9, ((4, 0.45, 0.45), (12, 0.55, 0.55)), False),
    ],
    ids=["behind", "in front", "across", "sticks out", "wider than the umbra", "beyond its tip", "past its tip"],
)
def test_a_wall(low, high, box, expected):
    """Cases of an umbra, the cell being the cube from 0 to 1 m."""
    parts = (np.array([box]) * STEPS).astype(np.int32)
    for settings in (CENTRE, replace(CENTRE, shells=3), replace(CENTRE, clusters=26), replace(CENTRE, split=2)):
        hidden, _ = vlod_hidden(CELL, wall(low, high), parts, np.array([0]), settings)
        assert hidden.tolist() == [[expected]]


def test_a_shell_keeps_a_bounded_umbra():
    """An occluder smaller than the cell hides nothing without a limit, but something close behind it."""
    close = (np.array([[[4, 0.45, 0.45], [4.5, 0.55, 0.55]]]) * STEPS).astype(np.int32)
    answers = [
        vlod_hidden(CELL, wall(0.1, 0.9), close, np.array([0]), replace(CENTRE, shells=shells))[0].item()
        for shells in (0, 1)
    ]
    assert answers == [False, True]


@pytest.mark.parametrize("shells", [0, 1, 2, 5])
def test_what_one_wall_hides_is_in_its_umbra_at_any_depth(shells):
    """Walls smaller and larger than the cell, whose umbra ends or has no end, and boxes about where it ends."""
    rng, count = np.random.default_rng(shells), np.zeros(2, int)
    for side in rng.uniform(0.3, 1.2, 12):
        low = (1 - side) / 2
        outlines = wall(low, 1 - low)
        exact = occluder([[0] * 3, [STEPS] * 3], outlines.corners.tolist())
        corner = np.column_stack([rng.uniform(3.1, 12, 60), *rng.uniform(0.3, 0.7, (2, 60))])
        boxes = (np.stack([corner, corner + 0.05], axis=1) * STEPS).astype(np.int32)
        hidden = vlod_hidden(CELL, outlines, boxes, np.arange(60), replace(CENTRE, shells=shells))[0][0]
        truth = np.array([all(umbra(exact, x) for x in box_corners(box.tolist())) for box in boxes])
        assert not (hidden & ~truth).any(), "wrong-hidden"
        count += hidden.sum(), truth.sum()
    assert count[0] > 20


def test_what_one_half_of_a_cell_sees_is_not_hidden():
    """A wall that ends at y = 0.8 m hides a box from the lower half of the cell and not from the upper."""
    low = rectangle_outlines(np.array([[[3072, -9216, -9216], [3072, 819, 9216]]]))
    box = (np.array([[[5, 0, 0], [6, 0.65, 0.6]]]) * STEPS).astype(np.int32)
    halves = [np.array([[[0, y, 0], [STEPS, y + 512, STEPS]]]) for y in (0, 512)]
    for cell, expected in zip([*halves, CELL], (True, False, False), strict=True):
        hidden, _ = vlod_hidden(cell, low, box, np.array([0]), replace(CENTRE, split=2))
        assert hidden.tolist() == [[expected]]


def test_an_oblique_wall():
    quad = np.array([[-22, 38, -40], [48, -32, -40], [48, -32, 40], [-22, 38, 40]]) * STEPS
    patches = find_patches(quad[[[0, 1, 2], [0, 2, 3]]], np.zeros(2, int), least_area=1.0)
    assert len(patches.area) == 1
    parts = np.array([[[10, 10, 0], [11, 11, 1]], [[4, 4, 0], [5, 5, 1]]], np.int32) * STEPS
    nothing = rectangle_outlines(np.zeros((0, 2, 3), int))
    hidden, stats = vlod_hidden(CELL, join_outlines(nothing, patches), parts, np.arange(2), CENTRE)
    assert hidden.tolist() == [[True, False]]
    assert stats.occluders == stats.drawn == 1


def test_an_object_is_hidden_with_all_its_parts():
    boxes = np.array([[[5, 0, 0], [6, 1, 1]], [[5, 0, 0], [6, 30, 1]]]) * STEPS
    parts, owners = boxes[[0, 0, 0, 1, 1]], np.array([1, 1, 2, 2, 3])
    hidden, _ = vlod_hidden(CELL, wall(-9, 9), parts, owners, CENTRE, objects=5)
    # The first and the last object have no part at all.
    assert hidden.tolist() == [[True, True, False, False, True]]


def test_the_largest_occluders_are_used():
    walls = join_outlines(wall(-0.1, 0.1), join_outlines(wall(-9, 9), wall(2, 2.1)))
    box = np.array([[[5, 0, 0], [6, 1, 1]]]) * STEPS
    hidden, stats = vlod_hidden(CELL, walls, box, np.array([0]), replace(CENTRE, occluders=1))
    assert hidden.item()
    assert stats.occluders == 1
    assert not vlod_hidden(CELL, walls, box, np.array([0]), replace(CENTRE, occluders=0))[0].any()


@pytest.mark.parametrize(("count", "angle"), [(6, 55), (14, 46), (26, 28)])
def test_clusters_cover_all_directions(count, angle):
    directions = cluster_directions(count)
    assert len(np.unique(directions.round(6), axis=0)) == count
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    some = np.random.default_rng(0).normal(size=(2000, 3))
    some /= np.linalg.norm(some, axis=1, keepdims=True)
    assert np.degrees(np.arccos((some @ directions.T).max(axis=1))).max() < angle


def test_parts_of_a_cell_tile_it():
    cell = np.array([[-7, 0, 5], [100, 1, 12]])
    boxes = split_cell(cell, 3)
    assert len(boxes) == 9, "one step high is not split"
    assert (boxes[:, 0] < boxes[:, 1]).all()
    assert (boxes[:, 1] - boxes[:, 0]).prod(axis=1).sum() == (cell[1] - cell[0]).prod()
    assert (boxes[:, 0] >= cell[0]).all()
    assert (boxes[:, 1] <= cell[1]).all()
    apart = (boxes[:, None, 1] <= boxes[None, :, 0]).any(axis=2)
    assert (apart | apart.T | np.eye(9, dtype=bool)).all()


def test_rectangles_turn_about_their_normals():
    boxes = np.array([[[5, -2, 3], [5, 7, 9]], [[1, 4, 3], [6, 4, 9]], [[1, 4, 3], [6, 8, 3]]])
    outlines = rectangle_outlines(boxes)
    for axis in range(3):
        corners = outlines.corners[4 * axis : 4 * axis + 4].astype(float)
        assert corners.min(axis=0).tolist() == boxes[axis, 0].tolist()
        assert corners.max(axis=0).tolist() == boxes[axis, 1].tolist()
        spread = corners - corners[0]
        vector = np.cross(spread, np.roll(spread, -1, axis=0)).sum(axis=0) / 2
        assert vector.tolist() == (outlines.normal[axis] * outlines.area[axis]).tolist()
        assert outlines.normal[axis].tolist() == np.eye(3)[axis].tolist()
        assert outlines.depth[axis].tolist() == [boxes[axis, 0, axis]] * 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"clusters": 5}, "clusters"),
        ({"objective": "best"}, "objective"),
        ({"shells": -1}, "shells"),
        ({"split": 0}, "split"),
        ({"occluders": -1}, "occluders"),
    ],
)
def test_bad_settings_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        VlodSettings(**change)


@pytest.mark.parametrize(
    ("cells", "parts", "owners", "message"),
    [
        (CELL[0], CELL, [0], "shapes"),
        (CELL, CELL, [0, 0], "shapes"),
        (CELL, CELL, [3], "owners"),
        (CELL, CELL, [-1], "owners"),
    ],
)
def test_bad_boxes_are_refused(cells, parts, owners, message):
    with pytest.raises(InputError, match=message):
        vlod_hidden(cells, wall(-9, 9), parts, np.array(owners), CENTRE, objects=3)
