"""What a user writes: every public name, as type checkers and editors see it. `test_checkers.py` has it checked."""

import sys
from pathlib import Path

import numpy as np
import viewcell
from viewcell import Bake, InputError, Scene, Settings, Verdict


def baked(model: Path, out: Path) -> Bake:
    """A bake of a model, with settings by name."""
    bake: Bake = viewcell.bake(model, out, doors="closed", certify=False, budget_s=60.0, overwrite=True)
    again: Bake = viewcell.bake(model, out, settings=Settings(doors="closed"), threads=2, device="cpu", progress=True)
    return again if again.graph.cell_count else bake


def rooms_that_see(bake: Bake, name: str) -> list[str]:
    """Names of rooms that may see a room."""
    names: list[str] = bake.rooms["name"].to_pylist()
    lobby: set[int] = set(bake.cells_of(name).tolist())
    return [other for other in names if lobby & set(bake.potential(other).tolist())]


def numbers(bake: Bake, point: tuple[float, float, float]) -> dict[str, int]:
    """How much is seen from a point."""
    cell: int = bake.cell_at(point)
    potential: np.ndarray = bake.potential(point)
    seen, unknown = bake.seen(cell), bake.unknown(cell)
    witness = bake.witness(cell, int(seen[0])) if len(seen) else None
    if witness is not None:
        print(witness.origin + witness.end, witness.cell, witness.object_id)
    return {"potential": len(potential), "seen": len(seen), "unknown": len(unknown)}


def judged(bake: Bake, scene: Scene, claimed: np.ndarray) -> bool:
    """Whether a bake, and somebody else's sets, stand."""
    found = bake.verify(rays=100_000, seed=1)
    page: Path = bake.report(cells=[0, 1])
    print(viewcell.view(bake, overwrite=True).page, bake.view("view").page)
    result = viewcell.check(scene, claimed, bake, rays=10_000, targets="objects")
    viewcell.assert_conservative(claimed, scene, bake, rays=10_000)
    print(found.table(), page, result.table(10), viewcell.inspect(scene).text())
    return found.ok and result.ok


def main() -> int:
    """Bake an office and ask."""
    scene: Scene = viewcell.make_office(floors=1, rooms_per_side=2)
    try:
        bake = viewcell.load(sys.argv[1])
    except InputError as error:
        print(error)
        return 2
    verdict: Verdict = Verdict.UNKNOWN
    print(verdict.word, bake.objects.to_pandas(), rooms_that_see(bake, "lobby"), numbers(bake, (1.0, 2.0, 1.5)))
    print(viewcell.read("house.ifc").source, viewcell.__version__, viewcell.report(bake))
    return 0 if judged(bake, scene, np.ones((3, 3), bool)) else 1


if __name__ == "__main__":
    sys.exit(main())
