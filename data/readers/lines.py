"""Lines of words, as OBJ files and their material libraries have them."""

import re
from collections.abc import Iterator
from pathlib import Path

from .pieces import contents


def unquoted(words: list[str]) -> str:
    """A name of one or more words, without the quotes that some exporters set about it."""
    name = " ".join(words)
    return name[1:-1] if len(name) > 2 and name[0] == name[-1] == '"' else name


def lines_of(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and words of each line that has any, joined where it ends in a backslash."""
    held: list[str] = []
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text_of(contents(path))), start=1):
        if line.rstrip().endswith("\\"):
            held += line.rstrip()[:-1].split()
            continue
        words, held = held + line.split(), []
        if words and not words[0].startswith("#"):
            yield number, words
    if held and not held[0].startswith("#"):
        yield number, held


def text_of(data: bytes) -> str:
    """Text in UTF-8 or UTF-16 with a byte-order mark, in UTF-8 without one, else in Latin 1."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")
