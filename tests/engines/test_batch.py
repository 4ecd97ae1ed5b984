"""Batches: robots that pause, go on, are copied and replaced, on all engines."""

import numpy as np
import pytest
import xarray
from helpers.converged import shortly

from tetra_drake.engines.engine import engine_of
from tetra_drake.engines.mujoco import INSTALL, installed
from tetra_drake.errors import Diverged
from tetra_drake.robot.command import controlled_robot, driven_robot
from tetra_drake.robot.driven import DrivenRobot
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.scenario.scenario import Scenario

ENGINES = {
    # Engine, and largest difference (m) of a copy: its integrator begins anew.
    "compiled": ("!Compiled", 0.0),
    "drake": ("!Drake", 1e-4),
    "mujoco": ("!Mujoco", 1e-9),
}


@pytest.fixture(params=ENGINES)
def scenario_and_error(request, scenario: Scenario) -> tuple[Scenario, float]:
    """A fifth of a second on an engine, and the largest difference of a copy."""
    engine, error = ENGINES[request.param]
    if request.param == "mujoco" and not installed():
        pytest.skip(INSTALL)
    changes = {"engine": engine, "cpg.start_up": "0.02 s", "friction.stiffness": "0 N/m"}
    return shortly(scenario, 0.2, **changes), error


def held(scenario: Scenario) -> DrivenRobot:
    """A robot whose signals a controller gives."""
    robot = controlled_robot(scenario)
    return DrivenRobot(robot=robot, name="held", samples=robot.first_signals[np.newaxis])


def walking(scenario: Scenario) -> DrivenRobot:
    """A robot with a gait."""
    return driven_robot(scenario, seeded_gait(scenario, 1))


@pytest.mark.parametrize("drive", [held, walking])
def test_a_copy_goes_on_as_its_original(scenario_and_error, drive):
    scenario, error = scenario_and_error
    robot = drive(scenario)
    batch = engine_of(scenario).start([robot, robot], record=True, threads=2)
    signals = np.array([[2.0], [-3.0]]) * np.ones(robot.robot.structure.signals)

    def go_on(until: float, rows: list[int]) -> None:
        batch.advance(until, signals[rows] if drive is held else None)

    go_on(0.06, [0, 1])
    if drive is walking:
        batch.advance(np.array([0.1, 0.0]))
    assert batch.readings.time[0] == pytest.approx(0.06 if drive is held else 0.1)
    assert np.abs(np.subtract(*batch.readings.p_WN)).max() > 1e-4
    batch.copy(0, 1)
    batch.copy(1, 1)
    go_on(0.14, [1, 1])
    go_on(np.inf, [0, 0])
    original, copy = batch.readings.p_WN
    np.testing.assert_allclose(copy, original, rtol=0.0, atol=error)
    results = [batch.result(place) for place in range(2)]
    trajectories = [result.trajectory for result in results]
    assert results[0].metrics.distance == pytest.approx(results[1].metrics.distance, abs=error)
    for name in ("p_WN", "signal"):
        pair = [trajectory[name] for trajectory in trajectories]
        xarray.testing.assert_allclose(*pair, rtol=0.0, atol=max(error, 1e-12))


def test_a_place_is_used_again_and_a_failure_stays_in_its_place(scenario_and_error):
    scenario, _ = scenario_and_error
    wild = scenario.with_changes({"simulation.max_speed": "1 mm/s"})
    batch = engine_of(scenario).start([walking(wild), walking(scenario)])
    batch.advance()
    assert [type(failure) for failure in batch.failures] == [Diverged, type(None)]
    with pytest.raises(Diverged):
        batch.result(0)
    assert batch.ended(0) and batch.ended(1)
    expected = batch.result(1).metrics.distance
    assert batch.begin(0, walking(scenario))
    assert batch.failures[0] is None and not batch.ended(0)
    batch.advance()
    assert batch.result(0).metrics.distance == expected == batch.result(1).metrics.distance


def test_a_pause_changes_a_motion_by_no_more_than_a_step_does(scenario_and_error, refused):
    scenario, _ = scenario_and_error
    whole, paused = (engine_of(scenario).start([walking(scenario)], places=2) for _ in range(2))
    whole.advance()
    for until, reached in ((0.06, 0.06), (0.13, 0.13), (0.1, 0.13)):
        paused.advance([until, np.inf])
        assert paused.readings.time.tolist() == pytest.approx([reached, 0.0])
    for place in (0, 1):
        with refused("Batch", f"place {place}", ""):
            paused.result(place)
    paused.advance()
    np.testing.assert_allclose(paused.readings.p_WN, whole.readings.p_WN, rtol=0.0, atol=2e-4)


@pytest.mark.parametrize("wrong", [{"until": [0.1]}, {"signals": np.zeros((2, 7))}])
def test_arguments_of_another_shape_are_refused(scenario_and_error, refused, wrong):
    scenario, _ = scenario_and_error
    with refused("Batch", next(iter(wrong)), "shape"):
        engine_of(scenario).start([held(scenario)] * 2).advance(**wrong)
