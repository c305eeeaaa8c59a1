import numpy as np
from viewcell.data.buildings.furnish import turned
from viewcell.data.buildings.shapes import block
from viewcell.data.buildings.works import Works
from viewcell.data.scene import Role

BOX = block((0.0, 0.0, 0.0), (2.0, 1.0, 3.0))


def test_equal_meshes_share_a_definition():
    works = Works()
    for name in ("a", "b"):
        works.put("IfcWall", name, BOX, turned(np.zeros(3), 0.3))
    works.put("IfcDoor", "c", block((0.0, 0.0, 0.0), (2.0, 1.0, 2.0)), np.eye(4), Role.TRANSPARENT)
    assert [placed.definition_id for placed in works.objects] == [0, 0, 1] and len(works.definitions) == 2


def test_a_part_is_taken_into_its_frame():
    part = Works()
    part.put("IfcWall", "wall", BOX, turned(np.array([1.0, 0.0, 0.0]), 0.0))
    part.room("room", BOX, np.eye(4))
    part.open(np.array([[0.0, 0, 0], [2, 1, 3]]), np.eye(4))
    works = Works()
    for name in ("A ", "B "):
        works.take(part.scene("part"), turned(np.array([10.0, 0, 0]), np.pi / 2), name)
    scene = works.scene("whole")
    assert [placed.name for placed in scene.objects] == ["A wall", "B wall"] and len(scene.definitions) == 1
    assert [space.name for space in scene.spaces] == ["A room", "B room"] and scene.source == "whole"
    np.testing.assert_allclose(scene.object_bounds()[1] * scene.grid_m, [[9, 1, 0], [10, 3, 3]])
    np.testing.assert_allclose(scene.openings[1], [[9, 0, 0], [10, 2, 3]])
    np.testing.assert_allclose(scene.spaces[1].vertices.max(axis=0), [10, 2, 3])
