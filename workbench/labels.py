"""Labels beside points of a picture, none over another."""

from collections.abc import Sequence

from matplotlib.axes import Axes

# Sides of a point where a label may stand, the best first: steps to the right and upwards.
SIDES = ((1, 1), (1, -1), (-1, 1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
# Distances of a label from its point [points]; a thin line joins those beyond the first.
AWAY = (5.0, 14.0, 24.0, 36.0, 50.0, 66.0)
# A digit is about so wide, and a line so high, in the font's size; a mark reaches so far about its point [points].
WIDE, HIGH, MARK = 0.62, 1.15, 4.0

# x and y of a point in the axes' units, and its text.
Label = tuple[float, float, str]
Box = tuple[float, float, float, float]


def place_labels(axes: Axes, labels: Sequence[Label], size: float = 8.0, **style: object) -> None:
    """Write texts beside points, none over another, over a point or beyond the axes, as far as there is room.

    Axes must have their final scales; their figure is laid out here, so it must be complete but for this.

    Args:
        axes: to write in.
        labels: of all points of these axes.
        size: of the font [points].
        style: more of `Axes.annotate`.
    """
    axes.figure.draw_without_rendering()
    pixel = axes.figure.dpi / 72.0
    frame = axes.get_window_extent()
    inside = (frame.x0 / pixel, frame.y0 / pixel, frame.x1 / pixel, frame.y1 / pixel)
    at = [tuple(axes.transData.transform((x, y)) / pixel) for x, y, _ in labels]
    taken = [(x - MARK, y - MARK, x + MARK, y + MARK) for x, y in at]
    for (x, y, text), point in zip(labels, at, strict=True):
        box, shift, far = _free_place(point, (WIDE * size * len(text), HIGH * size), taken, inside)
        taken.append(box)
        line = {"arrowstyle": "-", "linewidth": 0.5, "color": "#777777", "shrinkA": 0, "shrinkB": 2} if far else None
        note = axes.annotate(
            text, (x, y), shift, textcoords="offset points", ha="center", va="center", fontsize=size, arrowprops=line,
            **style,
        )  # fmt: skip
        note.set_in_layout(False)


def _free_place(
    point: tuple[float, float], extent: tuple[float, float], taken: list[Box], inside: Box
) -> tuple[Box, tuple[float, float], bool]:
    """Box of a label, its middle from the point, and whether it is far from it [points]; if none is free the best."""
    found = []
    for number, away in enumerate(AWAY):
        for right, up in SIDES:
            shift = right * (away + extent[0] / 2), up * (away + extent[1] / 2)
            x, y = point[0] + shift[0], point[1] + shift[1]
            box = x - extent[0] / 2, y - extent[1] / 2, x + extent[0] / 2, y + extent[1] / 2
            covered = sum(_shared(box, other) for other in taken) + extent[0] * extent[1] - _shared(box, inside)
            if covered <= 1e-9:
                return box, shift, number > 0
            found.append((covered, len(found), box, shift, number > 0))
    return min(found)[2:]


def _shared(a: Box, b: Box) -> float:
    """Area that two boxes share."""
    return max(0.0, min(a[2], b[2]) - max(a[0], b[0])) * max(0.0, min(a[3], b[3]) - max(a[1], b[1]))
