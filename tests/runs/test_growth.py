"""How a difference of 1 nm in the start grows."""

import growth
import pytest
from helpers.synthetic_run import tiny_scenario, write_run

from tetra_drake.evolution.run import load_run


def test_a_difference_has_not_grown_after_half_a_millisecond(tmp_path):
    """Bodies start 1 nm apart, at rest; the fastest motion, in contact, takes milliseconds."""
    moment = {
        "simulation.duration": "0.5 ms",
        "simulation.steady_from": "0 s",
        "engine": "!Compiled",
    }
    scenario = tiny_scenario().with_changes(moment)
    run = load_run(write_run(tmp_path / "run", [[[(1.0, 0)]]], scenario=scenario))
    assert growth.growth(run, run.gait(0, 0)) == pytest.approx(1.0, abs=0.3)
