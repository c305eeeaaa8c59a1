"""Ways of nodes: one of them is taken by every line that is not excluded, whatever made the tree."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from builders.oblique_scenes import exact_span, proved, scene, search, shown, words_of
from viewcell.data.store.certificates import FENCES, FIRST_FENCE, FIRST_MISS, PARTING
from viewcell.data.verdict import Verdict
from viewcell.verify.proofs.ways import partings, ways_of


def random_line(random, made):
    """A line through the boxes of both ends in rationals, and its octant."""
    p, q = ([Fraction(int(c), 997) for c in random.integers(box[0] * 997, box[1] * 997 + 1, 3)] for box in made.boxes)
    way = [b - a for a, b in zip(p, q, strict=True)]
    octant = sum(1 << i for i in range(3) if way[i] < 0)
    signs = [-1 if c < 0 else 1 for c in way]
    return [c * s for c, s in zip(p, signs, strict=True)], [abs(c) for c in way], octant


def takes(rows, point, way):
    """Whether a line keeps rows, borders included."""
    return all((a - point[i]) / way[i] <= (b - point[j]) / way[j] for i, j, a, b in rows)


def lines(seeds, count):
    for seed in seeds:
        made, random = scene(seed), np.random.default_rng(seed)
        for _ in range(count):
            point, way, octant = random_line(random, made)
            if all(way):
                yield made, point, way, octant


def crosses(quad, octant, point, way, begin, end):
    """Whether a line meets the inside of a curtain between two times, exactly."""
    signs = [-1 if octant >> i & 1 else 1 for i in range(3)]
    a, b = ([int(c) * s for c, s in zip(p, signs, strict=True)] for p in quad)
    x, y = b[0] - a[0], b[1] - a[1]
    rate = x * way[1] - y * way[0]
    if rate == 0:
        return False
    time = -(x * (point[1] - a[1]) - y * (point[0] - a[0])) / rate
    p = [c + time * d for c, d in zip(point, way, strict=True)]
    along = (p[0] - a[0]) * x + (p[1] - a[1]) * y
    return 0 < along < x * x + y * y and min(a[2], b[2]) < p[2] < max(a[2], b[2]) and begin <= time <= end


def test_a_line_that_misses_a_curtain_takes_a_way():
    """Out of the source, into the target and past the curtain between: then one of its ways holds."""
    missed = 0
    for made, point, way, octant in lines(range(120), 12):
        s, t = (end.mirrored(octant) for end in made.ends())
        (enter, begin), (end, leave) = exact_span(s, point, way), exact_span(t, point, way)
        if enter >= begin or end >= leave or begin > end:
            continue
        for n, quad in enumerate(made.quads):
            if not crosses(quad, octant, point, way, begin, end):
                ways = ways_of(n, [0, 1, 2, 3], s, t, made.strict, octant, made.known())
                assert any(takes(rows, point, way) for rows in ways)
                missed += 1
    assert missed > 800


def test_a_line_that_meets_an_end_takes_ways_past_its_corners_and_fences():
    met = 0
    for made, point, way, octant in lines(range(120), 6):
        ends = [end.mirrored(octant) for end in made.ends()]
        for which, end in enumerate(ends):
            enter, leave = exact_span(end, point, way)
            if end.plan is None or enter >= leave:
                continue
            met += 1
            nodes = [FIRST_MISS + 2 * which + side for side in (0, 1)]
            sides = [2 * (4 * which + k) + entry for k in range(4) for entry in (0, 1)]
            nodes += [FIRST_FENCE + FENCES * side + piece for side in sides for piece in (1, 3, 4, 5, 9, 20)]
            for node in nodes:
                ways = ways_of(node, [0, 1, 2, 3], *ends, made.strict, octant, {})
                assert any(takes(rows, point, way) for rows in ways)
    assert met > 200


def test_sightlines_go_past_edges_that_part_the_plans():
    cuts = 0
    for made, point, way, octant in lines(range(200), 6):
        s, t = (end.mirrored(octant) for end in made.ends())
        (enter, begin), (end, leave) = exact_span(s, point, way), exact_span(t, point, way)
        if enter < begin and end < leave and begin <= end:
            w = [1 / c for c in way]
            for tag, g in partings(s, t).items():
                assert tag % 8 == PARTING and sum(a * b for a, b in zip(g, w, strict=True)) < 0
                cuts += 1
    assert cuts > 100


@pytest.mark.parametrize("piece", [0, 2, 14, 254])
def test_pieces_that_reach_beyond_a_side_do_not_exist(piece):
    made = next(made for made in map(scene, range(50)) if made.plans[0] is not None)
    with pytest.raises(LookupError, match="piece"):
        ways_of(FIRST_FENCE + piece, [0, 1, 2, 3], *made.ends(), True, 0, {})


def test_fences_of_boxes_do_not_exist():
    made = next(made for made in map(scene, range(50)) if made.plans[0] is None)
    with pytest.raises(LookupError, match="prism"):
        ways_of(FIRST_FENCE + 1, [0, 1, 2, 3], *made.ends(), True, 0, {})


def test_no_tree_hides_what_a_segment_shows():
    """Curtains cut short, ends grown: a tree of the scene before must not hold where a segment passes."""
    random, refused = np.random.default_rng(0), 0
    for seed in range(500):
        made = scene(seed)
        answers = search(made)
        if answers.verdict[0] != Verdict.HIDDEN:
            continue
        words = words_of(made, answers)
        quads = made.quads.copy()
        for quad in quads[random.random(len(quads)) < 0.5]:
            quads[(quads == quad).all(axis=(1, 2)), int(random.integers(2)), 2] = quad[:, 2].sum() // 2
        if (quads[:, 0, 2] >= quads[:, 1, 2]).any():
            continue
        changed = replace(made, quads=quads)
        if shown(changed, seed, 400):
            assert not proved(changed, words)
            refused += 1
    assert refused > 8
