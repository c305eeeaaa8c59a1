"""Help, examples, defaults and completion of every command."""

import argparse
import shlex
import subprocess
import sys

import pytest
from viewcell.workbench import commands
from viewcell.workbench.cli import _with_solver
from viewcell.workbench.options.common import FILES, FOLDERS
from viewcell.workbench.options.parser import GROUPS, parser


def below(of, name="viewcell"):
    """Every parser by its command line, from the top."""
    yield name, of
    for action in of._actions:
        if isinstance(action, argparse._SubParsersAction):
            for word, sub in action.choices.items():
                yield from below(sub, f"{name} {word}")


PARSERS = dict(below(parser()))
LEAVES = {name: one for name, one in PARSERS.items() if "run" in one._defaults}


def test_help_tells_of_every_command_in_its_group():
    text = parser().format_help()
    assert sum(map(len, GROUPS.values())) == len({name.split()[1] for name in PARSERS if " " in name})
    for group in GROUPS:
        assert f"\n{group}:\n" in text
    for name in PARSERS:
        if name.count(" ") == 1:
            assert f"\n  {name.split()[1]} " in text
    assert "positional arguments" not in text and text.startswith("usage: viewcell [-h] [-V]")


@pytest.mark.parametrize("name", LEAVES)
def test_help_is_in_sentences_with_examples_that_can_be_read(name):
    one = LEAVES[name]
    assert one.description.endswith(".") and callable(getattr(commands, one._defaults["run"]))
    examples = [line.strip() for line in one.epilog.splitlines()[1:]]
    assert examples
    for example in examples:
        told, *arguments = shlex.split(example)
        read = parser().parse_args(_with_solver(arguments))
        assert told == "viewcell" and read.run == one._defaults["run"], example
    for line in one.format_help().split("\n\n"):
        if line.startswith("options:"):
            assert line.rstrip().endswith(".")


@pytest.mark.parametrize("name", LEAVES)
def test_options_state_their_defaults(name):
    for action in LEAVES[name]._actions:
        assert action.help, f"{name} {action.dest}"
        if action.option_strings and action.default not in (None, False, [], argparse.SUPPRESS):
            assert "default" in action.help, f"{name} {action.option_strings}"


def test_results_for_programs_are_had_where_they_are_promised():
    told = {
        name.split()[1] for name, one in LEAVES.items() if any(a.dest == "json" and a.nargs == 0 for a in one._actions)
    }
    assert told == {"bake", "verify", "check", "inspect", "report", "walk"}


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_shells_complete_commands_options_and_files(shell):
    done = subprocess.run(
        [sys.executable, "-m", "viewcell", "--print-completion", shell], capture_output=True, text=True, check=True
    )
    for word in ("projection-point", "--refine-kept", "rotunda", "--3dtiles"):
        assert word in done.stdout
    found = {getattr(action, "complete", None) is not None for one in LEAVES.values() for action in one._actions
             if action.metavar in (*FILES, *FOLDERS)}  # fmt: skip
    assert found == {True}
