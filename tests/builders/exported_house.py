"""The turned house far from its file's zero, with what exports must keep apart: colours, mirrors, shears, GUIDs."""

from dataclasses import replace

import numpy as np
from viewcell.data.scene import Definition, Instance, Mesh, NamedStorey, Role, turned

from builders import random_solids, turned_house

ORIGIN = (1000.0, -2000.0, 30.0)
RED, GREEN = (200, 30, 10, 255), (20, 160, 90, 128)
# Stools of one shape: in the corner behind the wall with the door, one in each room; one mirrored, one sheared.
STOOLS = {
    "plain": ([3.5, 0.2, 0], np.eye(3)),
    "twin": ([4.4, 0.9, 0], np.eye(3)),
    "mirrored": ([4.8, 0.2, 0], np.diag([-1.0, 2.0, 1.0])),
    "sheared": ([3.0, 0.2, 0], np.array([[1.0, 0, 0.5], [0, 1, 0], [0, 0, 1]])),
}


def exported_scene():
    scene = turned_house.turned_scene()
    scene.origin = np.array(ORIGIN)
    walls = len(turned_house.WALLS)
    for number, placed in enumerate(scene.objects):
        kind = "IfcWall" if number < walls else "IfcFurniture"
        guid = f"guid-{number}" if number % 2 else ""
        scene.objects[number] = replace(placed, name=f"{kind} “{number}”", kind=kind, guid=guid)
    box = random_solids.box([0, 0, 0], [0.25, 0.25, 0.5])
    # Every other triangle is red.
    colours = np.array([RED, GREEN] * 6, np.uint8)
    stool, pane = len(scene.definitions), len(scene.definitions) + 1
    faces = np.array(box.faces, np.int32)
    scene.definitions.append(Definition("stool", (Mesh(np.array(box.vertices), faces, colours=colours),)))
    scene.definitions.append(Definition("plain box", (Mesh(np.array(box.vertices), faces),)))
    turn = turned(np.eye(3), turned_house.YAW_DEG).T
    for name, (at, linear) in STOOLS.items():
        scene.objects.append(_placed(name, stool, turn @ linear, turn @ at, Role.DETAIL))
    # One shape without colours, as furniture and as glass.
    for name, at, role in (("case", [3.0, 1.0, 0], Role.DETAIL), ("glass", [3.0, 1.5, 0], Role.TRANSPARENT)):
        scene.objects.append(_placed(name, pane, turn, turn @ at, role))
    # A shape without faces.
    scene.definitions.append(Definition("none", (Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32)),)))
    scene.objects.append(_placed("nothing", pane + 1, np.eye(3), np.zeros(3), Role.DETAIL))
    return scene


def _placed(name, definition, linear, at, role):
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = linear, at
    return Instance(
        name, "IfcFurniture", definition, transform, role, f"guid-{name}", storey=NamedStorey("Ground", 0.0)
    )
