"""Labels beside points of a picture: as drawn, none is over another, over a point or outside."""

from itertools import combinations

import pytest
from matplotlib.figure import Figure
from viewcell.workbench.labels import place_labels

CROWD = [(10.0 * 1.01**n, 9.0 + 0.1 * (n % 3), str(2**n)) for n in range(11)]


@pytest.mark.parametrize("labels", [CROWD, [(3.0, 3.0, "0"), (3.0, 3.0, "1"), (3.01, 3.0, "4"), (20.0, 20.0, "last")]])
def test_labels_as_drawn_do_not_overlap(labels):
    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    axes.plot([x for x, _, _ in labels], [y for _, y, _ in labels], "o", markersize=5)
    axes.set(xscale="log", yscale="log", title="points")
    place_labels(axes, labels)
    figure.draw_without_rendering()
    boxes, frame = [note.get_window_extent() for note in axes.texts], axes.get_window_extent()
    # The box of a note that a line joins to its point includes the line.
    words = [super(type(note), note).get_window_extent() for note in axes.texts]
    assert [note.get_text() for note in axes.texts] == [text for _, _, text in labels] and len(boxes) == len(labels)
    for a, b in combinations(words, 2):
        assert not a.overlaps(b)
    for word in words:
        assert frame.x0 <= word.x0 and word.x1 <= frame.x1 and frame.y0 <= word.y0 and word.y1 <= frame.y1
        assert not any(word.contains(*axes.transData.transform((x, y))) for x, y, _ in labels)


def test_a_label_alone_stands_beside_its_point_without_a_line():
    axes = Figure().subplots()
    axes.plot([0, 1, 2], [0, 1, 2], "o")
    place_labels(axes, [(1.0, 1.0, "7")])
    (note,) = axes.texts
    assert note.arrow_patch is None and note.xyann[0] > 0 and note.xyann[1] > 0
