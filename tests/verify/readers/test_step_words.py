"""The plain reader of STEP files: values as they are written, strings as they are meant, against an IFC library."""

import pytest
from builders.awkward import IFC_MODELS
from builders.step_house import Step
from viewcell.verify.readers.step_words import StepWords


def words_of(*lines):
    return StepWords(("DATA;\n" + "\n".join(lines) + "\nENDSEC;").encode("latin-1"))


def test_values_are_read_as_they_are_written():
    words = words_of(
        "#1 = IFCTHING ( 'a;b''c/*no*/', $, * , #22, (#3,#4 ,()), .ENUM., 1.E-5,IFCLABEL('x'), IFCREAL(2.)) ;",
        "/* #2=IFCTHING('gone'); */ #3=IFCOTHER(-1., /* aside; */ ());",
    )
    first = ["'a;b''c/*no*/'", None, None, "#22", ["#3", "#4", []], ".ENUM.", "1.E-5", ["'x'"], ["2."]]
    assert words.values(1) == first and words.values(3) == ["-1.", []] and list(words.kinds) == [1, 3]


@pytest.mark.parametrize(
    "text",
    ["it''s", "\\X2\\00E4044F\\X0\\z", "\\X4\\0001F3E0\\X0\\", "\\X\\DF", "\\S\\d", "\\PE\\\\S\\d", "a\\\\b", ""],
)
def test_strings_are_decoded_as_an_ifc_library_does(text, tmp_path):
    import ifcopenshell

    step = Step()
    step.add(f"IFCSPACE('{77:022d}',$,'{text}',$,$,$,$,'{text}',.ELEMENT.,.INTERNAL.,$)")
    path = step.write(tmp_path / "a.ifc")
    (room,) = StepWords(path.read_bytes()).rooms()
    (space,) = ifcopenshell.open(str(path)).by_type("IfcSpace")
    assert room.long_name == space.LongName and room.name == (space.Name or space.GlobalId)


@pytest.mark.parametrize(
    ("unit", "metres"),
    [
        ("IFCSIUNIT(*,.LENGTHUNIT.,.MILLI.,.METRE.)", 1e-3),
        ("IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.)", 1.0),
        ("IFCSIUNIT(*,.AREAUNIT.,.MILLI.,.SQUARE_METRE.)", 1.0),
        ("IFCCONVERSIONBASEDUNIT($,.LENGTHUNIT.,'FOOT',#91)", 0.3048),
    ],
)
def test_the_unit_of_length(unit, metres):
    words = words_of(
        f"#90={unit};",
        "#91=IFCMEASUREWITHUNIT(IFCLENGTHMEASURE(304.8),#92);",
        "#92=IFCSIUNIT(*,.LENGTHUNIT.,.MILLI.,.METRE.);",
        "#93=IFCUNITASSIGNMENT((#90));",
        "#94=IFCPROJECT('0000000000000000000000',$,'p',$,$,$,$,(),#93);",
    )
    assert words.metres == pytest.approx(metres, rel=1e-15)


def test_a_model_is_read_whole():
    """Every entity, and every string of rooms and storeys, of a model that a program has written."""
    paths = sorted(IFC_MODELS.glob("*/3rooms*.ifc"))
    if not paths:
        pytest.skip(f"no model in {IFC_MODELS}")
    import ifcopenshell

    words, ifc = StepWords(paths[0].read_bytes()), ifcopenshell.open(str(paths[0]))
    assert words.kinds == {one.id(): one.is_a().upper() for one in ifc}
    found = {room.key: (room.name, room.long_name) for room in words.rooms()}
    assert found == {room.GlobalId: (room.Name, room.LongName) for room in ifc.by_type("IfcSpace")}
