"""What the tests of the experiment's tables start from."""

import pytest
from helpers.made_up_analysis import write_analysis
from helpers.synthetic_run import tiny_scenario, write_run

INITIAL = [(8.0, 0), (-4.0, 1), (None, 2)]
"""A trial's initial population: its best goes 4 in, one of the two that walk goes backward."""


@pytest.fixture
def runs(tmp_path):
    """A folder with two runs of the experiment, and their analyses.

    `thesis` has two trials, whose best gaits go 20 in and 5 in; `thesis-listing` has one,
    whose best gait goes 6 in, and it is not finished. A trial begins at 4 in.
    """
    trials = {
        "thesis": [[INITIAL, [(40.0, 1), (0.0, None)]], [INITIAL, [(10.0, 0), (9.0, 2)]]],
        "thesis-listing": [[INITIAL, [(12.0, 1), (None, None)]]],
    }
    for name, iterations in trials.items():
        scenario = tiny_scenario(name=name)
        if name == "thesis-listing":
            scenario.evolution.tau_mutation = "listing"
        unfinished = (0,) if name == "thesis-listing" else ()
        run = write_run(
            tmp_path / "runs" / name, iterations, scenario=scenario, unfinished=unfinished
        )
        write_analysis(run)
    return tmp_path / "runs"
