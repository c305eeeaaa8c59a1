"""Where an IFC file says that things are: the storey that they are contained in, are parts of, or fill a hole on."""

from collections.abc import Iterator

from ..scene import NamedStorey

# Inverse attributes that lead upwards, and what each relation leads to. In IFC2x3 nesting decomposes, too.
UPWARDS = (
    ("ContainedInStructure", "RelatingStructure"),
    ("Decomposes", "RelatingObject"),
    ("Nests", "RelatingObject"),
    ("FillsVoids", "RelatingOpeningElement"),
    ("VoidsElements", "RelatingBuildingElement"),
)


class Places:
    """Storeys of a file's products.

    Attributes:
        metres: length of the file's unit [m].
    """

    def __init__(self, metres: float) -> None:
        """Take the length of the file's unit [m]."""
        self.metres = metres

    def storey_of(self, product: object) -> NamedStorey | None:
        """The nearest IfcBuildingStorey upwards, by containment before all else; None if there is none."""
        # A file may relate things in circles.
        rank, seen = [product], {product.id()}
        while rank:
            above = []
            for one in (one for below in rank for one in _above(below)):
                if one.is_a("IfcBuildingStorey"):
                    return self._named(one)
                if one.id() not in seen:
                    seen.add(one.id())
                    above.append(one)
            rank = above
        return None

    def _named(self, storey: object) -> NamedStorey:
        stated = storey.Elevation
        name = storey.Name or storey.GlobalId or f"#{storey.id()}"
        return NamedStorey(name, None if stated is None else float(stated) * self.metres)


def _above(entity: object) -> Iterator[object]:
    """What an entity is directly in, or part of."""
    for inverse, way in UPWARDS:
        for link in getattr(entity, inverse, None) or ():
            up = getattr(link, way, None)
            if up is not None:
                yield up
