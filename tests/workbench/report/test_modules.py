"""Modules joined to one script: after what they import, and refused where the script would mean something else."""

import pytest
from viewcell.workbench.report.modules import join_modules

BASE = """// The base.
export const ONE = 1;
function hidden() {
  return ONE;
}
export const two = () => hidden() + ONE;
"""
LEFT = 'import { ONE } from "./base.mjs";\n\nexport class Left {\n  value = ONE;\n}\n'
RIGHT = 'import {\n  ONE,\n  two,\n} from "./base.mjs";\nexport async function right() {\n  return ONE + two();\n}\n'
MAIN = 'import { Left } from "./left.mjs";\nimport { right } from "./right.mjs";\n\nright(new Left());\n'
MODULES = {"base.mjs": BASE, "left.mjs": LEFT, "right.mjs": RIGHT, "main.mjs": MAIN}


def joined(folder, changed=()):
    for name, text in (MODULES | dict(changed)).items():
        (folder / name).write_text(text, encoding="utf-8")
    return join_modules(folder, "main.mjs")


def test_modules_stand_once_after_what_they_import_without_imports_and_exports(tmp_path):
    bodies = [
        BASE.replace("export ", ""),
        "\nclass Left {\n  value = ONE;\n}\n",
        "async function right() {\n  return ONE + two();\n}\n",
        "\nright(new Left());\n",
    ]
    assert joined(tmp_path) == '"use strict";\n(() => {\n' + "\n".join(bodies) + "})();\n"


def test_the_order_is_that_of_the_imports_alone(tmp_path):
    turned = MAIN.split("\n")
    text = joined(tmp_path, {"main.mjs": "\n".join([turned[1], turned[0], *turned[2:]])})
    assert text.index("ONE = 1") < text.index("function right") < text.index("class Left") < text.index("right(new")


@pytest.mark.parametrize(
    ("module", "text", "complaint"),
    [
        # One name twice: among two modules, in one, and of a function that no other module sees.
        ("left.mjs", LEFT + "const two = 2;\n", r"left\.mjs: expected names of its own, found two of base\.mjs"),
        ("left.mjs", LEFT + "let Left;\n", r"left\.mjs: expected names of its own, found Left of left\.mjs"),
        ("right.mjs", RIGHT + "function hidden() {}\n", r"right\.mjs: expected names of its own, found hidden of base"),
        # Rings.
        ("base.mjs", 'import { Left } from "./left.mjs";\n' + BASE, r"main\.mjs > left\.mjs > base\.mjs > left"),
        ("base.mjs", 'import { two } from "./base.mjs";\n' + BASE, r"ring .* left\.mjs > base\.mjs > base\.mjs"),
        # What is not exported, or not there.
        ("left.mjs", LEFT.replace("ONE }", "hidden }"), r"left\.mjs: expected exports of base.*, found hidden"),
        ("left.mjs", LEFT.replace("ONE }", "ONE as one }"), r"left\.mjs: expected exports of base.*, found ONE as one"),
        ("left.mjs", LEFT.replace("ONE }", "ONE, ONLY }"), r"left\.mjs: expected exports of base.*, found ONLY"),
        # Lines that would be left as they are, or names that would not be seen.
        ("left.mjs", 'import * as base from "./base.mjs";\n', r"left\.mjs: expected .*, found import \* as base"),
        ("left.mjs", 'import "./base.mjs";\n' + LEFT, r'left\.mjs: expected .*, found import "\./base'),
        ("left.mjs", 'import { readFile } from "node:fs";\n' + LEFT, r"left\.mjs: expected .*, found import { read"),
        ("left.mjs", LEFT + "export default Left;\n", r"left\.mjs: expected .*, found export default"),
        ("left.mjs", LEFT + "export { Left };\n", r"left\.mjs: expected .*, found export { Left"),
        ("left.mjs", LEFT + "const A = 1,\n  two = 2;\n", r"left\.mjs: expected .*, found const A = 1,"),
        ("left.mjs", LEFT + "const { two } = {};\n", r"left\.mjs: expected .*, found const { two }"),
        ("left.mjs", LEFT + "let [two] = [];\n", r"left\.mjs: expected .*, found let \[two\]"),
        ("left.mjs", LEFT + "var two = 2;\n", r"left\.mjs: expected .*, found var two"),
        ("left.mjs", LEFT + "export async function* two() {}\n", r"left\.mjs: expected .*, found async function\* two"),
    ],
)
def test_what_would_mean_something_else_is_refused(tmp_path, module, text, complaint):
    assert text != MODULES[module]
    with pytest.raises(ValueError, match=complaint):
        joined(tmp_path, {module: text})


def test_a_missing_module_is_an_error(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.mjs"):
        joined(tmp_path, {"left.mjs": LEFT.replace("base", "none")})
