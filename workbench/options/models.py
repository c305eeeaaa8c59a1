"""Options of what makes and looks at models."""

import argparse

from .common import Help, add_numbers, add_roles, add_seed, command, number, whole


def add_make(commands: argparse._SubParsersAction) -> None:
    """`viewcell make`, a command for each building."""
    text = "Make a synthetic building."
    make = commands.add_parser("make", help=text, description=text, formatter_class=Help)
    buildings = make.add_subparsers(title="buildings", metavar="BUILDING", required=True)
    office = command(
        buildings,
        "office",
        "make_office",
        "Make an office building and print its polygons by level.",
        [
            "make office -o office.scene",
            "make office --floors 1 --wings 2 --wing-angle 30",
            "make office --like soda-hall -o hall.glb",
        ],
    )
    office.add_argument(
        "-o", "--out", default="office.scene", help="X.scene (ready to bake) or X.glb; office.scene by default"
    )
    office.add_argument("--floors", type=whole(1), help="storeys, 1 to 100; 3 by default")
    office.add_argument("--rooms-per-side", type=whole(1), help="offices on each side of the corridor; 8 by default")
    office.add_argument("--like", choices=["soda-hall"], help="a published model's size and statistics instead")
    office.add_argument("--yaw", type=number, default=0.0, metavar="DEG", help="turn it by so much; 0 by default")
    office.add_argument("--wings", type=whole(1), default=1, help="offices joined end to end, 1 to 12; 1 by default")
    office.add_argument(
        "--wing-angle", type=number, default=30.0, metavar="DEG", help="of each to the one before; 30 by default"
    )
    office.add_argument("--overwrite", action="store_true", help="replace what is at --out")
    add_seed(office, "windows, doors and furniture")
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
        other = command(
            buildings, name, "make_other", f"Make {text} and print its size.", [f"make {name} -o {name}.scene"]
        )
        other.set_defaults(building=name, counts=list(counts))
        other.add_argument(
            "-o", "--out", default=f"{name}.scene", help=f"X.scene (ready to bake) or X.glb; {name}.scene by default"
        )
        for count, (usual, what) in counts.items():
            other.add_argument(f"--{count}", type=whole(1), default=usual, help=what)
        other.add_argument("--overwrite", action="store_true", help="replace what is at --out")
        add_seed(other, "what stands where")


def add_inspect(commands: argparse._SubParsersAction) -> None:
    """`viewcell inspect`."""
    inspect = command(
        commands,
        "inspect",
        "inspect",
        "Tell whether a model is fit to bake, and what is wrong with it.",
        ["inspect house.ifc", "inspect house.obj --unit mm --up y", "inspect house.ifc --picture plan.png --referee"],
        json=True,
    )
    inspect.add_argument("model", metavar="MODEL", help="as for bake")
    add_numbers(inspect)
    add_roles(inspect)
    inspect.add_argument(
        "--referee", action="store_true", help="read the file a second time by another way, and compare"
    )
    inspect.add_argument("--picture", metavar="FILE", help="plan of cracks and leaks, as .png or .svg")
    inspect.add_argument("--no-estimate", action="store_true", help="do not try how long a bake takes")
