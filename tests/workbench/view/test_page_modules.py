"""The viewer's modules: their own tests, which Node runs."""

from pathlib import Path

import pytest
from builders.node import run_module_tests

TESTS = sorted((Path(__file__).parent / "page").glob("*.test.mjs"))


@pytest.mark.parametrize("file", TESTS, ids=lambda path: path.name.partition(".")[0])
def test_a_module_does_what_its_tests_say(file):
    run_module_tests(file)
