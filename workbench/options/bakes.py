"""Options of what bakes and tunes."""

import argparse

from .common import (
    Help,
    add_device,
    add_numbers,
    add_seed,
    add_settings,
    command,
    image_size,
    number,
    several_numbers,
    whole,
)


def add_bake(commands: argparse._SubParsersAction) -> None:
    """`viewcell bake`."""
    bake = command(
        commands,
        "bake",
        "bake",
        "Compute what can be seen from each cell of a model.",
        [
            "bake house.ifc",
            "bake house.ifc -o house.bake --doors closed --budget 60",
            "bake plant.glb --cells octree --cell-size 8",
        ],
        json=True,
    )
    bake.add_argument(
        "model",
        metavar="MODEL",
        help="IFC, glTF, OBJ, PLY, STL, DXF, a Quake .bsp, a scene folder, or cells and portals",
    )
    bake.add_argument("-o", "--out", metavar="BAKE", help="folder to write; MODEL's name with .bake by default")
    add_numbers(bake)
    bake.add_argument(
        "--budget", type=number, metavar="SECONDS", help="stop refining then; the rest is unknown, never hidden"
    )
    bake.add_argument("--threads", type=whole(1), help="CPU threads; all cores by default")
    add_device(bake)
    bake.add_argument(
        "--overwrite", action="store_true", help="bake again, even if BAKE is up to date or of something else"
    )
    bake.add_argument(
        "--settings",
        metavar="FILE",
        help="JSON with keys of Settings, or a file that viewcell tune has written; options given here go before it",
    )
    add_settings(bake.add_argument_group("what the answer depends on"))


def add_tune(commands: argparse._SubParsersAction) -> None:
    """`viewcell tune`, a command for each of what it tunes."""
    text = "Try settings on your own model; viewcell tune MODEL is short for viewcell tune bake MODEL."
    tune = commands.add_parser("tune", help=text.partition(";")[0] + ".", description=text, formatter_class=Help)
    solvers = tune.add_subparsers(title="what is tuned", metavar="WHAT", required=True)
    add_tune_bake(solvers)
    add_tune_points(solvers)
    add_tune_lod(solvers)


def add_tune_bake(solvers: argparse._SubParsersAction) -> None:
    """`viewcell tune bake`."""
    bake = command(
        solvers,
        "bake",
        "tune_bake",
        "Try settings beside the default's, and recommend one that is no looser and no slower; else the default.",
        ["tune house.ifc", "tune bake house.ifc --budget 600 -o house.tune"],
    )
    bake.add_argument("model", metavar="MODEL", help="whatever viewcell bake takes, but no bare graph")
    bake.add_argument("-o", "--out", metavar="FOLDER", help="folder to write; MODEL's name with .tune by default")
    bake.add_argument(
        "--budget",
        type=number,
        default=300.0,
        metavar="SECONDS",
        help="about how long it may take, without reading; 300 by default. Fewer view cells are tried if it is short",
    )
    bake.add_argument("--threads", type=whole(1), help="CPU threads; all cores by default")
    add_device(bake)
    add_numbers(bake)
    add_settings(bake.add_argument_group("settings that are kept as you give them"))


def add_tune_points(solvers: argparse._SubParsersAction) -> None:
    """`viewcell tune projection-point`."""
    points = command(
        solvers,
        "projection-point",
        "tune_points",
        "Try ways to choose projection points of the method vlod, beside the default, on view cells of a bake.",
        ["tune projection-point house.bake"],
    )
    points.add_argument("bake", metavar="BAKE", help="bake folder of a model")
    points.add_argument("--cells", type=whole(1), default=8, help="view cells to try them on; 8 by default")
    points.add_argument("-o", "--out", metavar="FOLDER", help="folder to write; BAKE's name with .tune by default")
    add_seed(points, "the view cells and random points")


def add_tune_lod(solvers: argparse._SubParsersAction) -> None:
    """`viewcell tune lod`."""
    lod = command(
        solvers,
        "lod",
        "tune_lod",
        "Try ways to choose levels of detail along a path through a bake.",
        ["tune lod house.bake --budget-ms 8,16", "tune lod house.bake --path walk.csv --samples frames.csv"],
    )
    lod.add_argument("bake", metavar="BAKE", help="bake folder of a model")
    lod.add_argument("--frames", type=whole(1, 100_000), default=300, help="of the walk; 300 by default")
    lod.add_argument(
        "--budget-ms",
        type=several_numbers,
        metavar="MS,MS",
        help="frame times to aim at; three telling ones by default",
    )
    lod.add_argument(
        "--image", type=image_size, default=(640, 480), metavar="WxH", help="its size in pixels; 640x480 by default"
    )
    lod.add_argument("--fov", type=number, default=60.0, metavar="DEG", help="vertical field of view; 60 by default")
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
    add_seed(lod, "the walk and the sampled frames")


def add_clean(commands: argparse._SubParsersAction) -> None:
    """`viewcell clean`."""
    clean = command(
        commands,
        "clean",
        "clean",
        "Remove unfinished work that killed bakes have left in a folder.",
        ["clean", "clean bakes"],
    )
    clean.add_argument(
        "folder", metavar="FOLDER", nargs="?", default=".", help="where the bakes are; the current folder by default"
    )
