"""Options of what shows a bake, or hands it on."""

import argparse

from .common import add_seed, command, ids, whole


def add_report(commands: argparse._SubParsersAction) -> None:
    """`viewcell report`."""
    report = command(
        commands,
        "report",
        "report",
        "Write plans, sets and numbers of a bake as a page.",
        ["report house.bake", "report house.bake --cells 4,7 -o page"],
        json=True,
    )
    report.add_argument("bake", metavar="BAKE", help="bake folder")
    report.add_argument("--cells", type=ids, metavar="ID,ID", help="cells to show; three telling ones by default")
    report.add_argument("-o", "--out", metavar="FOLDER", help="folder to write; BAKE/report by default")
    report.add_argument(
        "--curves", metavar="FILE", help="curves of time against error to show; FOLDER/curves.json by default"
    )


def add_curves(commands: argparse._SubParsersAction) -> None:
    """`viewcell curves`."""
    curves = command(
        commands,
        "curves",
        "curves",
        "Sweep every method's knob over a bake: time against error, and what random eyes miss.",
        ["curves house.bake", "curves house.bake --eyes --pixels 128,512", "curves --stability -o stability"],
    )
    curves.add_argument("bake", metavar="BAKE", nargs="?", help="bake folder; not with --stability")
    curves.add_argument(
        "--stability",
        action="store_true",
        help="instead, every kernel's error far from the origin, at slits, with thin occluders and close to edges",
    )
    curves.add_argument("--eyes", action="store_true", help="only what unions of random eyes miss of what is seen")
    curves.add_argument(
        "--pixels",
        type=ids,
        metavar="N,N",
        default=[128],
        help="on a side of the faces of these eyes' cube maps; 128 by default",
    )
    curves.add_argument("--device", default="cpu", help="of --stability, such as cuda:0; cpu by default")
    curves.add_argument("--cells", type=whole(1), default=8, help="view cells to sweep over; 8 by default")
    curves.add_argument(
        "-o",
        "--out",
        metavar="FOLDER",
        help="folder for curves and eyes, .json and .png; BAKE/report by default, where report finds them",
    )
    add_seed(curves, "the view cells and what the methods draw")


def add_export(commands: argparse._SubParsersAction) -> None:
    """`viewcell export`."""
    export = command(
        commands,
        "export",
        "export",
        "Write a bake's model, sets or portals for engines and other tools.",
        [
            "export house.bake --glb house.glb --json house.json",
            "export house.bake --3dtiles tiles",
            "export house.bake --prt map.prt",
        ],
    )
    export.add_argument("bake", metavar="BAKE", help="bake folder")
    for kind, text in (
        ("glb", "the model: a node for each object, with its id and GUID in extras"),
        ("json", "view cells, rooms, objects and potentially visible sets"),
        ("bits", "the sets as a bit matrix, and viewcell_bits.h beside it, which reads it from C"),
        ("prt", "portal file PRT1 for a Quake-family vis, cells as leaves in order"),
    ):
        # Said, lest that of `command`'s own --json, False, be it.
        export.add_argument(f"--{kind}", metavar="FILE", default=None, help=text)
    export.add_argument(
        "--3dtiles",
        metavar="FOLDER",
        help="a tileset that shows to an eye in a view cell what it may see, and the same as a draft of glTF",
    )
    export.add_argument("--overwrite", action="store_true", help="replace what is there")


def add_view(commands: argparse._SubParsersAction) -> None:
    """`viewcell view`."""
    view = command(
        commands,
        "view",
        "view",
        "Write a folder in which one walks through a bake, from inside and from above, in any browser.",
        ["view house.bake", "view house.walk -o page --no-open"],
    )
    view.add_argument("source", metavar="BAKE", help="bake folder of a model, or a display database of pack")
    view.add_argument("-o", "--out", metavar="FOLDER", help="folder to write; BAKE's name with .view by default")
    view.add_argument("--overwrite", action="store_true", help="replace a view that is there")
    view.add_argument("--no-open", action="store_true", help="do not open it in a browser")


def add_pack(commands: argparse._SubParsersAction) -> None:
    """`viewcell pack`."""
    pack = command(
        commands,
        "pack",
        "pack",
        "Write the display database that a walkthrough reads: levels of detail in one file, sets as runs.",
        ["pack house.bake", "pack house.bake -o house.walk --flatten", "pack --check house.walk"],
    )
    pack.add_argument("bake", metavar="BAKE", help="bake folder of a model; with --check, a display database")
    pack.add_argument("-o", "--out", metavar="FOLDER", help="folder to write; BAKE's name with .walk by default")
    pack.add_argument(
        "--flatten", action="store_true", help="give every object a copy of its shape; shared shapes by default"
    )
    pack.add_argument("--overwrite", action="store_true", help="replace a display database of another bake, too")
    pack.add_argument(
        "--check",
        action="store_true",
        help="write nothing: check every file of a display database, and whether its bake has changed since",
    )
