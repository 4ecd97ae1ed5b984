"""The compiled engine: extreme settings, live signals, what it refuses."""

import contextlib

import pytest
from helpers.converged import shortly

from tetra_drake.engines.simulate import simulate
from tetra_drake.engines.time_limit import time_limit
from tetra_drake.errors import Diverged, StepBudgetExceeded
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.scenario.scenario import Scenario


@pytest.fixture
def compiled(scenario: Scenario) -> Scenario:
    """The thesis scenario on the compiled engine."""
    return scenario.with_changes({"engine": "!Compiled"})


EXTREMES = [("max_step", "1 s", None), ("max_step", "2e-9 s", StepBudgetExceeded)]
EXTREMES += [("tolerance", "1e-200 m/s", Diverged), ("tolerance", "1e15 m/s", None)]


@pytest.mark.parametrize(("setting", "value", "failure"), EXTREMES)
def test_extreme_settings_come_to_an_end(compiled, setting, value, failure):
    changes = {"robot.tetrahedra": 2, "simulation.max_evaluations": 9000}
    extreme = shortly(compiled, 0.2, **changes | {f"engine.{setting}": value})
    with time_limit(30.0), pytest.raises(failure) if failure else contextlib.nullcontext():
        simulate(scenario=extreme, gait=seeded_gait(extreme))


@pytest.mark.parametrize("duration", [1.0 / 3.0, 2.0 / 3.0])
def test_a_simulation_ends_at_a_duration_of_any_number_of_decimals(compiled, duration):
    short = shortly(compiled, duration)
    ended = simulate(short, seeded_gait(short), record=True).trajectory.time[-1]
    assert ended == duration
