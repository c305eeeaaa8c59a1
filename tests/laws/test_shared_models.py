from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from builders.places import SHARED
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.scene import GRID_M, Role
from viewcell.data.store.scene_folder import read_scene, write_scene

SCENES = SHARED / "scenes"
pytestmark = pytest.mark.skipif(not SCENES.is_dir(), reason="no shared scenes folder beside the checkout")

IFC = {  # objects, spaces, openings, some roles
    "threerooms_sb": (29, 4, 11, {"IfcWall": "occluder", "IfcFurniture": "detail", "IfcDoor": "transparent"}),
    "kit_edc_sb": (264, 58, 143, {"IfcSlabStandardCase": "occluder", "IfcDoorStandardCase": "transparent"}),
}
IFC_SLOW = {
    "ac11_institute_var2": (700, 82, 287, {"IfcFurnishingElement": "detail"}),
    "ac20_fzk_haus": (83, 7, 17, {"IfcMember": "occluder"}),
    # One GlobalId stands for six of its products.
    "allplan_smiley_west": (396, 70, 140, {"IfcSlab": "occluder"}),
    "duplex_A": (215, 21, 50, {"IfcStairFlight": "occluder", "IfcCovering": "occluder"}),
    "jesse_nospaces": (626, 0, 149, {"IfcPlate": "transparent", "IfcMember": "occluder"}),
    "xbim_house_invalid": (134, 13, 45, {"IfcSlab": "occluder", "IfcWindow": "transparent"}),
    "office_A": (803, 99, 181, {"IfcFlowTerminal": "detail", "IfcCovering": "occluder"}),
}
MESHES = {
    "engel_house/engel_house.obj": ({}, 1254, 15024),
    "game_complex/complex.obj": ({"up": "y"}, 135, 12368),
    "game_institute/institute.obj": ({"up": "y"}, 122, 35356),
    "godot_room/room.glb": ({}, 17, 63720),
    "ifc_clinic_arch/clinic_arch.obj": ({"up": "y"}, 2586, 169230),
}


def ifc_file(name: str) -> Path:
    return next((SCENES / "ifc" / name).glob("*.ifc"))


def check_ifc(name: str, expected: tuple, tmp_path: Path) -> None:
    path = ifc_file(name)
    before = path.read_bytes()
    scene = read(path)
    objects, spaces, openings, kinds = expected
    assert (len(scene.objects), len(scene.spaces), len(scene.openings)) == (objects, spaces, openings)
    found = Counter((placed.kind, placed.role.value) for placed in scene.objects)
    assert kinds.items() <= dict(found.keys()).items()
    assert scene.max_snap_m() <= GRID_M / 2
    assert path.read_bytes() == before
    write_scene(scene, tmp_path / name)
    again = read_scene(tmp_path / name)
    np.testing.assert_array_equal(again.triangles()[0], scene.triangles()[0])
    told = [[(one.storey, one.materials) for one in made.objects] for made in (scene, again)]
    assert told[0] == told[1] and any(storey for storey, _ in told[0])


@pytest.mark.parametrize("name", IFC)
def test_shared_ifc(name, tmp_path):
    check_ifc(name, IFC[name], tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", IFC_SLOW)
def test_shared_ifc_slow(name, tmp_path):
    check_ifc(name, IFC_SLOW[name], tmp_path)


@pytest.mark.parametrize("name", MESHES)
def test_shared_meshes(name):
    options, objects, triangles = MESHES[name]
    scene = read(SCENES / "mesh" / name, **options)
    assert (len(scene.objects), len(scene.triangles()[0])) == (objects, triangles)


def test_ifc_read_twice_is_the_same(monkeypatch):
    path = ifc_file("threerooms_sb")
    monkeypatch.setattr("os.cpu_count", lambda: 4)
    many = read(path)
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    one = read(path)
    assert [placed.name for placed in many.objects] == [placed.name for placed in one.objects]
    np.testing.assert_array_equal(many.triangles()[0], one.triangles()[0])


def test_closed_doors_occlude_and_windows_do_not():
    scene = read(ifc_file("threerooms_sb"), doors="closed")
    roles = {placed.kind: placed.role for placed in scene.objects}
    assert roles["IfcDoor"] is Role.OCCLUDER and roles["IfcWindow"] is Role.TRANSPARENT


def test_unknown_schema_is_refused(tmp_path):
    text = ifc_file("threerooms_sb").read_bytes().replace(b"('IFC4')", b"('IFC9')")
    (tmp_path / "new.ifc").write_bytes(text)
    with pytest.raises(InputError, match="IFC9") as error:
        read(tmp_path / "new.ifc")
    assert "\n" not in str(error.value)
