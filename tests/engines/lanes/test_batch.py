"""Batches of the compiled engine: robots that pause, go on, and are replaced."""

import numpy as np
import pytest
from helpers.converged import shortly

from tetra_drake.engines.lanes.batch import LaneBatch
from tetra_drake.errors import Diverged
from tetra_drake.robot.command import driven_robot
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.scenario.scenario import Scenario


@pytest.fixture
def short(scenario: Scenario) -> Scenario:
    """A fifth of a second."""
    changes = {"engine": "!Compiled", "cpg.start_up": "0.02 s", "friction.stiffness": "0 N/m"}
    changes["robot.tetrahedra"] = 2
    return shortly(scenario, 0.2, **changes)


def walking(scenario: Scenario) -> DrivenRobot:
    """A robot with a gait."""
    return driven_robot(scenario, seeded_gait(scenario, 1))


def test_a_place_is_used_again_and_a_failure_stays_in_its_place(short):
    wild = short.with_changes({"simulation.max_speed": "1 mm/s"})
    batch = LaneBatch(walking(wild), places=2)
    assert batch.begin(1, walking(short))
    batch.advance()
    assert [type(failure) for failure in batch.failures] == [Diverged, type(None)]
    with pytest.raises(Diverged):
        batch.result(0)
    assert batch.ended.tolist() == [True, True]
    expected = batch.result(1).metrics.distance
    assert batch.begin(0, walking(short))
    assert batch.failures[0] is None and not batch.ended[0]
    batch.advance()
    assert batch.result(0).metrics.distance == expected == batch.result(1).metrics.distance


def test_a_pause_changes_a_motion_by_no_more_than_a_step_does(short):
    whole, paused = (LaneBatch(walking(short), places=2) for _ in range(2))
    whole.advance()
    for until, reached in ((0.06, 0.06), (0.13, 0.13), (0.1, 0.13)):
        paused.advance(np.array([until, np.inf]))
        assert paused.readings.time.tolist() == pytest.approx([reached, 0.0])
        assert not paused.ended.any()
    paused.advance()
    np.testing.assert_allclose(paused.readings.p_WN, whole.readings.p_WN, rtol=0.0, atol=2e-4)
