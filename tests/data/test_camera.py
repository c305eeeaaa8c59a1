import pytest
from viewcell.data.camera import Screen
from viewcell.data.errors import InputError


@pytest.mark.parametrize(
    ("screen", "said"),
    [
        ((0, 100), "image: expected at least 1x1"),
        ((100_000, 100_000), "at most 67,108,864 pixels"),
        ((100, 100, 180.0), "fov: expected degrees between 0 and 180, found 180.0"),
        ((100, 100, 0.0), "fov"),
        ((100, 100, float("nan")), "fov"),
    ],
)
def test_bad_screens(screen, said):
    with pytest.raises(InputError, match=said):
        Screen(*screen)
