"""What pictures and pages of time against error share: colours, the Pareto front, a PNG, a page in one file."""

import base64
import html
import io
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Colours that colour-blind readers tell apart (Okabe and Ito).
COLOURS = ("#0072b2", "#56b4e9", "#d55e00", "#cc79a7", "#555555")
MARKERS = ("o", "s", "^", "D", "P")
STYLE = (
    "body{font:15px/1.5 sans-serif;max-width:75em;margin:2em auto;padding:0 1em}img{max-width:100%}"
    "table{border-collapse:collapse;font-size:13px}td,th{border:1px solid #ccc;padding:.2em .6em;text-align:right}"
)
Point = TypeVar("Point")


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


def html_page(
    title: str, picture: bytes, head: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str], lead: str = ""
) -> str:
    """HTML in one file: a lead, the picture, a table, and notes; one of several lines is shown as it is."""
    title = html.escape(title)
    cells = "".join(f"<th>{html.escape(text)}</th>" for text in head)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(text)}</td>" for text in row) + "</tr>" for row in rows)
    tags = ["pre" if "\n" in note else "p" for note in notes]
    said = "".join(f"<{tag}>{html.escape(note)}</{tag}>" for tag, note in zip(tags, notes, strict=True) if note)
    lead = f"<p>{html.escape(lead)}</p>" if lead else ""
    image = f'<img alt="{title}" src="data:image/png;base64,{base64.b64encode(picture).decode()}">'
    return (
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>{STYLE}</style>'
        f"</head><body><h1>{title}</h1>{lead}{image}<table><tr>{cells}</tr>{body}</table>{said}</body></html>\n"
    )
