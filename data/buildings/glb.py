"""Scenes as glTF, for other people's viewers."""

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..scene import Role, Scene

Z_UP_TO_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
# Colours by role; doors stay opaque in colour, so that a reader can still be asked to close them.
COLOURS = {
    "wall": (0.85, 0.83, 0.78, 1.0),
    "furniture": (0.55, 0.4, 0.28, 1.0),
    "door": (0.45, 0.55, 0.6, 1.0),
    "glass": (0.6, 0.8, 0.9, 0.3),
}


def write_glb(scene: Scene, path: str | Path) -> None:
    """Write the finest level of every object, Y up as glTF demands, in metres from the scene's origin.

    Each definition and material is one mesh, each object one node, named `object_id|kind|name`: `read` gets kinds and
    roles back from it. Spaces, openings and coarser levels are not written.

    Raises:
        InputError: the scene has no objects, or the file cannot be written.
    """
    if not scene.objects:
        raise InputError(f"{path}: expected objects to write, found an empty scene")
    import trimesh

    materials = {
        name: trimesh.visual.material.PBRMaterial(
            name=name,
            baseColorFactor=colour,
            alphaMode="OPAQUE" if colour[3] == 1.0 else "BLEND",
            metallicFactor=0.0,
            doubleSided=True,
        )
        for name, colour in COLOURS.items()
    }
    model = trimesh.Scene()
    for object_id, placed in enumerate(scene.objects):
        material = material_name(placed.role, placed.kind)
        shape = f"{placed.definition_id} {material}"
        if shape not in model.geometry:
            finest = scene.definitions[placed.definition_id].lods[0]
            visual = trimesh.visual.TextureVisuals(material=materials[material])
            model.geometry[shape] = trimesh.Trimesh(finest.vertices, finest.faces, visual=visual, process=False)
        # Straight into the graph: `add_geometry` looks through all nodes for each new one.
        model.graph.update(
            frame_from=model.graph.base_frame,
            frame_to=f"{object_id}|{placed.kind}|{placed.name}",
            matrix=Z_UP_TO_Y_UP @ placed.transform,
            geometry=shape,
        )
    try:
        Path(path).write_bytes(model.export(file_type="glb"))
    except OSError as error:
        raise InputError(f"{path}: expected to be able to write there, found {error.strerror}") from None


def material_name(role: Role, kind: str) -> str:
    """Which of COLOURS an object gets that has none of its own."""
    if role is Role.TRANSPARENT:
        return "door" if "Door" in kind else "glass"
    return "wall" if role is Role.OCCLUDER else "furniture"
