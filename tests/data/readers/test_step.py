from pathlib import Path

import pytest
from builders.awkward import IFC_MODELS
from builders.step_house import house
from viewcell.data.errors import InputError
from viewcell.data.readers.step import check_step


@pytest.fixture
def text(tmp_path) -> str:
    return house().write(tmp_path / "a.ifc").read_text()


def refused(text: str) -> str:
    with pytest.raises(InputError) as error:
        check_step(Path("a.ifc"), text.encode())
    assert "\n" not in str(error.value) and str(error.value).startswith("a.ifc: expected")
    return str(error.value)


def test_a_sound_file_gives_its_entities(text):
    entities = check_step(Path("a.ifc"), text.encode())
    assert len(entities) == text.count(";\n#")
    assert (entities[0].number, entities[0].kind, entities[0].inside) == (
        1,
        b"IFCSIUNIT",
        b"*,.LENGTHUNIT.,.MILLI.,.METRE.",
    )


def test_strings_and_comments_are_no_syntax(text):
    odd = text.replace("'wall'", "'it''s (a; #9999 wall/*'").replace("#2=", "/* #9999=( ; */ #2 = ")
    assert len(check_step(Path("a.ifc"), odd.encode())) == len(check_step(Path("a.ifc"), text.encode()))


ENDS = {
    "no end": ("END-ISO-10303-21;", ""),
    "no end of data": ("ENDSEC;\nEND-ISO", "END-ISO"),
    "no data": ("DATA;", ""),
    "no header": ("ISO-10303-21;\nHEADER;", "HEADER;"),
    "a quote missing": ("'wall'", "'wall"),
}


@pytest.mark.parametrize("how", ENDS)
def test_what_is_not_whole_is_refused(text, how):
    assert ENDS[how][0] in text
    refused(text.replace(*ENDS[how]))


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.99])
def test_a_file_that_was_cut_off_is_refused(text, share):
    assert "cut off?" in refused(text[: int(share * len(text))])


def test_a_file_that_was_cut_off_and_closed_is_refused(text):
    cut = text[: text.index("\n", len(text) // 2)] + "\nENDSEC;\nEND-ISO-10303-21;\n"
    lost = cut.replace("#9=IFCDIRECTION((0.,0.,1.));\n", "")
    assert "#9, which #" in refused(lost) and "cut off?" in refused(lost)


BROKEN = {
    "no number": ("#7=IFCCARTESIANPOINT", "IFCCARTESIANPOINT"),
    "no class": ("#7=IFCCARTESIANPOINT", "#7="),
    "no semicolon": ("#7=IFCCARTESIANPOINT((0.,0.));", "#7=IFCCARTESIANPOINT((0.,0.))"),
    "a bracket missing": ("#7=IFCCARTESIANPOINT((0.,0.));", "#7=IFCCARTESIANPOINT((0.,0.);"),
    "a comma missing": ("#7=IFCCARTESIANPOINT((0.,0.));", "#7=IFCCARTESIANPOINT((0. $));"),
    "a comma too many": ("#7=IFCCARTESIANPOINT((0.,0.));", "#7=IFCCARTESIANPOINT((0.,,0.));"),
    "a word for a number": ("#7=IFCCARTESIANPOINT((0.,0.));", "#7=IFCCARTESIANPOINT((0.,nan));"),
    "a number twice": ("#7=", "#8="),
    "itself": ("#8=IFCAXIS2PLACEMENT2D(#7,$)", "#8=IFCAXIS2PLACEMENT2D(#8,$)"),
    "a circle": ("#4=IFCAXIS2PLACEMENT3D(#3,$,$)", "#4=IFCAXIS2PLACEMENT3D(#3,$,#5)"),
}


@pytest.mark.parametrize("how", BROKEN)
def test_broken_statements_are_refused(text, how):
    assert BROKEN[how][0] in text
    refused(text.replace(BROKEN[how][0], BROKEN[how][1], 1))


def test_relations_may_lead_in_circles(text):
    """As the space boundaries of sound files do."""
    circle = "#9001=IFCRELSPACEBOUNDARY('a',#9002);\n#9002=IFCRELSPACEBOUNDARY('b',#9001);\nENDSEC;\nEND-ISO"
    check_step(Path("a.ifc"), text.replace("ENDSEC;\nEND-ISO", circle).encode())


@pytest.mark.skipif(not IFC_MODELS.exists(), reason=f"{IFC_MODELS} is missing")
def test_models_of_many_exporters_are_sound():
    for path in sorted(IFC_MODELS.rglob("*.ifc")):
        assert len(check_step(path, path.read_bytes())) > 1000
