"""What a gbXML file says in words, anywhere in it: storeys, and materials by way of constructions and layers."""

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field, replace

from ..scene import NamedStorey
from .assemble import Part


@dataclass(frozen=True)
class Node:
    """An element whose children are asked for by name, in any namespace: tools that mend files add some without one."""

    element: ElementTree.Element

    def all(self, *way: str) -> list["Node"]:
        """Elements at the end of a way of names."""
        return [Node(one) for one in self.element.findall("/".join("{*}" + name for name in way))]

    def text(self, name: str) -> str:
        """Text of the child of a name; empty if there is none."""
        return (self.element.findtext("{*}" + name) or "").strip()

    def get(self, name: str) -> str:
        """An attribute; empty if there is none."""
        return self.element.get(name, "")


@dataclass
class Words:
    """Storeys, constructions and materials, which may stand after what names them.

    Attributes:
        metres: length of the file's unit [m].
        storeys: by id.
        spaces: id of the storey of each space, by its id.
        layers, materials: ids of the layers of each construction, and of the materials of each layer.
        names: of materials, by id.
    """

    metres: float
    storeys: dict[str, NamedStorey] = field(default_factory=dict)
    spaces: dict[str, str] = field(default_factory=dict)
    layers: dict[str, list[str]] = field(default_factory=dict)
    materials: dict[str, list[str]] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)

    def gather(self, kind: str, node: Node) -> None:
        """Take an element of a kind that says something; a storey's height that is no number counts as none."""
        key = node.get("id")
        if kind == "BuildingStorey":
            try:
                level = float(node.text("Level")) * self.metres
            except ValueError:
                level = math.nan
            self.storeys[key] = NamedStorey(node.text("Name") or key, level if math.isfinite(level) else None)
        elif kind == "Space":
            self.spaces[key] = node.get("buildingStoreyIdRef")
        elif kind == "Construction":
            self.layers[key] = [one.get("layerIdRef") for one in node.all("LayerId")]
        elif kind == "Layer":
            self.materials[key] = [one.get("materialIdRef") for one in node.all("MaterialId")]
        elif kind == "Material":
            self.names[key] = node.text("Name") or key

    def storey_of(self, *spaces: str) -> NamedStorey | None:
        """The storey of spaces; None where they have none, or not all the same."""
        found = {self.spaces.get(space, "") for space in spaces}
        return self.storeys.get(found.pop()) if len(found) == 1 else None

    def told(self, part: Part, spaces: tuple[str, ...], construction: str) -> Part:
        """A part with its storey, that of the spaces beside it, and the materials of its construction."""
        materials = [one for layer in self.layers.get(construction, []) for one in self.materials.get(layer, [])]
        names = dict.fromkeys(self.names[one] for one in materials if one in self.names)
        return replace(part, storey=self.storey_of(*spaces), materials=tuple(names))
