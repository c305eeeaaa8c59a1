"""Faults that a reader might make, planted in a scene that was read well."""

from dataclasses import replace

from viewcell.data.scene import Definition, Mesh


def planted(scene, place: int) -> dict:
    """Scenes by fault: the object at `place` dropped, doubled, moved half a metre along X, or a triangle short."""
    placed = scene.objects[place]
    rest = [*scene.objects[:place], *scene.objects[place + 1 :]]
    to_scene = placed.transform.copy()
    to_scene[0, 3] += 0.5
    shapes = list(scene.definitions)
    shape = shapes[placed.definition_id]
    shapes[placed.definition_id] = Definition(shape.name, (Mesh(shape.lods[0].vertices, shape.lods[0].faces[:-1]),))
    return {
        "dropped": replace(scene, objects=rest),
        "doubled": replace(scene, objects=[*scene.objects, placed]),
        "moved": replace(scene, objects=[*rest, replace(placed, transform=to_scene)]),
        "short": replace(scene, definitions=shapes),
    }


# What a referee says of each, after the object's name.
SAID = {
    "dropped": "expected 1 object as a second reader finds, found 0 objects",
    "doubled": "expected 1 object as a second reader finds, found 2 objects",
    "moved": "expected the box",
    "short": "expected an area",
}
