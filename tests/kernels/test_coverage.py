"""Conservative cube maps: covered pixels and tested boxes against rationals, and against rays in large maps."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewcell.data.errors import InputError
from viewcell.data.verdict import Verdict
from viewcell.kernels.coverage import launch_coverage
from viewcell.kernels.launch import Device
from viewcell.kernels.occludee import launch_occludees
from viewcell.verify.exact.coverage import cover_polygon
from viewcell.verify.exact.occludee import covers_box, touched_pixels

SIZE = 8


def rectangle(axis, plane, low, high):
    """Corners of an axial rectangle; low and high on the next two axes, in cyclic order."""
    out = np.full((4, 3), float(plane))
    out[:, (axis + 1) % 3] = [low[0], high[0], high[0], low[0]]
    out[:, (axis + 2) % 3] = [low[1], low[1], high[1], high[1]]
    return out


def random_polygons(rng, count):
    """Triangles and axial rectangles on the grid, near and far, small and large, some round a pole of a face."""
    out = []
    for _ in range(count):
        if rng.random() < 0.5:
            triangle = rng.integers(-3000, 3000, (3, 3)) + rng.integers(-2500, 2500, 3)
            out.append(triangle.astype(float))
            continue
        low = rng.integers(-4000, 2000, 2)
        plane = rng.choice([-1, 1]) * rng.integers(200, 4000)
        polygon = rectangle(rng.integers(3), plane, low, low + rng.integers(1, 6000, 2))
        out.append(polygon[:: rng.choice([-1, 1])])
    return out


def coverage(viewpoint, polygons, owners=None, **options):
    owners = np.zeros(len(polygons), int) if owners is None else owners
    starts = np.concatenate([[0], np.cumsum([len(p) for p in polygons])])
    corners = np.concatenate([*polygons, np.zeros((0, 3))])
    return launch_coverage(np.atleast_2d(viewpoint), corners, starts, owners, **options)


def covered(maps, box):
    return launch_occludees(maps, np.array([box]), np.array([[0, 0]]))[0] == Verdict.HIDDEN


def compare(viewpoint, polygon):
    """Kernel and twin on one polygon: (pixels that both cover, pixels only the twin covers)."""
    got = coverage(viewpoint, [polygon], resolution=SIZE).depth(0)
    both = less = 0
    for face in range(6):
        image = cover_polygon(viewpoint, polygon, face, SIZE)
        for row in range(SIZE):
            for pixel in range(SIZE):
                depth, exact = got[face, row, pixel], image[row][pixel]
                if np.isfinite(depth):
                    assert exact is not None, f"face {face} row {row} pixel {pixel}: covered, exactly not"
                    assert Fraction(depth) >= exact, f"face {face} row {row} pixel {pixel}: {depth} < {float(exact)}"
                    assert depth < float(exact) * (1 + 1e-5)
                    both += 1
                elif exact is not None:
                    less += 1
    return both, less


@pytest.mark.parametrize("seed", range(3))
def test_covered_pixels_are_the_exact_ones(seed):
    rng = np.random.default_rng(seed)
    both = 0
    for polygon in random_polygons(rng, 12):
        # Off the grid, no pixel's border meets an edge, so that not a single pixel may be lost either.
        found, less = compare(rng.uniform(-150, 150, 3), polygon)
        both += found
        assert less == 0
    assert both > 100


@given(
    st.integers(0, 2),
    st.sampled_from([-1, 1]),
    st.lists(st.integers(0, SIZE), min_size=4, max_size=4),
    st.lists(st.integers(-1, 1), min_size=4, max_size=4),
)
def test_edges_on_pixel_borders(axis, sign, borders, steps):
    """A rectangle on its own face, its sides one step off the borders of pixels or on them."""
    place = 1024 * (2 * np.sort(np.reshape(borders, (2, 2)), axis=0) - SIZE) // SIZE + np.reshape(steps, (2, 2))
    if (place[0] >= place[1]).any():
        return
    polygon = rectangle(axis, sign * 1024, *place)
    face = 2 * axis + (sign < 0)
    got = coverage(np.zeros(3), [polygon], resolution=SIZE).depth(0)[face]
    image = cover_polygon(np.zeros(3), polygon, face, SIZE)
    for row in range(SIZE):
        for pixel in range(SIZE):
            if np.isfinite(got[row, pixel]):
                assert image[row][pixel] is not None
                assert Fraction(got[row, pixel]) >= image[row][pixel]
            elif image[row][pixel] is not None:
                # Only where a side runs along the pixel's border does rounding decide.
                assert any(on_border(pixel, place[:, 0]) + on_border(row, place[:, 1]))


def on_border(pixel, ends):
    return [end == 1024 * (2 * i - SIZE) // SIZE for end in ends for i in (pixel, pixel + 1)]


def ray(face, i, j, size):
    """Direction of depth 1 to the low corner of pixel i of row j."""
    out = np.zeros(3)
    axis = face // 2
    out[axis], out[(axis + 1) % 3], out[(axis + 2) % 3] = 1 - 2 * (face % 2), 2 * i / size - 1, 2 * j / size - 1
    return out


def check_borders(seed, count, size=4):
    """Triangles whose corners lie, up to rounding, on rays through corners of pixels: nothing but rounding decides."""
    rng, close = np.random.default_rng(seed), 0
    for _ in range(count):
        face = int(rng.integers(0, 6))
        # Anywhere on the grid, with digits down to the last.
        eye = rng.uniform(-1, 1, 3) * 2.0 ** rng.integers(3, 25)
        spots = rng.choice((size + 1) ** 2, 3, replace=False)
        depth = rng.uniform(1, 2, 3) * 2.0 ** rng.integers(3, 23)
        triangle = np.array(
            [eye + t * ray(face, *divmod(int(s), size + 1), size) for s, t in zip(spots, depth, strict=True)]
        )
        got = coverage(eye, [triangle], resolution=size).depth(0)[face]
        image = cover_polygon(eye, triangle, face, size)
        close += sum(depth is not None for row in image for depth in row)
        for row, pixel in np.argwhere(np.isfinite(got)):
            assert image[row][pixel] is not None, f"covered, exactly not: {eye.tolist()}, {triangle.tolist()}"
            assert Fraction(got[row, pixel]) >= image[row][pixel]
    return close


def test_what_only_rounding_covers_is_left_open():
    """A corner of a pixel on an edge: of those that look covered many are not by 2**-50 of their size."""
    assert check_borders(20, 300) > 30


@pytest.mark.slow
def test_what_only_rounding_covers_is_left_open_in_many_cases():
    assert check_borders(21, 10_000) > 1000


@pytest.mark.parametrize("size", [60, 2**22])
def test_a_polygon_round_its_viewpoint_covers_nothing(size):
    """Which side of the plane the viewpoint is on float64 cannot tell; the wrong one would hide half of the world."""
    rng = np.random.default_rng(22)
    for _ in range(150):
        flat = 10 * rng.integers(-size // 10, size // 10, (2, 3)).astype(float)
        eye = rng.integers(-(2**23), 2**23, 3) / 2.0
        around = [(1, 0), (0, 1), (-1, 0.1), (0.1, -1)]
        polygon = np.array([eye + a * flat[0] + b * flat[1] for a, b in around])
        assert not np.isfinite(coverage(eye, [polygon], resolution=8).depth(0)).any()


def test_a_bent_polygon_lies_as_far_as_its_farthest_corner():
    """Whichever way it is cut into triangles, the rays of its pixels meet it before its depth."""
    rng, met = np.random.default_rng(23), 0
    for _ in range(40):
        bend = rng.uniform(-60, 60, 4)
        polygon = np.array([[1000, -900, -900], [1000, 900, -900], [1000, 900, 900], [1000, -900, 900]], float)
        polygon[:, 0] += bend
        depth = coverage(np.zeros(3), [polygon], resolution=16).depth(0)[0]
        row, pixel = np.nonzero(np.isfinite(depth))
        directions = np.column_stack([np.ones(len(row)), (pixel + 0.5) / 8 - 1, (row + 0.5) / 8 - 1])
        for triangle in ([0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]):
            hit = first_hits(np.zeros(3), directions, [polygon[triangle]])
            assert (hit[np.isfinite(hit)] <= depth[row, pixel][np.isfinite(hit)]).all()
            met += np.isfinite(hit).sum()
    assert met > 5000


def check_box_borders(seed, count, size=4):
    """Boxes behind one rectangle that touch, up to rounding, the border of what it covers or its plane."""
    rng, hidden, seen = np.random.default_rng(seed), 0, 0
    for _ in range(count):
        face = int(rng.integers(0, 6))
        axis, sign = face // 2, 1 - 2 * (face % 2)
        u, v = (axis + 1) % 3, (axis + 2) % 3
        # A block of pixels, and a box whose corner the block's own corner ray meets.
        (i0, i1), (j0, j1) = (np.sort(rng.choice(size + 1, 2, replace=False)) for _ in range(2))
        most, end = int(2.0 ** rng.integers(6, 23)), rng.integers(0, 2, 2)
        border = ray(face, (i0, i1)[end[0]], (j0, j1)[end[1]], size)
        # So many steps away, less what the viewpoint has behind the point, which rounds when it is taken off.
        reach, digits = size * int(rng.integers(most // 16 + 1, most // 4)), rng.uniform(-1, 1)
        corner = (reach * border).astype(int) + rng.integers(-9, 10, 3)
        eye = corner - reach * border + digits * border
        eye += rng.integers(-1, 2, 3) * 2.0 ** -rng.integers(16, 53)
        inwards = np.zeros((2, 3))
        inwards[1, axis] = sign * rng.integers(0, most // 8 + 1)
        for side, c in zip(end, (u, v), strict=True):
            inwards[1, c] = (1 - 2 * side) * rng.integers(0, most // 16 + 1)
        box = np.sort(corner + inwards, axis=0).astype(int)
        near = (reach - digits) * rng.choice([0.5, 0.999, 1.0])
        slack = 0.01
        ends = [(i0 - slack, i1 + slack)[k] for k in (0, 1, 1, 0)], [(j0 - slack, j1 + slack)[k] for k in (0, 0, 1, 1)]
        polygon = np.array([eye + near * ray(face, i, j, size) for i, j in zip(*ends, strict=True)])
        # Planar to the last bit.
        polygon[:, axis] = polygon[0, axis]
        if np.abs(np.concatenate([polygon, box])).max() >= 2**24:
            continue
        if not covered(coverage(eye, [polygon], resolution=size), box):
            seen += 1
            continue
        hidden += 1
        touched, image = touched_pixels(eye, box, face, size), cover_polygon(eye, polygon, face, size)
        for row in range(size):
            for pixel in range(size):
                if touched[row][pixel] is not None:
                    assert image[row][pixel] is not None, f"touches an open pixel: {eye.tolist()}, {box.tolist()}"
                    assert image[row][pixel] < touched[row][pixel]
    return hidden, seen


def test_a_box_that_touches_the_next_pixel_is_not_hidden():
    assert min(check_box_borders(24, 600)) > 15


@pytest.mark.slow
def test_a_box_that_touches_the_next_pixel_is_not_hidden_in_many_cases():
    assert min(check_box_borders(25, 20_000)) > 500


def test_what_rounding_moves_over_the_border_of_a_pixel_is_not_hidden():
    """Far boxes seen from a viewpoint off the grid: their differences are not exact."""
    far, side = 10_000_000, 7_500_000
    walls = [rectangle(0, 1000, (740, -600), (1100, 600))]
    for shift in (0.0, 2.0**-30):
        # The box enters the pixel before the one that is covered by a third of what float64 tells apart.
        maps = coverage([-0.9 * shift, -0.6 * shift, 0.0], walls, resolution=16)
        assert covered(maps, [[far - 10, side + 1, 10], [far, side + 50, 20]])
        assert not covered(maps, [[far - 10, side, 10], [far, side + 50, 20]])


@pytest.mark.parametrize("open_face", range(6))
def test_a_box_that_reaches_round_into_an_open_face_is_not_hidden(open_face):
    """Five walls of a room: what is behind one of them and reaches round to where there is none is in sight."""
    axis, high = open_face // 2, open_face % 2 == 0
    walls = [
        rectangle(a, k, (-5000, -5000), (5000, 5000))
        for a in range(3)
        for k in (-1000, 1000)
        if (a, k > 0) != (axis, high)
    ]
    maps = coverage([3.7, -7.3, 9.1], walls, resolution=16)
    for other in {0, 1, 2} - {axis}:
        for side in (-1, 1):
            box = np.array([[-90, -90, -90], [90, 90, 90]])
            box[:, other] = np.sort([side * 1200, side * 1500])
            assert covered(maps, box)
            box[int(high), axis] = 4000 if high else -4000
            assert not covered(maps, box)


@pytest.mark.parametrize("eye", [[0, 0, 0], [3, -7, 9]])
def test_a_point_at_the_viewpoint_is_not_hidden(eye):
    """Nor what reaches there: it is in no face's pyramid, and nothing would be asked of it."""
    walls = [rectangle(axis, k, (-5000, -5000), (5000, 5000)) for axis in range(3) for k in (-1000, 1000)]
    maps = coverage(np.array(eye, float), walls, resolution=16)
    for size in ([0, 0, 0], [0, 0, 2000], [40, 40, 40]):
        assert not covered(maps, [eye, np.add(eye, size)])


def test_axial_rectangle_gets_whole_rows_and_columns():
    polygon = rectangle(0, 1000, (-510, -240), (260, 770))
    depth = coverage(np.zeros(3), [polygon], resolution=64).depth(0)
    inner = np.zeros((64, 64), bool)
    # Borders at (2 i - 64) / 64: from ceil((-0.24 + 1) 32) to floor((0.77 + 1) 32) rows, likewise pixels.
    inner[25:56, 16:40] = True
    np.testing.assert_array_equal(np.isfinite(depth[0]), inner)
    np.testing.assert_allclose(depth[0][inner], 1000, rtol=1e-6)
    assert not np.isfinite(depth[1:]).any()


def test_a_closed_room_hides_what_is_outside():
    """Six walls, each longer than the room, so that no face has a crack; seen from a corner of the room."""
    walls = [rectangle(axis, k, (-5000, -5000), (5000, 5000)) for axis in range(3) for k in (-1000, 1000)]
    maps = coverage([313.7, -777.3, 910.1], walls, resolution=64)
    assert np.isfinite(maps.depth(0)).all()
    # A box on three faces of the map, one below all of the room, and one close behind the wall that the map looks at.
    for box in (
        [[1200, -300, -300], [1500, 300, 300]],
        [[-3000] * 3, [3000, 3000, -1200]],
        [[310, -790, 1001], [330, -760, 1009]],
    ):
        assert covered(maps, box)
    for box in ([[1000, -300, -300], [1500, 300, 300]], [[-100, -100, -100], [100, 100, 100]], [[313, -778, 910]] * 2):
        assert not covered(maps, box)
    assert not covered(maps, [[-3000] * 3, [3000] * 3]), "the box holds the viewpoint"


def test_a_wall_hides_what_is_behind_it_and_not_beside():
    maps = coverage([10.5, 20.5, 30.5], [rectangle(0, 1000, (-900, -900), (900, 900))], resolution=64)
    assert covered(maps, [[1050, -500, -500], [1800, 500, 500]])
    for box in ([[900, -500, -500], [1800, 500, 500]], [[1050, -500, -500], [1800, 4500, 500]], [[-9] * 3, [-1] * 3]):
        assert not covered(maps, box)


def test_the_nearest_of_overlapping_polygons_stays():
    far, near = (rectangle(2, -k, (-4100, -4100), (4100, 4100)) for k in (4000, 2000))
    one, other = (coverage(np.zeros(3), both, resolution=16) for both in ([far, near], [near, far]))
    np.testing.assert_array_equal(one.depth(0), other.depth(0))
    assert 1999 < one.depth(0)[5].max() < 2001


@pytest.mark.parametrize(
    "polygon",
    [
        rectangle(0, 7, (100, 100), (900, 900)),
        np.array([[100.0, 100, 100], [200, 200, 200], [300, 300, 300]]),
        np.array([[107.0, 5, 5]] * 4),
    ],
    ids=["viewpoint in its plane", "a line through the viewpoint", "a point"],
)
def test_what_has_no_extent_covers_nothing(polygon):
    maps = coverage([7.0, 0, 0], [polygon], resolution=16)
    assert not np.isfinite(maps.depth(0)).any()


def test_a_repeated_corner_changes_nothing():
    polygon = rectangle(1, 900, (-4000, -300), (4000, 5000))
    twice = polygon[[0, 1, 1, 2, 3, 3, 3]]
    one, two = (coverage([1.5, 2.5, 3.5], [corners], resolution=32).depth(0) for corners in (polygon, twice))
    np.testing.assert_array_equal(one, two)
    assert np.isfinite(one).sum() > 500


@pytest.mark.parametrize("seed", range(5))
def test_hidden_boxes_are_hidden_exactly(seed):
    rng = np.random.default_rng(seed)
    viewpoint = rng.uniform(-150, 150, 3)
    polygons = random_polygons(rng, 10)
    maps = coverage(viewpoint, polygons, resolution=4)
    low = rng.integers(-6000, 6000, (2000, 3))
    boxes = np.stack([low, low + rng.integers(0, 2500, (2000, 3))], axis=1)
    verdicts = launch_occludees(maps, boxes, np.column_stack([np.arange(2000), np.zeros(2000, int)]))
    assert (verdicts == Verdict.HIDDEN).sum() > 5
    # As many of each kind; the exact answer takes long.
    chosen = np.concatenate([np.flatnonzero(verdicts == verdict)[:3] for verdict in (Verdict.UNKNOWN, Verdict.HIDDEN)])
    for box, verdict in zip(boxes[chosen], verdicts[chosen], strict=True):
        assert (verdict == Verdict.HIDDEN) == covers_box(viewpoint, polygons, box, 4), box.tolist()


def test_touched_pixels_hold_every_point_of_the_box():
    """The twin's own check: each sample of the box falls into a touched pixel, not nearer than its depth."""
    rng = np.random.default_rng(5)
    for _ in range(3):
        low = rng.integers(-3000, 3000, 3)
        box = np.stack([low, low + rng.integers(10, 3000, 3)])
        viewpoint = box[1] + rng.uniform(-1, 1, 3) * (box[1] - box[0]) + [0, 0, 5000]
        images = [touched_pixels(viewpoint, box, face, SIZE) for face in range(6)]
        for point in rng.uniform(box[0], box[1], (100, 3)) - viewpoint:
            axis = int(np.argmax(np.abs(point)))
            depth = abs(point[axis])
            pixel, row = ((point[[(axis + 1) % 3, (axis + 2) % 3]] / depth + 1) * SIZE / 2).astype(int)
            least = images[2 * axis + (point[axis] < 0)][row][pixel]
            assert least is not None
            assert float(least) <= depth * (1 + 1e-9)


def first_hits(viewpoint, directions, polygons):
    """Least parameter t of each ray viewpoint + t * direction among the polygons, inf if it meets none."""
    best = np.full(len(directions), np.inf)
    for corners in polygons:
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        with np.errstate(divide="ignore", invalid="ignore"):
            t = normal @ (corners[0] - viewpoint) / (directions @ normal)
        hit = viewpoint + np.where(np.isfinite(t), t, 0)[:, None] * directions
        sides = np.roll(corners, -1, axis=0) - corners
        turns = np.stack([np.cross(side, hit - corner) @ normal for side, corner in zip(sides, corners, strict=True)])
        good = np.isfinite(t) & (t > 0) & (turns > 0).all(axis=0)
        best[good] = np.minimum(best[good], t[good])
    return best


def test_rays_in_covered_pixels_of_a_large_map_hit():
    rng = np.random.default_rng(11)
    viewpoint, polygons = rng.uniform(-150, 150, 3), random_polygons(rng, 150)
    depth = coverage(viewpoint, polygons, resolution=128).depth(0)
    face, row, pixel = np.nonzero(np.isfinite(depth))
    assert len(face) > 50_000
    chosen = rng.integers(0, len(face), 10_000)
    face, row, pixel = face[chosen], row[chosen], pixel[chosen]
    axis, count = face // 2, np.arange(len(face))
    directions = np.empty((len(face), 3))
    directions[count, axis] = 1 - 2.0 * (face % 2)
    for shift, index in ((1, pixel), (2, row)):
        directions[count, (axis + shift) % 3] = (index + rng.uniform(0.001, 0.999, len(face))) / 64 - 1
    assert (first_hits(viewpoint, directions, polygons) <= depth[face, row, pixel]).all()


def test_points_of_hidden_boxes_lie_behind_a_polygon():
    rng = np.random.default_rng(12)
    viewpoint, polygons = rng.uniform(-150, 150, 3), random_polygons(rng, 20)
    maps = coverage(viewpoint, polygons, resolution=256)
    low = rng.integers(-9000, 9000, (3000, 3))
    boxes = np.stack([low, low + rng.integers(1, 1500, (3000, 3))], axis=1)
    hidden = launch_occludees(maps, boxes, np.column_stack([np.arange(3000), np.zeros(3000, int)])) == Verdict.HIDDEN
    assert 300 < hidden.sum() < 2900
    boxes = boxes[hidden]
    for points in rng.uniform(boxes[:, 0], boxes[:, 1], (20, len(boxes), 3)):
        assert (first_hits(viewpoint, points - viewpoint, polygons) < 1).all()


def test_batches_and_threads_change_nothing():
    rng = np.random.default_rng(3)
    viewpoints, polygons = rng.uniform(-150, 150, (5, 3)), random_polygons(rng, 60)
    owners = rng.integers(0, 4, 60)
    one, two = (
        coverage(viewpoints, polygons, owners, resolution=512, device=Device(threads=threads)) for threads in (1, 2)
    )
    for index in range(5):
        mine = [polygon for polygon, owner in zip(polygons, owners, strict=True) if owner == index]
        alone = coverage(viewpoints[index], mine, resolution=512).depth(0)
        np.testing.assert_array_equal(one.depth(index), alone)
        np.testing.assert_array_equal(two.depth(index), alone)
    assert not np.isfinite(one.depth(4)).any(), "the last map has no polygon"
    low = rng.integers(-6000, 6000, (2000, 3))
    boxes = np.stack([low, low + rng.integers(1, 800, (2000, 3))], axis=1)
    rows = np.column_stack([np.arange(2000), rng.integers(0, 5, 2000)])
    answers = launch_occludees(one, boxes, rows)
    np.testing.assert_array_equal(answers, launch_occludees(two, boxes, rows))
    assert 50 < (answers == Verdict.HIDDEN).sum() < 1950
    assert (answers[rows[:, 1] == 4] == Verdict.UNKNOWN).all()


TRIANGLE = np.array([[900.0, 0, 0], [900, 500, 0], [900, 0, 500]])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"viewpoints": np.zeros(3)}, "shape"),
        ({"corners": TRIANGLE * np.nan}, "finite"),
        ({"starts": [0, 2]}, "starts"),
        ({"starts": [0, 2, 3], "owners": [0, 0]}, "at least 3 corners"),
        ({"owners": [1]}, "maps 0 to 0"),
        ({"resolution": 100}, "power of two"),
    ],
)
def test_bad_polygons_are_refused(change, message):
    given = {"viewpoints": np.zeros((1, 3)), "corners": TRIANGLE, "starts": [0, 3], "owners": [0], **change}
    with pytest.raises(InputError, match=message):
        launch_coverage(**given)


@pytest.mark.parametrize(
    ("boxes", "rows", "message"),
    [
        (np.zeros((1, 3), int), [[0, 0]], "shapes"),
        (np.zeros((1, 2, 3), int), [[1, 0]], "below"),
        (np.zeros((1, 2, 3), int), [[0, -1]], "below"),
    ],
)
def test_bad_boxes_are_refused(boxes, rows, message):
    with pytest.raises(InputError, match=message):
        launch_occludees(coverage(np.zeros(3), [TRIANGLE], resolution=16), boxes, rows)
