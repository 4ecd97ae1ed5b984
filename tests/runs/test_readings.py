"""Readings of the thesis's text: how near they are to the thesis, and where their trials stop."""

import math

import numpy as np
import pandas
import pytest
import readings

from tetra_drake.scenario.optimizer_kinds import SteadyState


def test_a_reading_is_off_by_the_root_mean_square_of_the_logarithms_of_its_ratios():
    # 14.34 in from 6.6 in is a rise by 2.173, not by 1.32 and 1.51.
    trials = pandas.DataFrame({"initial_best_in": [6.6], "best_in": [14.34], "backward": [0.96]})
    logs = math.log(2.0), math.log(2.1727 / 1.32), math.log(2.1727 / 1.51)
    expected = math.exp(math.sqrt(sum(log**2 for log in logs) / 5))
    assert readings.factor(trials) == pytest.approx(expected, rel=1e-4)


def test_a_trial_counts_up_to_its_own_stop():
    flat = [0.1 * min(i, 250) for i in range(400)]
    assert readings.last_iteration(flat, SteadyState()) == 350  # 100 after the end of the rise
    assert readings.last_iteration(flat, SteadyState(stop_rise=0.0)) == 399


def test_trials_that_end_earlier_do_so_in_the_record():
    ended = {name: each["iterations"].tolist() for name, each in readings.load_tables().items()}
    for name, reading in readings.ALL.items():
        if "trials_of" in reading:
            whole = ended[reading["trials_of"]]
            assert np.less_equal(ended[name], whole).all() and ended[name] != whole, name
