"""The rasteriser against rays in rationals, and against Embree on a whole building."""

import numpy as np
import pytest
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from viewcell.data.buildings.office import make_office
from viewcell.data.camera import NEAR_M, CameraPath, Screen, on_screen, project_boxes
from viewcell.data.errors import InputError
from viewcell.kernels.launch import CPU, Device
from viewcell.kernels.raster import device_triangles, launch_raster
from viewcell.verify.exact.raster import first_hit

# Rays so near to an edge [pixels], or surfaces so near to each other (part of the depth), are left to rounding.
CLEAR, LEAD = 1.0e-6, 1.0e-9
DEVICES = [CPU, pytest.param(Device("cuda:0"), marks=pytest.mark.gpu)]


def random_view(seed):
    rng = np.random.default_rng(seed)
    path = CameraPath(rng.uniform(-1, 1, (1, 3)), rng.uniform(0, 360, 1), rng.uniform(-80, 80, 1), np.zeros(1))
    return path.eyes * 1024, path.axes()


def random_triangles(rng, count=10):
    """Some around the eye, some that share edges, one that no ray meets but edge-on."""
    loose = rng.integers(-4000, 4000, (count, 3, 3))
    corners = rng.integers(-3000, 3000, (5, 3))
    fan = corners[[[0, 1, 2], [0, 2, 3], [0, 3, 4]]]
    flat = np.repeat(rng.integers(-900, 900, (1, 1, 3)), 3, axis=1)
    return np.concatenate([loose, fan, flat]).astype(np.int32)


def draw(triangles, owners, eyes, axes, screen, device=CPU, **more):
    calls = np.column_stack([np.arange(len(owners)), np.arange(len(owners)) + 1, owners])
    starts = np.arange(len(eyes) + 1) * len(owners)
    return launch_raster(
        device_triangles(triangles, device),
        np.tile(calls, (len(eyes), 1)),
        starts,
        eyes,
        axes,
        width=screen.width,
        height=screen.height,
        focal=screen.focal,
        near=NEAR_M * 1024,
        device=device,
        **more,
    )


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("seed", range(6))
def test_pixels_show_what_exact_rays_meet_first(seed, device):
    rng, screen = np.random.default_rng(seed), Screen(12, 9, 70.0)
    eyes, axes = random_view(seed)
    triangles = random_triangles(rng)
    owners = rng.permutation(len(triangles))
    images = draw(triangles, owners, eyes, axes, screen, device, depths=True)
    shown, inverse = images.ids[0], images.inverse_depths[0]
    certain = 0
    for row in range(screen.height):
        for column in range(screen.width):
            pixel = (column + 0.5 - screen.width / 2, screen.height / 2 - row - 0.5)
            truth = first_hit(triangles, owners, eyes[0], axes[0], pixel, screen.focal, NEAR_M * 1024)
            if (truth.clear is None or truth.clear > CLEAR**2) and (truth.lead is None or truth.lead > LEAD):
                certain += 1
                assert shown[row, column] == truth.owner, f"pixel {row}, {column}"
                depth = 0.0 if truth.depth is None else 1 / float(truth.depth)
                assert inverse[row, column] == pytest.approx(depth, rel=1e-9)
    assert certain == screen.width * screen.height
    assert draw(triangles, owners, eyes, axes, screen, device).inverse_depths is None


def test_triangles_that_share_an_edge_leave_no_pixel_between_them():
    rng = np.random.default_rng(1)
    screen = Screen(101, 77, 60.0)
    for middle in [(0, 0), *rng.integers(-300, 300, (20, 2)).tolist()]:
        # A square before the eye, cut along lines through pixel centres first, then along others.
        middle = np.append(middle, 2048)
        rim = np.array([[-4096, -4096], [4096, -4096], [4096, 4096], [-4096, 4096]])
        corners = np.column_stack([rim, np.full(4, 2048)])
        fan = np.array([[middle, corners[k], corners[(k + 1) % 4]] for k in range(4)])
        shown = draw(fan, np.arange(4), np.zeros((1, 3)), np.eye(3)[None], screen)
        assert (shown.ids >= 0).all()


def test_a_building_looks_as_embree_sees_it():
    scene, screen = make_office(floors=1, rooms_per_side=2), Screen(160, 120, 60.0)
    triangles, owners = scene.triangles()
    room = scene.spaces[0].vertices
    eye = (room.min(axis=0) + room.max(axis=0)) / 2
    path = CameraPath(
        np.repeat(eye[None], 3, axis=0), np.array([10.0, 130, 250]), np.array([0.0, -20, 10]), np.arange(3.0)
    )
    starts = np.flatnonzero(np.diff(owners, prepend=-1))
    ends = np.append(starts[1:], len(owners))
    calls = np.column_stack([starts, ends, owners[starts]])
    shown = launch_raster(
        device_triangles(triangles),
        np.tile(calls, (3, 1)),
        np.arange(4) * len(calls),
        path.eyes * 1024,
        path.axes(),
        width=screen.width,
        height=screen.height,
        focal=screen.focal,
        near=NEAR_M * 1024,
        device=Device(threads=2),
    ).ids
    embree = EmbreeScene(robust=True)
    TriangleMesh(embree, triangles.reshape(-1, 3).astype(np.float32), np.arange(len(triangles) * 3).reshape(-1, 3))
    x = np.arange(screen.width) + 0.5 - screen.width / 2
    y = screen.height / 2 - np.arange(screen.height) - 0.5
    pixels = np.stack([*np.meshgrid(x, y), np.full((screen.height, screen.width), screen.focal)], axis=-1)
    for frame in range(3):
        rays = (pixels.reshape(-1, 3) @ path.axes()[frame]).astype(np.float32)
        met = embree.run(np.repeat(path.eyes[frame : frame + 1] * 1024, len(rays), axis=0).astype(np.float32), rays)
        seen = np.where(met < 0, -1, owners[met]).reshape(screen.height, screen.width)
        differ = seen != shown[frame]
        # Where they differ, a neighbour has the other's answer: an edge runs through the pixel.
        around = np.pad(seen, 1, constant_values=-2)
        near = np.stack([around[r : r + screen.height, c : c + screen.width] for r in range(3) for c in range(3)])
        assert (near == shown[frame]).any(axis=0)[differ].all()
        assert differ.mean() < 0.01
    assert len(np.unique(shown)) > 10


def test_frames_do_not_depend_on_threads_or_company():
    rng, screen = np.random.default_rng(2), Screen(40, 30, 60.0)
    triangles = random_triangles(rng)
    views = [random_view(seed) for seed in range(5)]
    eyes, axes = (np.concatenate([view[k] for view in views]) for k in (0, 1))
    together = draw(triangles, np.arange(len(triangles)), eyes, axes, screen, Device(threads=2), depths=True)
    for frame in range(5):
        own = slice(frame, frame + 1)
        alone = draw(triangles, np.arange(len(triangles)), eyes[own], axes[own], screen, depths=True)
        assert np.array_equal(alone.ids[0], together.ids[frame])
        assert np.array_equal(alone.inverse_depths[0], together.inverse_depths[frame])
        assert alone.fragments[0] == together.fragments[frame]


def test_of_equal_depths_the_first_stays_and_both_are_counted():
    square = np.array([[[-9000, -9000, 500], [9000, -9000, 500], [0, 9000, 500]]])
    screen = Screen(8, 8, 60.0)
    shown = draw(np.repeat(square, 2, axis=0), np.array([7, 3]), np.zeros((1, 3)), np.eye(3)[None], screen)
    assert (shown.ids == 7).all()
    assert shown.fragments[0] == 2 * 64


@pytest.mark.parametrize("seed", range(4))
def test_no_box_with_a_pixel_on_the_screen_is_called_outside(seed):
    rng, screen = np.random.default_rng(seed), Screen(64, 48, 65.0)
    eyes, axes = random_view(seed)
    triangles = random_triangles(rng, 60)
    boxes = np.stack([triangles.min(axis=1), triangles.max(axis=1)], axis=1) / 1024
    count = len(boxes)
    rectangles = project_boxes(screen, np.repeat(eyes / 1024, count, 0), np.repeat(axes, count, 0), boxes)
    cut, inside = on_screen(screen, rectangles)
    assert 0 < inside.sum() < count
    for k in range(count):
        alone = draw(triangles[k : k + 1], np.zeros(1, int), eyes, axes, screen).ids[0]
        rows, columns = np.nonzero(alone == 0)
        if len(rows):
            assert inside[k]
            x, y = columns + 0.5 - screen.width / 2, screen.height / 2 - rows - 0.5
            assert (cut[k, 0] <= [x.min(), y.min()]).all() and (cut[k, 1] >= [x.max(), y.max()]).all()


def test_rectangles_are_those_of_the_boxes_edges_beyond_the_near_plane():
    rng, screen = np.random.default_rng(0), Screen(64, 48, 65.0)
    eyes, axes = random_view(3)
    middles, t = rng.uniform(-2, 2, (40, 3)), np.linspace(0, 1, 20_001)[:, None]
    boxes = np.stack([middles - rng.uniform(0.01, 2, (40, 3)), middles + rng.uniform(0.01, 2, (40, 3))], axis=1)
    rectangles = project_boxes(screen, np.repeat(eyes / 1024, 40, 0), np.repeat(axes, 40, 0), boxes)
    half = np.array([screen.width, screen.height]) / 2
    crossing = 0
    for box, rectangle in zip(boxes, rectangles, strict=True):
        corners = (np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(8, 3) - eyes[0] / 1024) @ axes[0].T
        pairs = [(a, b) for a in range(8) for b in range(a) if bin(a ^ b).count("1") == 1]
        points = np.concatenate([corners[a] + t * (corners[b] - corners[a]) for a, b in pairs])
        beyond = points[:, 2] >= NEAR_M
        crossing += 0 < beyond.sum() < len(points)
        if beyond.any():
            shown = screen.focal * points[beyond, :2] / points[beyond, 2:]
            expected = np.clip([shown.min(axis=0), shown.max(axis=0)], -half, half)
            assert np.abs(np.clip(rectangle, -half, half) - expected).max() < 0.5
    assert crossing > 10


def test_refuses_what_it_cannot_draw():
    triangles = device_triangles(np.zeros((1, 3, 3), np.int32))
    good = {"width": 4, "height": 4, "focal": 3.0, "near": 10.0}
    asked = (np.array([[0, 1, 0]]), np.array([0, 1]), np.zeros((1, 3)), np.eye(3)[None])
    launch_raster(triangles, *asked, **good)
    with pytest.raises(InputError, match="calls: expected triangles 0 to 1"):
        launch_raster(triangles, np.array([[0, 2, 0]]), *asked[1:], **good)
    with pytest.raises(InputError, match="starts"):
        launch_raster(triangles, asked[0], np.array([0, 2]), *asked[2:], **good)
    with pytest.raises(InputError, match="frames"):
        launch_raster(triangles, *asked[:3], np.eye(3), **good)
    with pytest.raises(InputError, match="near above 0"):
        launch_raster(triangles, *asked, **(good | {"near": 0.0}))
    with pytest.raises(InputError, match="image: expected at least 1x1"):
        Screen(0, 5)
    with pytest.raises(InputError, match="fov"):
        Screen(5, 5, 180.0)
