"""Plant the faults of faults.toml, one at a time, in a copy of the package, and tell which the tests do not see.

    python tests/mutants/run.py [--only PART OF A NAME] [--jobs N]

Exits 1 if a fault survives without a written reason, is caught in spite of one, breaks more than it should (a kernel
that no longer compiles proves nothing about tests), takes too long, or has lost its place in the source.
"""

import argparse
import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FAULTS = Path(__file__).with_name("faults.toml")
LEFT_BEHIND = shutil.ignore_patterns(".*", "out", "build", "dist", "__pycache__", "*.egg-info")
# A text that stands in several places is told apart by an earlier line (`after`), at most so many characters before it.
REACH = 1000
TIME_S = 600.0
# What says that the fault is no fault but nonsense.
NONSENSE = ("WarpCodegen", "SyntaxError", "NameError", "IndentationError", "Error while parsing")


@dataclass(frozen=True)
class Fault:
    """One wrong line.

    Attributes:
        name: what is wrong.
        file: relative to the package.
        old: text that is there once; or, with `after`, the first such text that follows.
        new: what is there instead.
        tests: pytest targets of which one must fail.
        after: text that is there once, near before `old`.
        survives: why no test can see it, or need.
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    after: str = ""
    survives: str = ""

    def planted(self, source: str) -> str | None:
        """The source with the fault; None if its place is not found, or not only once."""
        begin = 0
        if self.after:
            if source.count(self.after) != 1:
                return None
            begin = source.index(self.after) + len(self.after)
        elif source.count(self.old) != 1:
            return None
        at = source.find(self.old, begin, begin + REACH if self.after else None)
        return None if at < 0 else source[:at] + self.new + source[at + len(self.old) :]


def load_faults() -> list[Fault]:
    """The list; KeyError or TypeError where an entry is not as `Fault` says."""
    found = []
    for file, group in tomllib.loads(FAULTS.read_text(encoding="utf-8")).items():
        for name, fault in group.items():
            tests = fault.pop("tests")
            found.append(Fault(name, file, tests=tuple([tests] if isinstance(tests, str) else tests), **fault))
    return found


class Copy:
    """A copy of the package in a folder of its own, and its tests run there."""

    def __init__(self, folder: Path, cache: Path) -> None:
        self.root = folder / "viewcell"
        shutil.copytree(ROOT, self.root, ignore=LEFT_BEHIND)
        # Bytecode is known by the second and the size of its source, which a fault need not change.
        self._env = os.environ | {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1", "CI": "1"}
        self._env |= {"WARP_CACHE_PATH": str(cache), "HYPOTHESIS_PROFILE": "ci"}
        found = self._run("-c", "import viewcell; print(viewcell.__file__)")[1].split()[-1]
        if Path(found).resolve().parent != self.root.resolve():
            sys.exit(f"expected viewcell to be imported from {self.root}, found {found}")

    def test(self, targets: tuple[str, ...]) -> tuple[int | None, str]:
        """Exit status (None: took too long) and output of pytest; slow tests are run if they are named."""
        return self._run("-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "not gpu", *targets)

    def _run(self, *arguments: str) -> tuple[int | None, str]:
        command = [sys.executable, *arguments]
        made = subprocess.Popen(
            command,
            cwd=self.root,
            env=self._env,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            return (made.communicate(timeout=TIME_S)[0], made.returncode)[::-1]
        except subprocess.TimeoutExpired:
            os.killpg(made.pid, signal.SIGKILL)
            made.wait()
            return None, ""

    def outcome(self, fault: Fault) -> str:
        """What becomes of a fault: caught, survived, stale, nonsense or time-out."""
        path = self.root / fault.file
        source = path.read_text(encoding="utf-8")
        planted = fault.planted(source)
        if planted is None:
            return "stale"
        path.write_text(planted, encoding="utf-8")
        try:
            status, printed = self.test(fault.tests)
        finally:
            path.write_text(source, encoding="utf-8")
        if status is None:
            return "time-out"
        if status == 0:
            return "survived"
        return "caught" if status == 1 and not any(word in printed for word in NONSENSE) else "nonsense"


def main(arguments: list[str] | None = None) -> int:
    """Command line; exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", default="", help="faults whose name or file holds this text")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    parser.add_argument("--jobs", type=int, default=cores, help="faults tried at a time")
    options = parser.parse_args(arguments)
    faults = [fault for fault in load_faults() if options.only in f"{fault.file} {fault.name}"]
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        cache = Path(folder) / "kernels"
        copies: queue.Queue[Copy] = queue.Queue()
        for number in range(min(options.jobs, max(1, len(faults)))):
            copies.put(Copy(Path(folder) / str(number), cache))
        whole = copies.get()
        status, printed = whole.test(tuple(sorted({test for fault in faults for test in fault.tests})))
        if status != 0:
            print(printed, "expected the tests to pass without a fault, found otherwise", sep="\n")
            return 1
        copies.put(whole)

        def try_one(fault: Fault) -> tuple[Fault, str]:
            copy, start = copies.get(), time.perf_counter()
            outcome = copy.outcome(fault)
            copies.put(copy)
            print(f"{outcome:9} {time.perf_counter() - start:5.0f} s  {fault.file}: {fault.name}", flush=True)
            return fault, outcome

        with ThreadPoolExecutor(copies.qsize()) as pool:
            outcomes = list(pool.map(try_one, faults))
    wrong = [(fault, outcome) for fault, outcome in outcomes if outcome != ("survived" if fault.survives else "caught")]
    print(f"{len(faults)} faults, {sum(outcome == 'caught' for _, outcome in outcomes)} caught")
    for fault, outcome in outcomes:
        if fault.survives and outcome == "survived":
            print(f"survives: {fault.file}: {fault.name}: {fault.survives}")
    for fault, outcome in wrong:
        print(f"{outcome}: {fault.file}: {fault.name}; tests: {' '.join(fault.tests)}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
