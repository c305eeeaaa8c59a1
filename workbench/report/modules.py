"""ES modules as one classic script, because a page opened from a file may load no other file."""

import re
from importlib.resources.abc import Traversable

IMPORT = re.compile(r'^import \{([^}]*)\} from "\./([\w.-]+)";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:async |class |const |function |let ))", re.MULTILINE)
DECLARED = re.compile(r"^(export )?(?:async )?(?:class|const|function|let) ([$\w]+)", re.MULTILINE)
# What the three above would misread: other imports and exports, and declarations of several names at once.
UNREAD = re.compile(r"^(?:import|export|var|(?:const|let) (?:[^$\w]|[^\n]*,$)|(?:async )?function\*).*", re.MULTILINE)


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
    # Of every name at top level its module, and whether others may import it.
    owners: dict[str, tuple[str, bool]] = {}

    def add(module: str, above: tuple[str, ...]) -> None:
        if module in above:
            raise ValueError(f"expected no ring of imports, found {' > '.join([*above, module])}")
        if module in bodies:
            return
        text = (folder / module).read_text("utf-8")
        for names, other in IMPORT.findall(text):
            add(other, (*above, module))
            asked = [name.strip() for name in names.split(",") if name.strip()]
            if missing := [name for name in asked if owners.get(name) != (other, True)]:
                raise ValueError(f"{module}: expected exports of {other}, found {', '.join(missing)}")
        body = IMPORT.sub("", text)
        for export, name in DECLARED.findall(body):
            if name in owners:
                raise ValueError(f"{module}: expected names of its own, found {name} of {owners[name][0]}")
            owners[name] = module, bool(export)
        bodies[module] = EXPORT.sub("", body)
        if found := UNREAD.search(bodies[module]):
            raise ValueError(f"{module}: expected one name a declaration and import {{ names }}, found {found[0]}")

    add(first, ())
    return '"use strict";\n(() => {\n' + "\n".join(bodies.values()) + "})();\n"
