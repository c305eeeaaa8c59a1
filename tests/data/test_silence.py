"""What compiled libraries print is kept back, and nothing else."""

import os
import subprocess
import sys

import pytest
from viewcell.data.silence import silenced


@pytest.mark.parametrize("stream", [1, 2])
def test_compiled_libraries_are_silenced(capfd, stream):
    with silenced(stream):
        os.write(stream, b"from a library")
    os.write(stream, b"after it")
    assert capfd.readouterr()[stream - 1] == "after it"


def test_a_process_without_the_stream_is_left_alone():
    script = "import os; os.close(2); from viewcell.data.silence import silenced\nwith silenced(2): print('done')"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "done\n"


def test_python_users_hear_nothing_of_warp():
    """Neither a greeting nor that there is no GPU, when kernels are imported and used."""
    script = (
        "import numpy as np\nfrom viewcell.kernels.launch import CPU\nprint(CPU.zeros(3, float).numpy().tolist())\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "[0.0, 0.0, 0.0]\n" and done.stderr == ""
