"""Readings of the thesis's text: how near they are to the thesis, and where their trials stop."""

import numpy as np
import readings

from tetra_drake.scenario.optimizer_kinds import SteadyState


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
