"""Sections of closed elements: what they hold, and that many at once are each as alone."""

import numpy as np
from viewcell.data.sections import largest_sections, over, section_rectangles


def extruded(plan, low, high):
    """Triangles of a convex prism over a plan [grid steps], its faces outwards, shape (m, 3, 3), int32."""
    count, plan = len(plan), np.array(plan)
    bottom, top = (np.column_stack([plan, np.full(count, z)]) for z in (low, high))
    faces = [(bottom[0], bottom[i + 1], bottom[i]) for i in range(1, count - 1)]
    faces += [(top[0], top[i], top[i + 1]) for i in range(1, count - 1)]
    for i in range(count):
        j = (i + 1) % count
        faces += [(bottom[i], bottom[j], top[j]), (bottom[i], top[j], top[i])]
    return np.array(faces, np.int32)


def test_a_mitred_wall_has_a_section():
    """It lacks four steps at the mitres, where the outline is rounded; once all of it was lost."""
    wall = extruded([(3599, -3069), (3804, -2864), (3804, 3802), (3599, 4007)], -5509, -3072)
    _, found = section_rectangles([over(wall, 0, 3701)])
    assert found.tolist() == [[[-2963, -5509], [3901, -3072]]]


def test_many_sections_are_each_as_alone():
    """Of two walls, along both plan axes and on levels, below and above; the largest rectangles as well."""
    walls = [
        extruded([(3599, -3069), (3804, -2864), (3804, 3802), (3599, 4007)], -5509, -3072),
        extruded([(0, 0), (900, 300), (840, 480), (-60, 180)], 0, 700),
    ]
    places = [(0, 3701, True), (0, 420, False), (1, 210, True), (1, -2900, False), (2, -3072, True), (2, 0, False)]
    places.append((2, 9, True))
    cuts = [over(wall, axis, plane, below=below) for wall in walls for axis, plane, below in places]
    ends = np.tile([4, 0], (len(cuts), 1))
    cut, found = section_rectangles(cuts)
    which, largest = largest_sections(cuts, ends, 2000.0)
    assert len(set(which.tolist())) >= 6
    for number, section in enumerate(cuts):
        np.testing.assert_array_equal(found[cut == number], section_rectangles([section])[1])
        np.testing.assert_array_equal(largest[which == number], largest_sections([section], ends[:1], 2000.0)[1])
        assert (np.prod(largest[which == number, 1] - largest[which == number, 0], axis=1) >= 2000).all()
    _, whole = largest_sections(cuts, np.zeros((len(cuts), 2), int), 0.0)
    shorter = whole + np.array([[4, 0], [-4, 0]])
    assert (largest[:, None] == shorter).all(axis=(2, 3)).any(axis=1).all()
