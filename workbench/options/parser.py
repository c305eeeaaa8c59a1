"""The parser of the command line."""

import argparse

import shtab

from ...data.version import __version__
from .bakes import add_bake, add_clean, add_tune
from .checks import add_bench, add_check, add_verify
from .common import Help, Parser, completed
from .models import add_inspect, add_make
from .views import add_curves, add_export, add_pack, add_report, add_view, add_walk

# Commands by what they are for.
GROUPS = {
    "models": (add_make, add_inspect),
    "baking": (add_bake, add_tune, add_clean),
    "checking": (add_verify, add_check, add_bench),
    "using a bake": (add_report, add_view, add_export, add_pack, add_walk, add_curves),
}
TEXT = "From-region visibility for buildings, with a proof on both sides."
MORE = """\
examples:
  viewcell make office --out office.scene
  viewcell bake office.scene
  viewcell verify office.bake

viewcell COMMAND --help tells the options of a command. Exit codes: 0 done, nothing forbidden found; 1 a check failed;
2 unusable input or arguments; 130 interrupted."""


def parser() -> argparse.ArgumentParser:
    """The parser of all commands; what it reads has `run`, the name of a function of `commands`."""
    found = Parser(prog="viewcell", formatter_class=Help)
    found.add_argument("-V", "--version", action="version", version=f"viewcell {__version__}")
    shtab.add_argument_to(found, "--print-completion", help="print what makes a shell complete commands")
    commands = found.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    told = []
    for group, adders in GROUPS.items():
        first = len(commands._choices_actions)
        for add in adders:
            add(commands)
        told.append(f"{group}:")
        told += [f"  {action.dest:<9} {action.help}" for action in commands._choices_actions[first:]]
    # Told of by group, not in one list.
    commands.told_by_group = True
    found.usage = "viewcell [-h] [-V] [--print-completion SHELL] COMMAND ..."
    found.description = "\n".join([TEXT, "", *told])
    found.epilog = MORE
    completed(found)
    return found
