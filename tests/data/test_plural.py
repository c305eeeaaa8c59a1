"""Numbers of things in words."""

import pytest
from viewcell.data.plural import counted


@pytest.mark.parametrize(
    ("count", "words"), [(0, "0 view cells"), (1, "1 view cell"), (2, "2 view cells"), (1234, "1,234 view cells")]
)
def test_one_thing_has_no_s(count, words):
    assert counted(count, "view cell") == words


def test_some_words_have_plurals_of_their_own():
    assert counted(1, "leaf", "leaves") == "1 leaf" and counted(3, "leaf", "leaves") == "3 leaves"
