import numpy as np
import pytest
from viewcell.data.errors import InputError
from viewcell.data.readers.assemble import Model, Part, assemble
from viewcell.data.scene import GRID_M, Role

SQUARE = np.array([[0, 0, 0], [4, 0, 0], [4, 0, 3], [0, 0, 3]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def model(*places: float) -> Model:
    """A square every metre, and more of them at the places, named by these."""
    made = Model("a.ifc", "", "metre", GRID_M)
    for at in (*range(10), *places):
        made.parts.append(
            Part(f"at {at:g}", "Mesh", Role.OCCLUDER, len(made.parts), SQUARE + np.array([0, at, 0]), FACES, np.eye(4))
        )
    return made


@pytest.mark.parametrize("far", [(1e5,), (-1e5,), (1e5, 2e5), (1e5, 1e5, -3e6, 4e7)])
def test_strays_that_do_not_fit_are_named(far):
    with pytest.raises(InputError) as error:
        assemble(model(*far))
    furthest = max(far, key=abs)
    assert (
        f"'at {furthest:g}'" in str(error.value) and "--leave-out" in str(error.value) and "\n" not in str(error.value)
    )
    assert f"{len(far)} of {10 + len(far)} parts" in str(error.value)


def test_strays_that_fit_are_noted():
    scene = assemble(model(5000.0))
    (note,) = scene.notes
    assert len(scene.objects) == 11 and "at 5000" in note["what"] and "--leave-out 'at 5000'" in note["why"]


def test_names_that_are_no_pattern_are_quoted():
    made = model(5000.0)
    made.parts[-1] = Part("a (1)", "Mesh", Role.OCCLUDER, 99, SQUARE + np.array([0, 5000, 0]), FACES, np.eye(4))
    (note,) = assemble(made).notes
    assert r"--leave-out 'a\ \(1\)'" in note["why"]


@pytest.mark.parametrize("places", [(), (20.0,), (900.0,), tuple(range(10, 3000, 10))])
def test_a_wide_model_has_no_strays(places):
    assert assemble(model(*places)).notes == []


def test_a_model_in_the_wrong_unit_has_no_strays():
    """No few parts are to blame where half of them do not fit."""
    with pytest.raises(InputError, match="check the unit"):
        assemble(model(*(10_000.0 * i for i in range(1, 12))))
