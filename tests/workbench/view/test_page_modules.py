"""The viewer's modules: their own tests, which Node runs."""

import re
from pathlib import Path

import pytest
from builders.node import run_node

TESTS = sorted((Path(__file__).parent / "page").glob("*.test.mjs"))


@pytest.mark.parametrize("file", TESTS, ids=lambda path: path.name.partition(".")[0])
def test_a_module_does_what_its_tests_say(file):
    done = run_node("--test", "--test-reporter=tap", str(file))
    assert done.returncode == 0, done.stdout + done.stderr
    # No test at all would be a success, too.
    assert re.search(r"^# pass [1-9]", done.stdout, re.MULTILINE)
