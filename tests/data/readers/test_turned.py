import numpy as np
import pytest
from viewcell.data.readers.assemble import Model, Part
from viewcell.data.readers.turned import note_turned, wall_yaw
from viewcell.data.scene import Role

WALL = np.array([[0, 0, 0], [4, 0, 0], [4, 0, 3], [0, 0, 3]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def turned(angle_deg: float, length: float = 1.0) -> np.ndarray:
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return (WALL * [length, 1, 1]) @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])


@pytest.mark.parametrize(("angle_deg", "yaw_deg"), [(0, 0), (30, 30), (-30, -30), (60, -30), (90, 0), (200, 20)])
def test_walls_stand_as_they_are_turned(angle_deg, yaw_deg):
    along, yaw = wall_yaw([(turned(angle_deg), FACES)])
    assert np.degrees(yaw) == pytest.approx(yaw_deg, abs=0.01)
    assert along == (1.0 if yaw_deg == 0 else 0.0)


def test_the_larger_area_outweighs():
    along, yaw = wall_yaw([(turned(10, 3.0), FACES), (turned(100), FACES), (turned(0), FACES)])
    assert along == pytest.approx(0.2) and np.degrees(yaw) == pytest.approx(10)


def test_floors_stand_nowhere():
    assert wall_yaw([(WALL[:, [0, 2, 1]], FACES)]) is None and wall_yaw([]) is None


@pytest.mark.parametrize(
    ("angle_deg", "role", "count"), [(30, Role.OCCLUDER, 1), (0, Role.OCCLUDER, 0), (30, Role.DETAIL, 0)]
)
def test_only_oblique_walls_are_noted(angle_deg, role, count):
    model = Model("a", "", "metre", 0.001)
    model.parts.append(Part("wall", "Mesh", role, 0, turned(angle_deg), FACES, np.eye(4)))
    note_turned(model)
    assert len(model.notes) == count
