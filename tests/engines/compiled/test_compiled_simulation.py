"""The compiled engine against the Drake diagram."""

import contextlib

import numpy as np
import pytest
import xarray
from helpers.converged import CONVERGED

from tetra_drake.engines.simulate import simulate
from tetra_drake.engines.time_limit import time_limit
from tetra_drake.errors import Diverged, StepBudgetExceeded
from tetra_drake.robot.gait import WALKING_SEED, load_gait, seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.engine_kinds import SHORTEST_STEP, Compiled, Drake
from tetra_drake.scenario.schema import Scenario


@pytest.fixture
def compiled(scenario: Scenario) -> Scenario:
    """The thesis scenario on the compiled engine."""
    return scenario.with_changes({"engine": "!Compiled"})


SAME_PLACE = 5e-6
"""Largest difference (m) of node positions on the two engines after 0.5 s.

Each engine places a mode change to 1e-8 s. There friction jumps by up to sigma_1 v, that is
70 N s/m * 0.05 m/s = 3.5 N on a body of 0.02 kg: a velocity error of 1.75e-6 m/s, and 0.9e-6 m
after 0.5 s. Some such changes may add up.
"""


@pytest.mark.parametrize(
    ("tetrahedra", "seed", "duration"),
    # In 0.5 s the robot settles and starts to walk: some nodes slip, leave the ground, land.
    [(5, 2, 0.5), (2, 3, 0.5), (3, 1, 0.3), (8, 1, 0.2)],
)
def test_nodes_go_where_the_diagrams_nodes_go(scenario, tetrahedra, seed, duration):
    times = {
        "simulation.duration": f"{duration} s",
        "simulation.steady_from": f"{0.5 * duration} s",
    }
    fine = scenario.with_changes({"robot.tetrahedra": tetrahedra, "cpg.start_up": 0.0, **times})
    trajectories = trajectories_on_both(fine, seed)
    ours, drakes = (trajectory["p_WN"].values[-1] for trajectory in trajectories)
    assert ours.shape == (4 * tetrahedra, 3)
    assert np.abs(ours - drakes).max() < SAME_PLACE
    assert np.abs(ours - trajectories[0]["p_WN"].values[0]).max() > 200 * SAME_PLACE, "it moves"


def trajectories_on_both(scenario: Scenario, seed: int = WALKING_SEED) -> list[xarray.Dataset]:
    """Of a seeded gait on the compiled engine and on the diagram."""
    gait = seeded_gait(scenario, seed)
    both = [scenario.with_changes({"engine": CONVERGED[name]}) for name in ("compiled", "drake")]
    return [simulate(scenario=each, gait=gait, record=True).trajectory for each in both]


@pytest.mark.parametrize(
    ("setting", "value", "failure"),
    [
        ("max_step", "1 s", None),
        ("max_step", "2e-9 s", StepBudgetExceeded),
        ("tolerance", "1e-200 m/s", Diverged),
        ("tolerance", "1e200 m/s", None),
    ],
)
def test_extreme_settings_come_to_an_end(compiled, setting, value, failure):
    changes = {"simulation.duration": "0.2 s", "simulation.steady_from": "0.1 s"}
    changes |= {"cpg.start_up": "0.05 s", "robot.tetrahedra": 2}
    changes |= {f"engine.{setting}": value, "simulation.max_evaluations": 9000}
    extreme = compiled.with_changes(changes)
    with time_limit(30.0), pytest.raises(failure) if failure else contextlib.nullcontext():
        simulate(scenario=extreme, gait=seeded_gait(extreme))


@pytest.mark.parametrize(
    ("tolerance", "look_ahead"),
    [(1e-3, 2e-5), (Compiled().tolerance, 2e-5), (1e-6, 2e-7), (1e-200, 2.0 * SHORTEST_STEP)],
)
def test_steps_end_sooner_after_a_mode_change_if_the_tolerance_is_finer(tolerance, look_ahead):
    assert Compiled(tolerance=tolerance).look_ahead == look_ahead


@pytest.mark.slow
def test_nine_of_ten_well_conditioned_random_gaits_end_where_the_diagrams_do(compiled):
    # The diagram's default settings are themselves off by 0.2 in and more in every fourth gait.
    fine = Drake(scheme="runge_kutta3", accuracy=1e-5, max_step=5e-5, look_ahead=0.0)
    diagram = compiled.with_changes({"engine": fine})
    coarser = compiled.with_changes({"engine.tolerance": "5e-6 m/s"})
    finer = compiled.with_changes({"engine.tolerance": "2e-6 m/s"})
    well_conditioned = [
        seed
        for seed in range(200, 230)
        if abs(distance(coarser, seed) - distance(finer, seed)) < 0.05
    ][:10]
    close = [abs(distance(diagram, s) - distance(compiled, s)) < 0.15 for s in well_conditioned]
    assert len(close) == 10 and sum(close) >= 9


def distance(scenario: Scenario, seed: int) -> float:
    return simulate(scenario=scenario, gait=seeded_gait(scenario, seed)).metrics.distance_in


def test_signals_integrated_with_error_control_are_those_of_the_diagram(compiled, data):
    # Gait c goes 0.4 in farther than on the listing's signals.
    compiled = compiled.with_changes({"cpg.signals": "live"})
    result = simulate(scenario=compiled, gait=load_gait(data / "gait_c.json", compiled))
    assert result.metrics.distance_in == pytest.approx(2.22, abs=0.05)


def test_cables_in_no_order_of_the_bodies_that_they_join_are_refused(scenario, structure):
    structure.cables[[0, 6]] = structure.cables[[6, 0]]  # of T1-T2 and of T2-T3
    with pytest.raises(ValueError):
        Robot.of(scenario, structure)


@pytest.mark.parametrize(("lengthwise", "isotropic"), [(1.0 + 1e-14, True), (1.0 + 1e-9, False)])
def test_bodies_are_isotropic_but_for_rounding(structure, lengthwise, isotropic):
    structure.unit_inertia[:, 2] *= lengthwise
    assert structure.isotropic == isotropic
