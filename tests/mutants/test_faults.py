"""The list of faults stays true: each has its place in the source, once, and tests that are there."""

import ast

import pytest
from builders.places import ROOT
from mutants.run import load_faults

FAULTS = load_faults()


def test_there_are_many_faults():
    assert len(FAULTS) >= 90 and len({(fault.file, fault.name) for fault in FAULTS}) == len(FAULTS)
    assert len({(fault.file, fault.after, fault.old, fault.new) for fault in FAULTS}) == len(FAULTS)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: f"{fault.file}: {fault.name}")
def test_a_fault_has_its_place_and_its_tests(fault):
    source = (ROOT / fault.file).read_text(encoding="utf-8")
    planted = fault.planted(source)
    assert planted is not None, f"expected {fault.old!r} once, or next after {fault.after!r}"
    assert planted != source and "\n" not in fault.old + fault.new
    ast.parse(planted)
    assert fault.tests
    for target in fault.tests:
        path, *names = target.split("::")
        functions = [n.name for n in ast.parse((ROOT / path).read_text(encoding="utf-8")).body if hasattr(n, "name")]
        assert set(names) <= set(functions), f"{target} is not there"
