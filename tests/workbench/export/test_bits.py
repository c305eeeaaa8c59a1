"""The bit matrix, read by the C header that comes with it."""

import subprocess

import numpy as np
import pytest
from builders.pages import blocks
from builders.places import ROOT
from viewcell import InputError
from viewcell.workbench.baked import load

PROGRAM = r"""
#include "viewcell_bits.h"
#include <stdio.h>
#include <stdlib.h>

/* For each point on stdin: the cell that holds it (-1: none), and a 0 or 1 for each object and one beyond. */
int main(int count, char **words) {
    FILE *file = fopen(words[1], "rb");
    static double data[1 << 16];
    size_t size = fread(data, 1, sizeof data, file);
    viewcell_sets sets;
    double x, y, z;
    if (count != 2 || viewcell_open(&sets, data, size)) return 3;
    while (scanf("%lf %lf %lf", &x, &y, &z) == 3) {
        int64_t row = viewcell_row(&sets, x, y, z);
        printf("%d ", row < 0 ? -1 : sets.cell[row].cell_id);
        for (uint32_t object = 0; object <= sets.objects; object++)
            putchar("01"[viewcell_potential(&sets, row, object)]);
        putchar('\n');
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def program(house, tmp_path_factory):
    """The compiled program and the file that it reads."""
    folder = tmp_path_factory.mktemp("bits")
    load(house.folder).export("bits", folder / "house.bits")
    (folder / "read.c").write_text(PROGRAM)
    # Unused functions of a header are no fault of who includes it.
    flags = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-Wno-unused-function"]
    subprocess.run(["cc", *flags, "-o", folder / "read", folder / "read.c"], check=True)
    return folder / "read", folder / "house.bits"


def asked(program, points):
    lines = "\n".join(" ".join(f"{c:.17g}" for c in point) for point in points)
    done = subprocess.run(program, input=lines, capture_output=True, text=True, check=True)
    return [(int(cell), [bit == "1" for bit in bits]) for cell, bits in map(str.split, done.stdout.splitlines())]


def test_c_finds_the_cell_and_its_set(house, program):
    bake = load(house.folder)
    cells = np.flatnonzero(bake.graph.inhabitable)
    middle = bake.in_model(bake.graph.cells[cells].mean(axis=1) * bake.grid_m)
    around = np.random.default_rng(3).uniform(middle.min(axis=0) - 4, middle.max(axis=0) + 4, (300, 3))
    points = np.concatenate([middle, around])
    found = asked(program, points)
    seen = set()
    for point, (cell, bits) in zip(points, found, strict=True):
        assert bits[-1]
        if cell < 0:
            # Outside: everything is to be drawn.
            assert all(bits)
            with pytest.raises(InputError):
                bake.cell_at(point)
            continue
        seen.add(cell)
        assert cell == bake.cell_at(point)
        assert np.flatnonzero(bits[:-1]).tolist() == bake.potential(cell).tolist()
    assert seen == set(cells.tolist()) and len(seen) < len({cell for cell, _ in found})


@pytest.mark.parametrize("damage", [lambda d: d[:-1], lambda d: d + b"\0", lambda d: b"x" + d[1:], lambda d: d[:20]])
def test_c_refuses_what_is_no_whole_file(program, tmp_path, damage):
    broken = tmp_path / "broken.bits"
    broken.write_bytes(damage(program[1].read_bytes()))
    assert subprocess.run([program[0], broken], input="", text=True, check=False).returncode == 3


def test_the_guides_lines_of_c_compile(program):
    (lines,) = blocks(ROOT / "docs/guides/export.md", "c")
    head = '#include "viewcell_bits.h"\nvoid draw(uint32_t);\nstruct point { double x, y, z; };\n'
    code = f"{head}int look(const void *data, uint64_t size, struct point eye) {{\n{lines}\nreturn 0; }}\n"
    command = ["cc", "-std=c99", "-Wall", "-Werror", "-fsyntax-only", "-xc", "-"]
    subprocess.run(command, input=code, text=True, check=True, cwd=program[0].parent)
