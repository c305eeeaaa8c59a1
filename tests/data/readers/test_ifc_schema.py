from pathlib import Path

import pytest
from builders.step_house import house
from viewcell.data.errors import InputError
from viewcell.data.readers import read
from viewcell.data.readers.ifc_schema import check_classes
from viewcell.data.readers.step import check_step


def check(text: str) -> None:
    check_classes(Path("a.ifc"), "IFC2X3", check_step(Path("a.ifc"), text.encode()))


@pytest.fixture
def text(tmp_path) -> str:
    return house().write(tmp_path / "a.ifc").read_text()


WRONG = {
    "a profile that is a unit": ("#10=IFCRECTANGLEPROFILEDEF(.AREA.,$,#8", "#10=IFCRECTANGLEPROFILEDEF(.AREA.,$,#1"),
    "a solid that is a point": ("'SweptSolid',(#11))", "'SweptSolid',(#11,#6))"),
    "a direction that is a placement": ("#11=IFCEXTRUDEDAREASOLID(#10,#4,#9", "#11=IFCEXTRUDEDAREASOLID(#10,#4,#4"),
    "no class of the schema": ("#9=IFCDIRECTION", "#9=IFCDIRECTIOM"),
}


@pytest.mark.parametrize("how", WRONG)
def test_what_a_class_may_not_refer_to_is_refused(text, how, tmp_path):
    """Some of these end the process when the geometry library takes them."""
    assert WRONG[how][0] in text
    wrong = text.replace(*WRONG[how])
    with pytest.raises(InputError, match=r"^a\.ifc: expected .* found .*#\d+=IFC"):
        check(wrong)
    (tmp_path / "wrong.ifc").write_text(wrong)
    with pytest.raises(InputError):
        read(tmp_path / "wrong.ifc")


def test_places_are_told_apart_by_their_commas(text):
    """Two directions and then a point, each where it belongs."""
    more = "#900=IFCDIRECTION((1.,0.,0.));\n#901=IFCCARTESIANTRANSFORMATIONOPERATOR3D(#900,#900,#3,1.,$);\nENDSEC;\nEND"
    check(text.replace("ENDSEC;\nEND", more))
    with pytest.raises(InputError, match="value 3 of #901"):
        check(text.replace("ENDSEC;\nEND", more.replace("#900,#900,#3", "#900,#900,#900")))
