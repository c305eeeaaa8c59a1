"""Files of kernels/ hold kernels; their arguments come in one order, and what is written is named so."""

import ast

import pytest
from builders.places import ROOT
from viewcell.kernels.flood import MAX_DEPTH as FLOOD_DEPTH
from viewcell.kernels.stab import LIST_CAPACITY

# `launch` launches what the others define.
FILES = [path for path in sorted((ROOT / "kernels").glob("*.py")) if path.stem not in ("__init__", "launch")]


def decorated(tree, kind):
    """Functions under @wp.kernel or @wp.func."""
    wanted = [f"wp.{kind}"]
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and [ast.unparse(d) for d in node.decorator_list] == wanted
    ]


def kernels_in(*folders):
    return [
        pytest.param(node, id=f"{path.stem}.{node.name}")
        for folder in folders
        for path in sorted((ROOT / folder).rglob("*.py"))
        # Files without one are not parsed: every process that collects tests comes by here.
        if "@wp.kernel" in (text := path.read_text(encoding="utf-8"))
        for node in decorated(ast.parse(text), "kernel")
    ]


def written(node):
    """Names whose items or fields' items a kernel's own body assigns."""
    found = set()
    for inner in ast.walk(node):
        targets = getattr(inner, "targets", [getattr(inner, "target", None)])
        for target in targets:
            if isinstance(target, ast.Subscript):
                base = target.value
                while isinstance(base, ast.Attribute | ast.Subscript):
                    base = base.value
                found.add(base.id)
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_files_define_a_kernel_or_a_func(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert decorated(tree, "kernel") or decorated(tree, "func")


@pytest.mark.parametrize("node", kernels_in("kernels", "verify"))
def test_outputs_come_last_and_are_named_so(node):
    names = [argument.arg for argument in node.args.args]
    outputs = [name for name in names if name.endswith("_out")]
    assert outputs and names[-len(outputs) :] == outputs
    # Scratch is written too; it stands between `slots` and the outputs.
    scratch = names[names.index("slots") + 1 : -len(outputs)] if "slots" in names else []
    assert written(node) & set(names) <= {*outputs, *scratch}


@pytest.mark.parametrize("node", kernels_in("kernels"))
def test_rows_come_after_the_inputs(node):
    """inputs, first, (last, slots, scratch,) outputs: as `launch_rows` and `launch_slots` pass them."""
    names = [argument.arg for argument in node.args.args]
    outputs = [name for name in names if name.endswith("_out")]
    place = names.index("first")
    rest = names[place : -len(outputs)]
    assert rest == ["first"] or (rest[:3] == ["first", "last", "slots"] and len(rest) > 3)


def test_lists_of_a_flood_have_room_for_its_deepest_sequence():
    """Source, portals and target: one row of each list per box."""
    assert FLOOD_DEPTH + 1 <= LIST_CAPACITY
