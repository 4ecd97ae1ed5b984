"""The planner: a lifted mass whose best plan is known, delay, and wrong arguments."""

from typing import Any

import numpy as np
import pytest
from helpers.anchored import HUNG, scenario_of

from tetra_drake.engines.simulate import simulate
from tetra_drake.lab.planner import Planner
from tetra_drake.lab.stepping.simulation import Simulation
from tetra_drake.robot.command import Command
from tetra_drake.robot.readings import Readings
from tetra_drake.scenario.scenario import Scenario

UP = {"p_WN": [0.0, 0.0, -1.0]}
"""Cost: the higher the nodes, the better."""
SMALL = {"samples": 32, "horizon": 0.1, "knots": 4, "control_period": 0.01, "workers": 1}
SMALL |= {"limits": [[-1.0], [1.0]]}


@pytest.fixture
def hung() -> Scenario:
    """0.1 s of a bar of 0.5 kg on a driven cable of 200 N/m, less than half of its oscillation. So
    any force upward lifts it, and the best plan is the greatest force all the time."""
    tree = HUNG | {"actuated": {"lift": ["line top a"]}}
    return scenario_of(tree, 0.1, friction__stiffness=0.0, engine="!Compiled")


def height(scenario: Scenario, actions: float) -> float:
    """Height of the mass at the end with the same action all the time."""
    command = Command("held", 1.0, np.array([[actions]]))
    return float(simulate(scenario, command=command, record=True).trajectory.p_WN[-1, 1, 2])


@pytest.mark.parametrize("delayed", [False, True])
def test_a_plan_comes_near_the_best_one_that_is_known(hung, engine, delayed):
    plant = hung.with_changes({"engine": engine})
    planner = Planner(hung, UP, delayed=delayed, **SMALL)
    result = simulate(plant, controller=planner, control_period=0.01, record=True)
    none, best = height(plant, 0.0), height(plant, 1.0)
    reached = (float(result.trajectory.p_WN[-1, 1, 2]) - none) / (best - none)
    assert (0.3 if delayed else 0.6) < reached <= 1.0 + 1e-6
    first = result.trajectory.signal.sel(time=slice(0.0, 0.009)).values
    assert np.abs(first).max() < 1e-9 if delayed else first.max() > 0.1
    assert planner.decisions == 10 and planner.decisions_per_second > 0.0
    assert 0.0 <= planner.deadlines_kept <= 1.0
    again = simulate(plant, controller=planner, control_period=0.01)
    assert again.metrics.distance == result.metrics.distance and planner.decisions == 10


@pytest.mark.parametrize("delayed", [False, True])
def test_plans_are_changes_of_a_command(hung, delayed):
    samples = np.linspace(0.5, 2.5, 5)[:, np.newaxis]
    command, state = Command("given", 0.02, samples), Simulation(hung).state.rows(0)
    own = SMALL | {"limits": None, "decision_period": 0.02, "delayed": delayed}

    def planned(**options: Any) -> list[float]:
        planner = Planner(hung, UP, command=command, **own | options)
        times = 0.01 * np.arange(14)
        return [planner(time, state._replace(time=time)).item() for time in times]

    followed, changed = planned(noise=1e-9), planned(noise=0.1)
    held = [0.5, 0.5, 1.0, 1.0, 1.5, 1.5, 2.0, 2.0, 2.5, 2.5, 2.5, 2.5, 2.5, 2.5]
    assert followed == pytest.approx(held, abs=1e-6)
    first = 2 if delayed else 0  # a plan acts late
    assert changed[:first] == followed[:first] and changed[first] > followed[first] + 0.01
    usual = Planner(hung, UP, **own).limits
    assert usual[1] < max(changed) <= 2.5
    assert planned(noise=1e-9, limits=[[0.0], [1.2]]) == pytest.approx(np.minimum(held, 1.2))


def test_the_cost_sees_motions_at_the_true_time_and_readings_are_assumed_exactly(hung):
    seen: list[Readings] = []
    cost = lambda readings: (seen.append(readings), -readings.p_WN[..., 2].mean(axis=-1))[1]  # noqa: E731
    steps: list[Readings] = []
    plant = hung.with_changes({"engine": "!Drake"})
    push = lambda time, readings: (steps.append(readings), [0.8])[1]  # noqa: E731
    simulate(plant, controller=push, control_period=0.01)
    readings = steps[3]
    planner = Planner(hung, cost, **SMALL)
    planner(float(readings.time), readings)
    assert seen[-1].time[:, 0].tolist() == pytest.approx([0.03 + 0.01 * k for k in range(1, 11)])
    planner.model.assume(readings._replace(time=0.02))
    for ours, theirs in zip(planner.model.state[1:], readings[1:], strict=True):
        np.testing.assert_allclose(ours[0], theirs, rtol=0.0, atol=1e-12)
    moved = planner.model.step(np.full((32, 1), 0.8)).p_WN[0]
    np.testing.assert_allclose(moved, steps[4].p_WN, rtol=0.0, atol=2e-5)


def test_a_planner_that_begins_anew_still_knows_what_is_cut(hung):
    readings = Simulation(hung, control_period=0.01).step([[0.0]]).rows(0)
    planner, whole = (Planner(hung, UP, **SMALL) for _ in range(2))
    planner.model.damage(0, cables=list(hung.whole_cables))
    costs = []
    for each in (planner, planner, whole):
        each.reset()
        each(float(readings.time), readings)
        costs.append(each.costs)
    assert costs[0] == costs[1] != costs[2]
    planner.model.reset()
    planner.reset()
    planner(float(readings.time), readings)
    assert planner.costs == costs[2]


def test_a_plan_stays_while_all_samples_fail(hung):
    planner = Planner(hung.with_changes({"simulation.max_speed": "1 um/s"}), UP, **SMALL)
    readings = Simulation(hung, control_period=0.01).step([[0.8]]).rows(0)
    first = planner(float(readings.time), readings)
    assert np.isnan(planner.costs).all() and planner.lost == planner.decisions == 1
    assert np.isfinite(first).all() and "1 without a result" in str(planner)
    later = readings._replace(time=readings.time + 0.05)
    assert np.isfinite(planner(float(later.time), later)).all()
