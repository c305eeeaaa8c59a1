"""The reference names all that is public of `viewcell`, and its commands come from the parser that runs."""

import re
from importlib import import_module

import viewcell
from builders.places import ROOT
from viewcell.workbench import cli

REFERENCE = ROOT / "docs" / "reference"


def test_every_public_name_has_its_docstring_on_the_page():
    page = (REFERENCE / "python.md").read_text(encoding="utf-8")
    named = re.findall(r"^\.\. auto\w+:: viewcell\.(\w+)$", page, re.MULTILINE)
    assert sorted(named) == sorted(viewcell.__all__)


def test_commands_come_from_the_parser():
    page = (REFERENCE / "commands.md").read_text(encoding="utf-8")
    module, name = re.search(r":module: (\S+)\n:func: (\S+)", page).groups()
    assert getattr(import_module(module), name) is cli.parser
