"""Pages of the documentation: their blocks, in order, and a reader who does what they say.

In a `console` block a line that begins with "$ " is a command, and "# exit 1" at its end the exit code. What follows is
what it prints, where "..." stands for anything; nothing, if the page does not say. A `python` block runs after those
before it; a `text` block right after it is what it prints. One whose first line is "# NAME.py" is a file.
"""

import doctest
import io
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from itertools import pairwise
from pathlib import Path

from viewcell.workbench.cli import main

FENCE = re.compile(r"^```(\S*)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"# (\w+\.py)\n")
EXIT = re.compile(r"# exit (\d+)\s*$")


def blocks(page: Path, kind: str | None = None) -> list[tuple[str, str]] | list[str]:
    """(kind, text) of every fenced block of a page; the texts alone of one kind."""
    found = FENCE.findall(page.read_text(encoding="utf-8"))
    return found if kind is None else [text for name, text in found if name == kind]


def commands(text: str) -> Iterator[tuple[str, str]]:
    """(command, what it prints) of a `console` block; nothing is printed before the first."""
    before, *parts = re.split(r"^\$ ", text, flags=re.MULTILINE)
    assert before == "", f"expected a command first, found {before!r}"
    for part in parts:
        command, _, printed = part.partition("\n")
        yield command, printed


def follow(page: Path) -> dict[str, object]:
    """Do what a page says, in the current folder.

    Returns:
        The names that its Python has made.

    Raises:
        AssertionError: a command fails, or something prints what the page does not say.
    """
    names: dict[str, object] = {}
    found = blocks(page)
    for (kind, text), (after, told) in pairwise([*found, ("", "")]):
        if kind == "console":
            for command, printed in commands(text):
                code = EXIT.search(command)
                said = _run(shlex.split(command, comments=True), int(code[1]) if code else 0)
                _compare(command, printed, said)
        elif kind == "python" and (file := FILE.match(text)):
            Path(file[1]).write_text(text, encoding="utf-8")
        elif kind == "python":
            with redirect_stdout(io.StringIO()) as said:
                exec(compile(text, str(page), "exec"), names)
            _compare(text, told if after == "text" else "", said.getvalue())
    return names


def _run(words: list[str], wanted: int) -> str:
    if words[0] == "viewcell":
        with redirect_stdout(io.StringIO()) as said, redirect_stderr(io.StringIO()) as complained:
            code = main(words[1:])
        assert code == wanted, f"{shlex.join(words)}: exit {code}\n{said.getvalue()}{complained.getvalue()}"
        return said.getvalue()
    assert words[0] == "pytest", f"{words[0]}: no reader knows how to run it"
    done = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True, check=False)
    assert done.returncode == wanted, done.stdout + done.stderr
    return done.stdout


def _compare(what: str, told: str, printed: str) -> None:
    if told and not doctest.OutputChecker().check_output(told, printed, doctest.ELLIPSIS):
        raise AssertionError(f"{what}\nprints\n{printed}\nwhere the page says\n{told}")
