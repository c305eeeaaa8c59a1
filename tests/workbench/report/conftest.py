"""A bake that the tests of the report share."""

import pytest
from builders.seen_house import forget, seen_house


@pytest.fixture
def house(tmp_path):
    """The house; the way from cell 0 to cell 4 has lost its witness."""
    made = seen_house(tmp_path)
    made.cell_to_cell = forget(made.cell_to_cell, "reached_cell_id", 0, 4)
    return made
