"""Hard cases of whole bakes: a model file and a table of view cells."""

import tempfile
from collections.abc import Callable
from pathlib import Path

from ...data.readers import read
from ...data.scene import Role
from ...data.store.bake_folder import BakeFolder
from ...data.verdict import Verdict
from ...kernels.launch import Device
from ...verify.cases.hard_cases import HardCases, ModelCase, faces, fan
from ..bake.run import bake
from ..bake.settings import Settings
from .outcomes import Outcome, Outcomes, one_sided, two_sided, worst

# Names by which the mesh reader tells the roles.
KINDS = {Role.OCCLUDER: "IfcWall", Role.DETAIL: "IfcFurniture", Role.TRANSPARENT: "IfcWindow"}


def write_model(case: ModelCase, folder: Path) -> tuple[Path, Path]:
    """The case as a mesh file and a table of view cells, with the digits that give the same float64 back."""
    lines, count = [], 0
    for number, (role, shapes) in enumerate(case.objects):
        lines.append(f"o {number}|{KINDS[Role(role)]}|")
        for triangle in (t for shape in shapes for face in faces(shape) for t in fan(face)):
            lines += [f"v {' '.join(map(repr, corner))}" for corner in triangle]
            lines.append(f"f {count + 1} {count + 2} {count + 3}")
            count += 3
    model, cells = folder / "model.obj", folder / "cells.csv"
    model.write_text("\n".join(lines) + "\n", encoding="utf-8")
    rows = [",".join(map(repr, [*low, *high])) for low, high in case.cells]
    cells.write_text("\n".join(["min_x,min_y,min_z,max_x,max_y,max_z", *rows]) + "\n", encoding="utf-8")
    return model, cells


def bakes_by(method: str) -> Callable[[HardCases, Device], Outcomes]:
    """Bakes of all models by a method."""

    def run(cases: HardCases, device: Device) -> Outcomes:
        for case in cases.model:
            with tempfile.TemporaryDirectory() as name:
                model, cells = write_model(case, Path(name))
                settings = Settings(method=method, cells=str(cells), yaw="0")
                made = bake(read(model), Path(name) / "out.bake", settings=settings, threads=1, device=device.name)
                yield case.name, _baked(case, made)

    return run


def _verdict(kept: bool, witnessed: bool) -> Verdict:
    return Verdict.VISIBLE if witnessed else Verdict.UNKNOWN if kept else Verdict.HIDDEN


def _baked(case: ModelCase, made: BakeFolder) -> Outcome:
    outcomes = []
    for cell, row in enumerate(made.potential_objects):
        witnessed = set(made.seen(cell).tolist())
        for target, kept in enumerate(row.tolist()):
            if (cell, target) in case.seen:
                outcomes.append(one_sided(not kept, hidden=False))
            else:
                outcomes.append(two_sided(_verdict(kept, target in witnessed), hidden=True))
    return worst(outcomes)
