"""Settings as keywords: all of them, with the types that they have, and none by mistake."""

from dataclasses import asdict, fields
from pathlib import Path
from typing import get_args, get_type_hints

import numpy as np
import pytest
from viewcell import InputError, Settings
from viewcell.workbench.bake.settings import SettingsWords, with_words


def test_every_setting_is_a_keyword_of_its_type():
    own, words = get_type_hints(Settings), get_type_hints(SettingsWords)
    assert set(words) == {field.name for field in fields(Settings)}
    for name, kind in words.items():
        assert own[name] == kind or own[name] in get_args(kind), name


def test_keywords_change_what_is_given():
    assert with_words(None, {}) == Settings()
    base = Settings(method="portals", seed=3)
    changed = with_words(base, {"seed": 4, "doors": "closed"})
    assert asdict(changed) == asdict(base) | {"seed": 4, "doors": "closed"}
    assert base.seed == 3


def test_paths_and_degrees_are_written_out():
    words = with_words(None, {"yaw": 17.5, "cells": Path("cells.csv")})
    assert words.yaw == "17.5" and words.cells == "cells.csv" and words.table == Path("cells.csv")


@pytest.mark.parametrize(
    ("word", "value", "said"),
    [
        ("doors", "ajar", "doors: expected open or closed, found 'ajar'"),
        ("glass", 3, "glass: expected a text, found 3"),
        ("certify", "no", "certify: expected True or False, found 'no'"),
        ("certify", 1, "certify: expected True or False, found 1"),
        ("seed", 1.5, "seed: expected a whole number, found 1.5"),
        ("depth", True, "depth: expected a whole number, found True"),
        ("seal", "0.05", "seal: expected a number, found '0.05'"),
    ],
)
def test_values_of_another_kind_are_refused(word, value, said):
    with pytest.raises(InputError) as error:
        with_words(None, {word: value}).check()
    assert str(error.value) == said


def test_whole_numbers_are_numbers():
    with_words(None, {"seal": 0, "cell_size_m": 4, "pixels": np.float64(2.0), "doors": "closed"}).check()


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("dors", "found 'dors': doors is one"),
        ("zebra", "found 'zebra' (doors, "),
        ("Seed", "found 'Seed': seed is one"),
    ],
)
def test_other_words_are_refused_in_a_line(word, said):
    with pytest.raises(InputError) as error:
        with_words(None, {word: 1})
    assert said in str(error.value) and "\n" not in str(error.value)
