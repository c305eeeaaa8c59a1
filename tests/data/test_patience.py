"""What can be left out ends when its time is up, however deep in other work it asks."""

import threading

import numpy as np
import pytest
from viewcell.data.patience import OutOfTime, ask, within
from viewcell.data.rasters import Rasters


def test_without_a_limit_there_is_time_for_everything():
    ask()
    with within(np.inf):
        ask()


def test_a_block_ends_with_its_own_time_or_that_of_the_one_around_it():
    with within(0.0), pytest.raises(OutOfTime), within(1e6):
        ask()
    with within(1e6):
        ask()
        with pytest.raises(OutOfTime), within(0.0):
            ask()
        ask()
    ask()


def test_other_threads_have_time():
    told = []
    with within(0.0):
        thread = threading.Thread(target=lambda: told.append(ask()))
        thread.start()
        thread.join()
    assert told == [None]


def test_lots_of_rasters_ask():
    rasters = Rasters.one(np.arange(3), np.arange(3))
    with within(0.0), pytest.raises(OutOfTime):
        list(rasters.lots())
