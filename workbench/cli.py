"""The command line: arguments in, an exit code out. The commands themselves are in `commands`, imported when one runs.

Exit 0: done, nothing forbidden found; 1: a check failed; 2: unusable input or arguments; 130: interrupted.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn

from ..data.errors import InputError
from ..data.extras import missing
from ..data.version import __version__
from .terminal import INTERRUPTED, UNUSABLE, complain, watched

# Seeds go to kernels as int32.
SEED_LIMIT = 2**31
# What `tune` tunes; a model in their place means the first.
SOLVERS = ("bake", "projection-point", "lod")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and say what came of it.

    Args:
        argv: arguments after the program's name; by default those of the process.

    Returns:
        The exit code. What the user can mend, a full disk and a lack of memory are one line on stderr.
    """
    try:
        options = _parser().parse_args(_with_solver(sys.argv[1:] if argv is None else argv))
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 0
    try:
        from . import commands

        with watched(options.verbose, options.quiet):
            return getattr(commands, options.run)(options)
    except KeyboardInterrupt:
        complain("interrupted")
        return INTERRUPTED
    except InputError as error:
        complain(str(error))
    except ModuleNotFoundError as error:
        told = missing(error)
        if told is error:
            raise
        complain(str(told))
    except MemoryError as error:
        complain(f"expected enough memory, found too little{f' ({error})' if str(error) else ''}")
    except RuntimeError as error:
        # Warp's own way to say that a device's memory is full.
        if "Failed to allocate" not in str(error):
            raise
        complain(f"expected enough memory on the device, found too little ({error})")
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        complain(f"{where}expected to be able to read and write, found {error.strerror or error}")
    return UNUSABLE


def _with_solver(argv: Sequence[str]) -> list[str]:
    """Arguments in which `tune MODEL` names what it tunes: the bake."""
    if argv[:1] != ["tune"] or len(argv) < 2 or argv[1] in ("-h", "--help", *SOLVERS):
        return list(argv)
    return ["tune", "bake", *argv[1:]]


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        """Complain and exit 2."""
        complain(f"{message} (see {self.prog} --help)")
        raise SystemExit(UNUSABLE)


def _whole(least: int, most: int | None = None) -> Callable[[str], int]:
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


def _number(text: str) -> float:
    """Reads a number; its range is checked where it is used."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number, found {text!r}") from None


def _cells(text: str) -> list[int]:
    """Reads ids separated by commas."""
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected ids separated by commas, found {text!r}") from None


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="viewcell", description="From-region visibility for buildings, with a proof on both sides.")
    parser.add_argument("-V", "--version", action="version", version=f"viewcell {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_make(commands)
    _add_inspect(commands)
    _add_bake(commands)
    _add_verify(commands)
    _add_check(commands)
    _add_tune(commands)
    _add_report(commands)
    _add_curves(commands)
    _add_export(commands)
    _add_bench(commands)
    _add_clean(commands)
    return parser


def _command(commands: argparse._SubParsersAction, name: str, run: str, text: str) -> argparse.ArgumentParser:
    """A sub-parser whose arguments are handed to the function `run` of `commands`."""
    parser = commands.add_parser(name, help=text, description=text)
    parser.set_defaults(run=run)
    said = parser.add_mutually_exclusive_group()
    said.add_argument("-v", "--verbose", action="store_true", help="a line on stderr about every phase")
    said.add_argument("-q", "--quiet", "--no-progress", action="store_true", help="only results and complaints")
    return parser


def _seed(parser: argparse.ArgumentParser, of: str) -> None:
    parser.add_argument("--seed", type=_whole(0, SEED_LIMIT - 1), default=0, help=f"of {of}; 0 by default")


def _add_make(commands: argparse._SubParsersAction) -> None:
    make = commands.add_parser("make", help="make a synthetic building", description="Make a synthetic building.")
    buildings = make.add_subparsers(title="buildings", metavar="BUILDING", required=True)
    office = _command(buildings, "office", "make_office", "Make an office building and print its polygons by level.")
    office.add_argument(
        "-o", "--out", default="office.scene", help="X.scene (ready to bake) or X.glb; office.scene by default"
    )
    office.add_argument("--floors", type=_whole(1), help="storeys, 1 to 100; 3 by default")
    office.add_argument("--rooms-per-side", type=_whole(1), help="offices on each side of the corridor; 8 by default")
    office.add_argument("--like", choices=["soda-hall"], help="a published model's size and statistics instead")
    office.add_argument("--yaw", type=_number, default=0.0, metavar="DEG", help="turn it by so much; 0 by default")
    office.add_argument("--wings", type=_whole(1), default=1, help="offices joined end to end, 1 to 12; 1 by default")
    office.add_argument(
        "--wing-angle", type=_number, default=30.0, metavar="DEG", help="of each to the one before; 30 by default"
    )
    office.add_argument("--overwrite", action="store_true", help="replace what is at --out")
    _seed(office, "windows, doors and furniture")
    for name, text, counts in (
        ("plant", "a process plant's hall of any size", {"triangles": (100_000, "about how many; 100,000 by default")}),
        ("city", "a quarter of a city of any size", {"triangles": (100_000, "about how many; 100,000 by default")}),
        (
            "rotunda",
            "rooms round a ring corridor and a court",
            {"sides": (6, "of the building, 3 to 64; 6 by default")},
        ),
        (
            "arcade",
            "a corridor with arched windows and an octagonal passage",
            {"windows": (8, "1 to 100; 8 by default"), "segments": (12, "straight pieces of an arch; 12 by default")},
        ),
    ):
        other = _command(buildings, name, "make_other", f"Make {text} and print its size.")
        other.set_defaults(building=name, counts=list(counts))
        other.add_argument(
            "-o", "--out", default=f"{name}.scene", help=f"X.scene (ready to bake) or X.glb; {name}.scene by default"
        )
        for count, (usual, what) in counts.items():
            other.add_argument(f"--{count}", type=_whole(1), default=usual, help=what)
        other.add_argument("--overwrite", action="store_true", help="replace what is at --out")
        _seed(other, "what stands where")


def _add_inspect(commands: argparse._SubParsersAction) -> None:
    inspect = _command(
        commands, "inspect", "inspect", "Tell whether a model is fit to bake, and what is wrong with it."
    )
    inspect.add_argument("model", metavar="MODEL", help="as for bake")
    _add_numbers(inspect)
    _add_roles(inspect)
    inspect.add_argument("--json", action="store_true", help="everything, for programs")
    inspect.add_argument(
        "--referee", action="store_true", help="read the file a second time by another way, and compare"
    )
    inspect.add_argument("--picture", metavar="FILE", help="plan of cracks and leaks, as .png or .svg")
    inspect.add_argument("--no-estimate", action="store_true", help="do not try how long a bake takes")


def _add_bake(commands: argparse._SubParsersAction) -> None:
    bake = _command(commands, "bake", "bake", "Compute what can be seen from each cell of a model.")
    bake.add_argument(
        "model",
        metavar="MODEL",
        help="IFC, glTF, OBJ, PLY, STL, DXF, a Quake .bsp, a scene folder, or cells and portals",
    )
    bake.add_argument("-o", "--out", metavar="BAKE", help="folder to write; MODEL's name with .bake by default")
    _add_numbers(bake)
    bake.add_argument(
        "--budget", type=_number, metavar="SECONDS", help="stop refining then; the rest is unknown, never hidden"
    )
    bake.add_argument("--threads", type=_whole(1), help="CPU threads; all cores by default")
    bake.add_argument("--device", default="cpu", help="Warp device, such as cuda:0; cpu by default")
    bake.add_argument(
        "--overwrite", action="store_true", help="bake again, even if BAKE is up to date or of something else"
    )
    bake.add_argument(
        "--settings",
        metavar="FILE",
        help="JSON with keys of Settings, or a file that viewcell tune has written; options given here go before it",
    )
    _add_settings(bake.add_argument_group("what the answer depends on"))


def _add_numbers(parser: argparse.ArgumentParser) -> None:
    """How the numbers of a mesh file are meant."""
    parser.add_argument("--up", choices=["y", "z"], help="axis that points up in a mesh file")
    parser.add_argument("--unit", help="unit of a mesh file, a name or metres; metre by default")


def _add_roles(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
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


def _add_settings(group: argparse._ArgumentGroup) -> None:
    """Options that are settings of a bake, under their names in `Settings`; None where the user says nothing."""
    for option, of, metavar, read, text in (
        (
            "--seal",
            "seal",
            "M",
            _number,
            "close cracks narrower than this, and list what only that hides; 0 by default",
        ),
        ("--cells", "cells", "FILE", str, "a table of boxes, or octree, or portals; the method's own by default"),
        ("--threshold", "threshold_m2", "M2", _number, "planes with less opaque area do not cut cells"),
        ("--cell-size", "cell_size_m", "M", _number, "of an octree's roots; 4 by default"),
        ("--depth", "depth", None, _whole(0, 12), "times an octree's cell is refined; 2 by default"),
        ("--refine-triangles", "refine_triangles", "N", _whole(1), "refine a cell that may see more"),
        ("--refine-gap", "refine_gap", "SHARE", _number, "refine a cell if more of its set than this is unknown"),
        (
            "--largest-cell",
            "largest_cell",
            "M",
            _number,
            "cut inhabitable cells into parts no longer than this; any size by default",
        ),
        (
            "--refine-kept",
            "refine_kept",
            "RATIO",
            _number,
            "halve cells whose eyes together see more than so many times as much as one; 1.5 halves long corridors",
        ),
        ("--seed", "seed", None, _whole(0, SEED_LIMIT - 1), "of random sightlines; 0 by default"),
        ("--pixels", "pixels", "N", _number, "by how much a level may deviate on the image; 1 by default"),
        ("--image", "image", "WxH", str, "size of that image; 1920x1080 by default"),
        ("--fov", "fov_deg", "DEG", _number, "its vertical field of view; 60 by default"),
    ):
        group.add_argument(option, dest=of, metavar=metavar or option[2:].upper(), type=read, help=text)
    for option, text in (
        ("--certify", "store a certificate of all that is hidden, and hide nothing else"),
        ("--split", "make connected components objects of their own"),
        ("--lods", "simplify shapes that have one level, and say which level does from where"),
    ):
        group.add_argument(option, action="store_true", default=None, help=text)
    _add_roles(group)
    group.add_argument(
        "--method",
        choices=["auto", "portals", "occluders", "both", "vlod"],
        help="what proves things hidden; auto, the default: portals in rooms, occluders where they fall short; "
        "vlod: projection points, to compare and to tune",
    )


def _add_verify(commands: argparse._SubParsersAction) -> None:
    verify = _command(commands, "verify", "verify", "Try to refute a bake with rays, and check every witness exactly.")
    verify.add_argument(
        "bake", metavar="BAKE", nargs="?", help="bake folder; with --replay, that of the case if left out"
    )
    verify.add_argument("--rays", type=_whole(0), default=1_000_000, help="to cast at least; 1,000,000 by default")
    verify.add_argument(
        "--certificates", action="store_true", help="check the certificates of a bake with --certify, and nothing else"
    )
    verify.add_argument("--replay", metavar="CASE", help="judge the sightline of a case file again, and nothing else")
    verify.add_argument(
        "--hard-cases", action="store_true", help="put the hard cases that come with viewcell to every kernel instead"
    )
    verify.add_argument("--device", help="of the hard cases, such as cuda:0; the CPU and the first GPU by default")
    _seed(verify, "origins and directions")


def _add_check(commands: argparse._SubParsersAction) -> None:
    check = _command(commands, "check", "check", "Look for what anybody's potentially visible sets wrongly hide.")
    check.add_argument(
        "model",
        metavar="MODEL",
        nargs="?",
        help="IFC, glTF, OBJ, PLY, STL, DXF, a scene or bake folder, cells and portals, a compiled map (.bsp, .prt); "
        "with --replay, that of the check if left out",
    )
    check.add_argument(
        "--cells",
        metavar="CELLS",
        help="view cells: a Parquet or CSV table of boxes in the model's metres, or a bake; for a .bsp its .prt",
    )
    check.add_argument(
        "--pvs",
        metavar="PVS",
        nargs="+",
        help="what is claimed: tables of cell_id and object_id or reached_cell_id, .npy matrices, a bake, a .bsp",
    )
    check.add_argument(
        "--targets", choices=["objects", "cells"], help="what a matrix's columns are, if its shape leaves a doubt"
    )
    check.add_argument("--rays", type=_whole(1), default=4_000_000, help="to cast; 4,000,000 by default")
    _add_numbers(check)
    _add_roles(check)
    check.add_argument("-o", "--out", metavar="FOLDER", help="where to write all sightlines and the cells' numbers")
    check.add_argument("--shown", type=_whole(1), default=10, help="lines of each table; 10 by default")
    check.add_argument("--replay", metavar="FOLDER", help="judge the sightlines in an earlier check's folder again")
    _seed(check, "rays")


def _image(text: str) -> tuple[int, int]:
    """Reads WIDTHxHEIGHT."""
    parts = text.lower().split("x")
    try:
        width, height = (int(part) for part in parts)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT in pixels, found {text!r}") from None
    return width, height


def _numbers(text: str) -> list[float]:
    """Reads numbers separated by commas."""
    return [_number(part) for part in text.split(",")]


def _add_tune(commands: argparse._SubParsersAction) -> None:
    text = "Try settings on your own model; viewcell tune MODEL is short for viewcell tune bake MODEL."
    tune = commands.add_parser("tune", help="try settings on your own model", description=text)
    solvers = tune.add_subparsers(title="what is tuned", metavar="WHAT", required=True)
    _add_tune_bake(solvers)
    _add_tune_points(solvers)
    _add_tune_lod(solvers)


def _add_tune_bake(solvers: argparse._SubParsersAction) -> None:
    bake = _command(
        solvers,
        "bake",
        "tune_bake",
        "Try settings beside the default's, and recommend one that is no looser and no slower; else the default.",
    )
    bake.add_argument("model", metavar="MODEL", help="whatever viewcell bake takes, but no bare graph")
    bake.add_argument("-o", "--out", metavar="FOLDER", help="folder to write; MODEL's name with .tune by default")
    bake.add_argument(
        "--budget",
        type=_number,
        default=300.0,
        metavar="SECONDS",
        help="about how long it may take, without reading; 300 by default. Fewer view cells are tried if it is short",
    )
    bake.add_argument("--threads", type=_whole(1), help="CPU threads; all cores by default")
    bake.add_argument("--device", default="cpu", help="Warp device, such as cuda:0; cpu by default")
    _add_numbers(bake)
    _add_settings(bake.add_argument_group("settings that are kept as you give them"))


def _add_tune_points(solvers: argparse._SubParsersAction) -> None:
    points = _command(
        solvers,
        "projection-point",
        "tune_points",
        "Try ways to choose projection points of the method vlod, beside the default, on view cells of a bake.",
    )
    points.add_argument("bake", metavar="BAKE", help="bake folder of a model")
    points.add_argument("--cells", type=_whole(1), default=8, help="view cells to try them on; 8 by default")
    points.add_argument("-o", "--out", metavar="FOLDER", help="folder to write; BAKE's name with .tune by default")
    _seed(points, "the view cells and random points")


def _add_tune_lod(solvers: argparse._SubParsersAction) -> None:
    lod = _command(solvers, "lod", "tune_lod", "Try ways to choose levels of detail along a path through a bake.")
    lod.add_argument("bake", metavar="BAKE", help="bake folder of a model")
    lod.add_argument("--frames", type=_whole(1, 100_000), default=300, help="of the walk; 300 by default")
    lod.add_argument(
        "--budget-ms", type=_numbers, metavar="MS,MS", help="frame times to aim at; three telling ones by default"
    )
    lod.add_argument(
        "--image", type=_image, default=(640, 480), metavar="WxH", help="its size in pixels; 640x480 by default"
    )
    lod.add_argument("--fov", type=_number, default=60.0, metavar="DEG", help="vertical field of view; 60 by default")
    lod.add_argument(
        "--path", metavar="FILE", help="recorded path: a Parquet or CSV table of x, y, z, yaw, pitch, t; else a walk"
    )
    lod.add_argument(
        "--samples",
        metavar="FILE",
        help="frames measured with your renderer: a Parquet or CSV table of primitives, pixels, seconds and perhaps "
        "objects; by default the software renderer is measured",
    )
    lod.add_argument(
        "--always", type=lambda text: text.split(","), default=[], metavar="KIND,KIND", help="kinds never left out"
    )
    lod.add_argument("-o", "--out", metavar="FOLDER", help="folder to write; BAKE's name with .tune by default")
    _seed(lod, "the walk and the sampled frames")


def _add_report(commands: argparse._SubParsersAction) -> None:
    report = _command(commands, "report", "report", "Write plans, sets and numbers of a bake as a page.")
    report.add_argument("bake", metavar="BAKE", help="bake folder")
    report.add_argument("--cells", type=_cells, metavar="ID,ID", help="cells to show; three telling ones by default")
    report.add_argument("-o", "--out", metavar="FOLDER", help="folder to write; BAKE/report by default")
    report.add_argument(
        "--curves", metavar="FILE", help="curves of time against error to show; FOLDER/curves.json by default"
    )


def _add_curves(commands: argparse._SubParsersAction) -> None:
    curves = _command(commands, "curves", "curves", "Sweep every method's knob over a bake: time against error.")
    curves.add_argument("bake", metavar="BAKE", nargs="?", help="bake folder; not with --stability")
    curves.add_argument(
        "--stability",
        action="store_true",
        help="instead, every kernel's error far from the origin, at slits, with thin occluders and close to edges",
    )
    curves.add_argument("--device", default="cpu", help="of --stability, such as cuda:0; cpu by default")
    curves.add_argument("--cells", type=_whole(1), default=8, help="view cells to sweep over; 8 by default")
    curves.add_argument(
        "-o",
        "--out",
        metavar="FOLDER",
        help="folder for curves.json and .png; BAKE/report by default, where report finds them",
    )
    _seed(curves, "the view cells and what the methods draw")


def _add_export(commands: argparse._SubParsersAction) -> None:
    export = _command(
        commands, "export", "export", "Write a bake's model, sets or portals for engines and other tools."
    )
    export.add_argument("bake", metavar="BAKE", help="bake folder")
    for kind, text in (
        ("glb", "the model: a node for each object, with its id and GUID in extras"),
        ("json", "view cells, rooms, objects and potentially visible sets"),
        ("bits", "the sets as a bit matrix, and viewcell_bits.h beside it, which reads it from C"),
        ("prt", "portal file PRT1 for a Quake-family vis, cells as leaves in order"),
    ):
        export.add_argument(f"--{kind}", metavar="FILE", help=text)
    export.add_argument(
        "--3dtiles",
        metavar="FOLDER",
        help="a tileset that shows to an eye in a view cell what it may see, and the same as a draft of glTF",
    )
    export.add_argument("--overwrite", action="store_true", help="replace what is there")


def _add_bench(commands: argparse._SubParsersAction) -> None:
    bench = _command(commands, "bench", "bench", "Time every kernel and solver beside its errors and a baseline.")
    bench.add_argument(
        "--suite",
        choices=["quick", "full"],
        default="quick",
        help="quick, the default: a minute or so; full: larger sizes, and how cost grows",
    )
    bench.add_argument("--device", default="cpu", help="Warp device, such as cuda:0; cpu by default")
    bench.add_argument("--json", metavar="FILE", help="where to write the rows")
    bench.add_argument("--against", metavar="FILE", help="rows of an earlier run: say what got slower or looser")
    bench.add_argument("--strict", action="store_true", help="fail if anything got slower or looser, or is missing")
    bench.add_argument(
        "--only", type=lambda text: text.split(","), default=[], metavar="KERNEL,KERNEL", help="measure these alone"
    )
    bench.add_argument("--graphs", metavar="FOLDER", help="flood cells and portals in it, or in folders in it, too")


def _add_clean(commands: argparse._SubParsersAction) -> None:
    clean = _command(commands, "clean", "clean", "Remove unfinished work that killed bakes have left in a folder.")
    clean.add_argument(
        "folder", metavar="FOLDER", nargs="?", default=".", help="where the bakes are; the current folder by default"
    )


if __name__ == "__main__":
    sys.exit(main())
