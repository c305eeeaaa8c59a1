"""Options of what shows a bake, or hands it on."""

import argparse

from .common import add_seed, command, ids, image_size, measured, number, whole


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
    pack.add_argument(
        "--depth-meshes",
        choices=("auto", "all"),
        help="textured depth meshes of what is far: auto where they pay, all wherever anything is far",
    )
    pack.add_argument(
        "--triangles",
        type=whole(1),
        metavar="N",
        help="with them, of a view cell to all sides, which cull boxes and levels are balanced for; 200,000 by default",
    )
    pack.add_argument("--along", metavar="PATH", help="with them, only view cells that hold an eye of this camera path")
    pack.add_argument("--overwrite", action="store_true", help="replace a display database of another bake, too")
    pack.add_argument(
        "--check",
        action="store_true",
        help="write nothing: check every file of a display database, and whether its bake has changed since",
    )


BYTES = {"kb": 1e3, "mb": 1e6, "gb": 1e9, "b": 1.0, "": 1.0}


def add_walk(commands: argparse._SubParsersAction) -> None:
    """`viewcell walk`."""
    walk = command(
        commands,
        "walk",
        "walk",
        "Walk through a display database: what is seen, drawn, held in memory and read in every frame.",
        [
            "walk house.walk",
            "walk house.walk --path tour.csv --cache 4MB --policy all --check 20",
            "walk http://127.0.0.1:8000/house.walk --latency 40ms --bandwidth 25mbit",
        ],
        json=True,
    )
    walk.add_argument("walk", metavar="WALK", help="folder of viewcell pack, or its address on a web server")
    walk.add_argument(
        "--path", metavar="FILE", default="auto", help="a recorded path; auto, the default: to random rooms"
    )
    walk.add_argument("--frames", type=whole(1), default=1000, help="of the default path; 1000 by default")
    add_seed(walk, "the default path")
    walk.add_argument(
        "--policy",
        choices=["coarse-first", "as-published", "vlod", "mmr", "all"],
        default="coarse-first",
        help="what is held in memory; coarse-first by default, all compares them",
    )
    walk.add_argument("--target-ms", type=number, default=16.0, metavar="MS", help="time of a frame; 16 by default")
    walk.add_argument(
        "--levels", metavar="FILE", help="tune-lod.json of viewcell tune lod; the software renderer's costs by default"
    )
    walk.add_argument("--cache", type=measured(BYTES), default=16e6, metavar="SIZE", help="memory; 16MB by default")
    walk.add_argument(
        "--read", type=measured(BYTES), default=0.8e6, metavar="SIZE", help="most read in a frame; 0.8MB by default"
    )
    walk.add_argument(
        "--latency",
        type=measured({"ms": 1.0, "s": 1e3}),
        default=0.0,
        metavar="TIME",
        help="before the first byte of each read; 0ms by default",
    )
    walk.add_argument(
        "--bandwidth",
        type=measured({"kbit": 1e-3, "mbit": 1.0, "gbit": 1e3}),
        metavar="RATE",
        help="such as 25mbit; by default what --read takes in a frame's time",
    )
    walk.add_argument("--timeout", type=number, default=10.0, metavar="S", help="of a server; 10 by default")
    walk.add_argument("--speed", type=number, default=2.0, metavar="M_S", help="most of the user; 2 m/s by default")
    walk.add_argument("--turn", type=number, default=180.0, metavar="DEG_S", help="likewise; 180 degrees/s by default")
    walk.add_argument("--ahead", type=number, default=1.0, metavar="S", help="time looked ahead; 1 by default")
    walk.add_argument("--image", type=image_size, default=(640, 480), metavar="WxH", help="640x480 by default")
    walk.add_argument("--fov", type=number, default=60.0, metavar="DEG", help="vertical; 60 by default")
    walk.add_argument(
        "--polygon-bytes",
        type=whole(1),
        metavar="N",
        help="what a triangle takes in your renderer's memory; as in the file by default. Nothing is read then",
    )
    walk.add_argument(
        "--no-depth-meshes",
        dest="depth_meshes",
        action="store_false",
        help="draw what stands on depth meshes as geometry; without them by default where the database has none",
    )
    walk.add_argument(
        "--real-time", action="store_true", help="frames at their times, drawn, read by a thread, and measured"
    )
    walk.add_argument(
        "--check", type=whole(0), default=0, metavar="N", help="compare so many frames with the truth; 0 by default"
    )
    walk.add_argument("-o", "--out", metavar="FOLDER", help="folder to write; WALK's name with .tour by default")
