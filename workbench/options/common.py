"""What the options of several commands share: how arguments are read, how help is laid out, verbosity."""

import argparse
import contextlib
from collections.abc import Callable, Sequence
from typing import NoReturn

import shtab

from ..terminal import UNUSABLE, complain

# Seeds go to kernels as int32.
SEED_LIMIT = 2**31
# What a shell completes arguments of these names with.
FILES, FOLDERS = ("MODEL", "FILE", "CASE", "CELLS", "PVS"), ("BAKE", "FOLDER")


class Help(argparse.RawDescriptionHelpFormatter):
    """Help in sentences: options are told of in phrases, as complaints quote them."""

    def add_argument(self, action: argparse.Action) -> None:
        """Leave out commands that the description tells of."""
        if not getattr(action, "told_by_group", False):
            super().add_argument(action)

    def _expand_help(self, action: argparse.Action) -> str:
        text = super()._expand_help(action)
        return text if text.endswith((".", ":")) else f"{text[:1].upper()}{text[1:]}."


class Parser(argparse.ArgumentParser):
    """Says what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        """Complain and exit 2."""
        complain(f"{message} (see {self.prog} --help)")
        raise SystemExit(UNUSABLE)


def whole(least: int, most: int | None = None) -> Callable[[str], int]:
    """Reads a whole number in a range."""
    bounds = f"from {least}" + (f" to {most}" if most is not None else "")

    def read(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = None
        if value is None or value < least or (most is not None and value > most):
            raise argparse.ArgumentTypeError(f"expected a whole number {bounds}, found {text!r}")
        return value

    return read


def number(text: str) -> float:
    """Reads a number; its range is checked where it is used."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number, found {text!r}") from None


def measured(units: dict[str, float]) -> Callable[[str], float]:
    """Reads a number with a unit, such as 16MB; the units' names in small letters, and what each is worth."""

    def read(text: str) -> float:
        small = text.strip().lower()
        for unit in sorted(units, key=len, reverse=True):
            if small.endswith(unit):
                with contextlib.suppress(ValueError):
                    return float(small[: len(small) - len(unit)]) * units[unit]
        raise argparse.ArgumentTypeError(f"expected a number and {' or '.join(filter(None, units))}, found {text!r}")

    return read


def ids(text: str) -> list[int]:
    """Reads ids separated by commas."""
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected ids separated by commas, found {text!r}") from None


def image_size(text: str) -> tuple[int, int]:
    """Reads WIDTHxHEIGHT."""
    parts = text.lower().split("x")
    try:
        width, height = (int(part) for part in parts)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT in pixels, found {text!r}") from None
    return width, height


def several_numbers(text: str) -> list[float]:
    """Reads numbers separated by commas."""
    return [number(part) for part in text.split(",")]


def command(
    commands: argparse._SubParsersAction, name: str, run: str, text: str, examples: Sequence[str], *, json: bool = False
) -> Parser:
    """A sub-parser whose arguments are handed to a function of `commands`.

    Args:
        commands: to add it to.
        name: of the command.
        run: name of the function.
        text: what it does, in a sentence.
        examples: command lines, without `viewcell`.
        json: whether it can say its result for programs.
    """
    shown = "\n".join(["examples:", *(f"  viewcell {example}" for example in examples)])
    parser = commands.add_parser(name, help=text, description=text, epilog=shown, formatter_class=Help)
    parser.set_defaults(run=run, json=False)
    said = parser.add_mutually_exclusive_group()
    said.add_argument("-v", "--verbose", action="store_true", help="say a line on stderr about every phase")
    said.add_argument("-q", "--quiet", "--no-progress", action="store_true", help="say only results and complaints")
    if json:
        parser.add_argument("--json", action="store_true", help="say the result as JSON, for programs")
    return parser


def completed(parser: argparse.ArgumentParser) -> None:
    """Tell shells what the arguments of a parser, and of those below it, are completed with."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                completed(below)
        elif action.metavar in FILES:
            action.complete = shtab.FILE
        elif action.metavar in FOLDERS:
            action.complete = shtab.DIRECTORY


def add_device(parser: argparse.ArgumentParser) -> None:
    """Where kernels run."""
    parser.add_argument("--device", default="cpu", help="Warp device, such as cuda:0; cpu by default")


def add_seed(parser: argparse.ArgumentParser, of: str) -> None:
    """The seed of what a command draws."""
    parser.add_argument("--seed", type=whole(0, SEED_LIMIT - 1), default=0, help=f"of {of}; 0 by default")


def add_numbers(parser: argparse.ArgumentParser) -> None:
    """How the numbers of a mesh file are meant."""
    parser.add_argument("--up", choices=["y", "z"], help="axis that points up in a mesh file")
    parser.add_argument("--unit", help="unit of a mesh file, a name or metres; metre by default")


def add_roles(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """What the parts of a model file do to sight."""
    parser.add_argument("--doors", choices=["open", "closed"], help="whether doors occlude; open by default")
    parser.add_argument(
        "--yaw", metavar="DEG", help="turn the model back by so much, or auto: until walls stand along axes"
    )
    for option, text in (
        ("--glass", "regular expression for names and materials of glass, in place of the words for it"),
        ("--doors-by", "regular expression for names of doors, in place of the words for them"),
        ("--leave-out", "regular expression for names, GUIDs or kinds of what is not to be read"),
    ):
        parser.add_argument(option, metavar="PATTERN", help=text)


def add_settings(group: argparse._ArgumentGroup) -> None:
    """Options that are settings of a bake, under their names in `Settings`; None where the user says nothing."""
    for option, of, metavar, read, text in (
        (
            "--seal",
            "seal",
            "M",
            number,
            "close cracks narrower than this, and list what only that hides; 0 by default",
        ),
        (
            "--cells",
            "cells",
            "FILE",
            str,
            "a table of boxes, or octree, walkways or portals; the method's own by default",
        ),
        ("--threshold", "threshold_m2", "M2", number, "planes with less opaque area do not cut cells"),
        ("--cell-size", "cell_size_m", "M", number, "of an octree's roots; 4 by default"),
        ("--depth", "depth", None, whole(0, 12), "times an octree's cell is refined; 2 by default"),
        ("--refine-triangles", "refine_triangles", "N", whole(1), "refine a cell that may see more"),
        ("--refine-gap", "refine_gap", "SHARE", number, "refine a cell if more of its set than this is unknown"),
        (
            "--largest-cell",
            "largest_cell",
            "M",
            number,
            "cut inhabitable cells into parts no longer than this; any size by default",
        ),
        (
            "--refine-kept",
            "refine_kept",
            "RATIO",
            number,
            "halve cells whose eyes together see more than so many times as much as one; 1.5 halves long corridors",
        ),
        ("--seed", "seed", None, whole(0, SEED_LIMIT - 1), "of random sightlines; 0 by default"),
        ("--pixels", "pixels", "N", number, "by how much a level may deviate on the image; 1 by default"),
        ("--image", "image", "WxH", str, "size of that image; 1920x1080 by default"),
        ("--fov", "fov_deg", "DEG", number, "its vertical field of view; 60 by default"),
    ):
        group.add_argument(option, dest=of, metavar=metavar or option[2:].upper(), type=read, help=text)
    for option, text in (
        ("--certify", "store a certificate of all that is hidden, and hide nothing else"),
        ("--split", "make connected components objects of their own"),
        ("--lods", "simplify shapes that have one level, and say which level does from where"),
    ):
        group.add_argument(option, action="store_true", default=None, help=text)
    add_roles(group)
    group.add_argument(
        "--method",
        choices=["auto", "portals", "occluders", "both", "vlod"],
        help="what proves things hidden; auto, the default: portals in rooms, occluders where they fall short; "
        "vlod: projection points, to compare and to tune",
    )
