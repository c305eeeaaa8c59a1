"""Benchmarks beyond `viewcell bench`, on your models, graphs and bakes: python -m viewcell.workbench.bench NAME."""

import argparse
import sys
from importlib import import_module

from ...data.errors import InputError
from ..terminal import UNUSABLE, complain

NAMES = ("depth", "eye", "falsify", "flood", "models", "occlusion", "occupancy", "papers", "scaling", "storage", "walk")


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark that is named. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m viewcell.workbench.bench")
    commands = parser.add_subparsers(dest="name", metavar="NAME", required=True)
    modules = {name: import_module(f".{name}", __package__) for name in NAMES}
    for name, module in modules.items():
        about = module.__doc__.splitlines()[0]
        module.add_arguments(commands.add_parser(name, help=about, description=about))
    options = parser.parse_args(arguments)
    try:
        return modules[options.name].run(options)
    except InputError as error:
        complain(str(error))
        return UNUSABLE


if __name__ == "__main__":
    sys.exit(main())
