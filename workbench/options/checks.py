"""Options of what looks for faults and measures."""

import argparse

from .common import add_device, add_numbers, add_roles, add_seed, command, whole


def add_verify(commands: argparse._SubParsersAction) -> None:
    """`viewcell verify`."""
    verify = command(
        commands,
        "verify",
        "verify",
        "Try to refute a bake with rays, and check every witness exactly.",
        ["verify house.bake", "verify house.bake --rays 10000000", "verify --replay case.json"],
        json=True,
    )
    verify.add_argument(
        "bake", metavar="BAKE", nargs="?", help="bake folder; with --replay, that of the case if left out"
    )
    verify.add_argument("--rays", type=whole(0), default=1_000_000, help="to cast at least; 1,000,000 by default")
    verify.add_argument(
        "--certificates", action="store_true", help="check the certificates of a bake with --certify, and nothing else"
    )
    verify.add_argument("--replay", metavar="CASE", help="judge the sightline of a case file again, and nothing else")
    verify.add_argument(
        "--hard-cases", action="store_true", help="put the hard cases that come with viewcell to every kernel instead"
    )
    verify.add_argument("--device", help="of the hard cases, such as cuda:0; the CPU and the first GPU by default")
    add_seed(verify, "origins and directions")


def add_check(commands: argparse._SubParsersAction) -> None:
    """`viewcell check`."""
    check = command(
        commands,
        "check",
        "check",
        "Look for what anybody's potentially visible sets wrongly hide.",
        [
            "check house.ifc --cells cells.csv --pvs pvs.parquet",
            "check house.bake --pvs house.bake --cells house.bake",
            "check --replay found",
        ],
        json=True,
    )
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
    check.add_argument("--rays", type=whole(1), default=4_000_000, help="to cast; 4,000,000 by default")
    add_numbers(check)
    add_roles(check)
    check.add_argument("-o", "--out", metavar="FOLDER", help="where to write all sightlines and the cells' numbers")
    check.add_argument("--shown", type=whole(1), default=10, help="lines of each table; 10 by default")
    check.add_argument("--replay", metavar="FOLDER", help="judge the sightlines in an earlier check's folder again")
    add_seed(check, "rays")


def add_bench(commands: argparse._SubParsersAction) -> None:
    """`viewcell bench`."""
    bench = command(
        commands,
        "bench",
        "bench",
        "Time every kernel and solver beside its errors and a baseline.",
        ["bench", "bench --suite full --json rows.json", "bench --against rows.json --strict"],
    )
    bench.add_argument(
        "--suite",
        choices=["quick", "full"],
        default="quick",
        help="quick, the default: a minute or so; full: larger sizes, and how cost grows",
    )
    add_device(bench)
    bench.add_argument("--json", metavar="FILE", help="where to write the rows")
    bench.add_argument("--against", metavar="FILE", help="rows of an earlier run: say what got slower or looser")
    bench.add_argument("--strict", action="store_true", help="fail if anything got slower or looser, or is missing")
    bench.add_argument(
        "--only", type=lambda text: text.split(","), default=[], metavar="KERNEL,KERNEL", help="measure these alone"
    )
    bench.add_argument("--graphs", metavar="FOLDER", help="flood cells and portals in it, or in folders in it, too")
