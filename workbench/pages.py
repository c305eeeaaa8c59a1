"""What pictures and pages of time against error share: colours, the Pareto front, a PNG, a page in one file."""

import base64
import io
from collections.abc import Callable, Iterable, Sequence
from importlib.resources import files
from typing import TYPE_CHECKING, TypeVar

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

    from matplotlib.figure import Figure

# Colours that colour-blind readers tell apart (after Okabe and Ito); the page has the same (report/page/charts.mjs).
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#a8437c", "#555555", "#56b4e9")
MARKERS = ("o", "s", "^", "D", "P")
Point = TypeVar("Point")
# Templates that several commands share.
TEMPLATES = files(__package__) / "templates"


def pareto_front(points: Iterable[Point], of: Callable[[Point], tuple[float, float]]) -> list[Point]:
    """Those that no other one beats in both time and error, fastest first; `of` gives the two."""
    front: list[Point] = []
    for point in sorted(points, key=of):
        if not front or of(point)[1] < of(front[-1])[1]:
            front.append(point)
    return front


def png(figure: "Figure") -> bytes:
    """The picture as a file."""
    out = io.BytesIO()
    figure.savefig(out, dpi=110, format="png")
    return out.getvalue()


def fill(folder: "Traversable", template: str, **parts: object) -> str:
    """A page from a template in a folder: `style` is that of all pages, text is escaped, markup goes in as `Markup`."""
    style = (TEMPLATES / "base.css").read_text("utf-8")
    found = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, keep_trailing_newline=True)
    return found.from_string((folder / template).read_text("utf-8")).render(style=Markup(style), **parts)


def html_page(
    title: str, picture: bytes, head: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str], lead: str = ""
) -> str:
    """HTML in one file: a lead, the picture, a table, and notes; one of several lines is shown as it is."""
    parts = {"title": title, "head": head, "rows": rows, "notes": notes, "lead": lead}
    image = base64.b64encode(picture).decode()
    return fill(TEMPLATES, "table.html", picture=image, **parts)
