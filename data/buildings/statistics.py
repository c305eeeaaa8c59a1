"""Objects and polygons at each level of detail, as in Table 1 of Funkhouser et al. 1996."""

from dataclasses import dataclass

import numpy as np

from ..scene import Scene

LEVELS = ("Low", "MedLow", "Medium", "MedHigh", "High")


@dataclass(frozen=True)
class LevelStatistic:
    """One row: the objects that have a level, and the polygons that show them at it.

    Attributes:
        level: Low is the coarsest; "All" is every object at its own finest level.
        minimum: fewest polygons of an object; 0 where there is none.
        maximum: most polygons of an object.
    """

    level: str
    objects: int
    polygons: int
    minimum: int
    mean: float
    maximum: int


def level_statistics(scene: Scene) -> list[LevelStatistic]:
    """Rows from the coarsest level to the finest that any object has, then "All"."""
    counts = [[len(mesh.faces) for mesh in reversed(shape.lods)] for shape in scene.definitions]
    placed = [counts[instance.definition_id] for instance in scene.objects]
    depth = max((len(levels) for levels in placed), default=0)
    names = [LEVELS[i] if i < len(LEVELS) else f"Level {i + 1}" for i in range(depth)]
    rows = [_row(name, [levels[i] for levels in placed if len(levels) > i]) for i, name in enumerate(names)]
    return [*rows, _row("All", [levels[-1] for levels in placed])]


def _row(level: str, polygons: list[int]) -> LevelStatistic:
    found = np.array(polygons or [0])
    return LevelStatistic(
        level, len(polygons), int(found.sum()), int(found.min()), float(found.mean()), int(found.max())
    )
