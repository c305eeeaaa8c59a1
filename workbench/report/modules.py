"""ES modules as one classic script, because a page opened from a file may load no other file."""

import re
from importlib.resources.abc import Traversable

IMPORT = re.compile(r'^import \{([^}]*)\} from "\./([\w.-]+)";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:async |class |const |function |let ))", re.MULTILINE)
DECLARED = re.compile(r"^(export )?(?:async )?(?:class|const|function|let) ([$\w]+)", re.MULTILINE)
# What the three above would misread: other imports and exports, and declarations of several names at once.
UNREAD = re.compile(r"^(?:import|export|var|(?:const|let) (?:[^$\w]|[^\n]*,$)).*", re.MULTILINE)


def join_modules(folder: Traversable, first: str) -> str:
    """The module `first` and all that it imports in one function; each stands after what it imports.

    Args:
        folder: where the modules are; they import each other as `import { names } from "./module";`.
        first: the module that starts everything.

    Raises:
        ValueError: modules import each other in a ring, two declare one name, one imports what another does not export,
            or a line is not understood.
    """
    bodies: dict[str, str] = {}
    owners: dict[str, str] = {}
    exported: set[tuple[str, str]] = set()

    def add(module: str, above: tuple[str, ...]) -> None:
        if module in above:
            raise ValueError(f"expected no ring of imports, found {' > '.join([*above, module])}")
        if module in bodies:
            return
        text = (folder / module).read_text("utf-8")
        for names, other in IMPORT.findall(text):
            add(other, (*above, module))
            if missing := [n for n in re.findall(r"[^\s,][^,]*", names) if (other, n.strip()) not in exported]:
                raise ValueError(f"{module}: expected exports of {other}, found {', '.join(missing)}")
        body = IMPORT.sub("", text)
        for export, name in DECLARED.findall(body):
            if name in owners:
                raise ValueError(f"{module}: expected names of its own, found {name} of {owners[name]}")
            owners[name] = module
            if export:
                exported.add((module, name))
        body = EXPORT.sub("", body)
        if found := UNREAD.search(body):
            raise ValueError(f"{module}: expected one name a declaration and import {{ names }}, found {found[0]}")
        bodies[module] = body

    add(first, ())
    return '"use strict";\n(() => {\n' + "\n".join(bodies.values()) + "})();\n"
