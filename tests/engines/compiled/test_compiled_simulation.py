"""The compiled engine: against the Drake diagram, the laws of conservation, and with itself."""

from __future__ import annotations

import dataclasses
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tetra_drake.engines.compiled.engine import prepare
from tetra_drake.engines.compiled.walk import DONE, walk
from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import Diverged, SimulationFailure, StepBudgetExceeded
from tetra_drake.robot.gait import load_gait, seeded_gait
from tetra_drake.robot.model import make_model
from tetra_drake.robot.structure import MakeStructure, Structure, node_positions
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH


def finely(scenario: Scenario, *, tetrahedra: int = 5, duration: float) -> Scenario:
    """The scenario with signals from the start, and settings at which both engines have
    converged, mode changes placed to 1e-8 s."""
    return scenario.with_changes(
        {
            "robot.tetrahedra": tetrahedra,
            "cpg.start_up": 0.0,
            "simulation.duration": duration,
            "simulation.steady_from": 0.5 * duration,
            "simulation.scheme": "runge_kutta3",
            "simulation.accuracy": 1e-6,
            "simulation.max_step": 1e-4,
            "simulation.mode_changes": "witness",
            "simulation.witness_window": 1e-8,
            "compiled.tolerance": 1e-8,
            "compiled.max_step": 3e-5,
            "compiled.look_ahead": 1e-8,
        }
    )


SAME_PLACE = 5e-6
"""Largest difference (m) of node positions on the two engines after 0.5 s.

Each engine places a mode change to 1e-8 s. There friction jumps by up to sigma_1 v, that is
70 N s/m * 0.05 m/s = 3.5 N on a body of 0.02 kg: a velocity error of 1.75e-6 m/s, and 0.9e-6 m
after 0.5 s. Some such changes may add up.
"""


def ends(scenario: Scenario, seed: int) -> list[np.ndarray]:
    """Where the nodes are at the end, on the compiled engine and on the diagram."""
    gait, found = seeded_gait(scenario, seed), []
    for engine in ("compiled", "drake"):
        result = simulate(
            scenario=scenario.with_changes({"simulation.engine": engine}), gait=gait, record=True
        )
        assert result.trajectory is not None
        found.append(result.trajectory["p_WN"].values[-1])
    return found


@pytest.mark.parametrize("seed", [2, 3])
def test_nodes_go_where_the_diagrams_nodes_go(compiled_scenario: Scenario, seed: int) -> None:
    # In 0.5 s the robot settles and starts to walk: some nodes slip, leave the ground, land.
    scenario = finely(compiled_scenario, duration=0.5)
    ours, drakes = ends(scenario, seed)
    assert np.abs(ours - drakes).max() < SAME_PLACE
    structure = MakeStructure(scenario.robot, scenario.cables)
    start = node_positions(structure, structure.initial_state)
    assert np.abs(ours.reshape(-1, 3) - start).max() > 200 * SAME_PLACE, "the robot has moved"


@pytest.mark.parametrize("tetrahedra", [2, 3, 8])
def test_any_number_of_tetrahedra_goes_where_the_diagrams_goes(
    compiled_scenario: Scenario, tetrahedra: int
) -> None:
    ours, drakes = ends(finely(compiled_scenario, tetrahedra=tetrahedra, duration=0.3), 1)
    assert ours.shape == (tetrahedra, 4, 3)
    assert np.abs(ours - drakes).max() < SAME_PLACE


@pytest.mark.slow
def test_nine_of_ten_well_conditioned_random_gaits_end_where_the_diagrams_do(
    compiled_scenario: Scenario,
) -> None:
    # The diagram's default settings are themselves off by 0.2 in and more in every fourth gait.
    diagram = compiled_scenario.with_changes(
        {
            "simulation.engine": "drake",
            "simulation.scheme": "runge_kutta3",
            "simulation.accuracy": 1e-5,
            "simulation.max_step": 5e-5,
            "simulation.look_ahead": 0.0,
        }
    )
    coarser, finer = (
        compiled_scenario.with_changes(
            {"compiled.tolerance": tolerance, "compiled.look_ahead": look_ahead}
        )
        for tolerance, look_ahead in ((5e-6, 2e-6), (2e-6, 1e-6))
    )
    close = compared = 0
    for seed in range(200, 230):
        spread = distance(coarser, seed) - distance(finer, seed)
        if abs(spread) > 0.05:
            continue  # ill-conditioned: two converged runs differ
        compared += 1
        close += abs(distance(diagram, seed) - distance(compiled_scenario, seed)) < 0.15
        if compared == 10:
            break
    assert compared == 10
    assert close >= 9


def distance(scenario: Scenario, seed: int) -> float:
    return simulate(scenario=scenario, gait=seeded_gait(scenario, seed)).metrics.distance_in


def test_a_gait_is_not_influenced_by_company_or_threads(compiled_scenario: Scenario) -> None:
    scenario = compiled_scenario.with_changes({"simulation.duration": 4.0})
    alone = [distance(scenario, seed) for seed in range(6)]
    with ThreadPoolExecutor(4) as threads:
        together = list(threads.map(lambda seed: distance(scenario, seed), [*range(6), *range(6)]))
    assert together == alone * 2


def test_recording_changes_nothing(compiled_scenario: Scenario) -> None:
    scenario = compiled_scenario.with_changes({"simulation.duration": 4.0})
    gait = seeded_gait(scenario)
    bare = simulate(scenario=scenario, gait=gait)
    recorded = simulate(scenario=scenario, gait=gait, record=True)
    assert bare.metrics == recorded.metrics
    assert recorded.trajectory is not None
    x1 = recorded.trajectory["p_WN"].values[:, 0, 0, 0]
    assert (x1[-1] - x1[0]) / INCH == recorded.metrics.distance_in


def test_the_recording_has_the_forces_of_the_diagrams(compiled_scenario: Scenario) -> None:
    # At t = 0.2 s, before the actuation, both robots are at rest: the same tensions and
    # normal forces, whose sum is the weight.
    scenario = compiled_scenario.with_changes(
        {"simulation.duration": 0.8, "simulation.steady_from": 0.2}
    )
    gait = seeded_gait(scenario)
    ours, drakes = (
        simulate(
            scenario=scenario.with_changes({"simulation.engine": engine}), gait=gait, record=True
        ).trajectory
        for engine in ("compiled", "drake")
    )
    assert ours is not None and drakes is not None
    assert set(ours.variables) == set(drakes.variables)
    assert dict(ours.sizes).keys() == dict(drakes.sizes).keys()
    for name in ("tension", "length", "normal_force", "in_contact", "friction_mode"):
        assert ours[name].dims == drakes[name].dims
        assert ours[name].attrs == drakes[name].attrs
        np.testing.assert_allclose(
            ours[name].values[-1], drakes[name].values[-1], rtol=2e-2, atol=2e-3
        )


@pytest.mark.parametrize("signals", ["recorded", "live"])
def test_signals_integrated_with_error_control_are_those_of_the_diagram(
    compiled_scenario: Scenario, data: Path, signals: str
) -> None:
    # Gait c goes 0.4 in farther than on the listing's signals (see the README).
    scenario = compiled_scenario.with_changes({"cpg.signals": signals})
    gait = load_gait(data / "gait_c.json", scenario)
    assert simulate(scenario=scenario, gait=gait).metrics.distance_in == pytest.approx(
        2.22, abs=0.05
    )


def thrown(scenario: Scenario, *, gravity: float) -> tuple[Structure, Scenario, np.ndarray]:
    """A robot far above the ground whose bodies move at random."""
    scenario = scenario.with_changes(
        {
            "robot.gravity": gravity,
            "cpg.gain": 0.0,
            "simulation.duration": 0.5,
            "simulation.steady_from": 0.1,
            "compiled.tolerance": 1e-7,
        }
    )
    structure = MakeStructure(scenario.robot, scenario.cables)
    bodies = len(structure.bodies)
    state = structure.initial_state
    state[6 : 7 * bodies : 7] += 10.0
    state[7 * bodies :] = np.random.default_rng(0).normal(scale=0.2, size=6 * bodies)
    return structure, scenario, state


def flown(structure: Structure, scenario: Scenario, state: np.ndarray) -> np.ndarray:
    """The state at the end."""
    prepared = prepare(scenario, seeded_gait(scenario), structure, record=False)
    prepared.state[:] = state
    assert walk(*prepared)[0] == DONE
    return prepared.state


def momenta(structure: Structure, scenario: Scenario, state: np.ndarray) -> np.ndarray:
    """Total angular momentum about the origin of World, and momentum."""
    robot = make_model(scenario, structure)
    bodies = len(structure.bodies)
    p_WB = state[: 7 * bodies].reshape(bodies, 7)[:, 4:]
    velocities = state[7 * bodies :].reshape(bodies, 6)
    linear = robot.mass * velocities[:, 3:]
    angular = robot.moment * velocities[:, :3] + np.cross(p_WB, linear)
    return np.concatenate([angular.sum(axis=0), linear.sum(axis=0)])


def test_momentum_and_angular_momentum_stay_without_ground_and_gravity(
    compiled_scenario: Scenario,
) -> None:
    structure, scenario, state = thrown(compiled_scenario, gravity=0.0)
    before = momenta(structure, scenario, state)
    after = momenta(structure, scenario, flown(structure, scenario, state))
    # Momentum to rounding, angular momentum to the order of the method.
    np.testing.assert_allclose(after[3:], before[3:], atol=1e-13)
    np.testing.assert_allclose(after[:3], before[:3], atol=2e-6 * np.abs(before[:3]).max())


def test_the_centre_of_mass_falls_as_galilei_says(compiled_scenario: Scenario) -> None:
    structure, scenario, state = thrown(compiled_scenario, gravity=9.80665)
    bodies = len(structure.bodies)
    end = flown(structure, scenario, state)
    height = state[6 : 7 * bodies : 7].mean() + 0.5 * state[7 * bodies + 5 :: 6].mean()
    # h + v t - g t² / 2 with t = 0.5 s; ROS2 is exact on parabolas.
    assert end[6 : 7 * bodies : 7].mean() == pytest.approx(height - 9.80665 / 8.0, abs=1e-12)


def test_energy_stays_with_damping_off(compiled_scenario: Scenario) -> None:
    structure, scenario, state = thrown(compiled_scenario, gravity=0.0)
    scenario = scenario.with_changes({"cables.damping": 0.0})
    structure = MakeStructure(scenario.robot, scenario.cables)
    robot = make_model(scenario, structure)

    def energy(state: np.ndarray) -> float:
        velocities = state[35:].reshape(5, 6)
        kinetic = 0.5 * (
            robot.moment * (velocities[:, :3] ** 2).sum()
            + robot.mass * (velocities[:, 3:] ** 2).sum()
        )
        p_WN = node_positions(structure, state)
        way = p_WN[structure.cables["node_b"]] - p_WN[structure.cables["node_a"]]
        stretch = np.linalg.norm(way, axis=1) - structure.cables["free_length"]
        return kinetic + 0.5 * (structure.cables["stiffness"] * stretch**2).sum()

    start = energy(state)
    assert energy(flown(structure, scenario, state)) == pytest.approx(start, rel=1e-5)


@pytest.mark.parametrize(
    ("changes", "kind"),
    [
        ({"simulation.max_speed": 1e-3}, Diverged),
        ({"simulation.max_evaluations": 100}, StepBudgetExceeded),
        ({"cpg.gain": 4e9}, Diverged),  # a pull that grows without bound
    ],
)
def test_a_failed_simulation_says_when_and_why(
    compiled_scenario: Scenario, changes: dict[str, Any], kind: type[SimulationFailure]
) -> None:
    scenario = compiled_scenario.with_changes(changes)
    with pytest.raises(kind) as caught:
        simulate(scenario=scenario, gait=seeded_gait(scenario))
    assert 0.0 <= caught.value.time < scenario.simulation.duration
    assert caught.value.reason in str(caught.value)


def test_structures_the_engine_cannot_simulate_are_refused(scenario: Scenario) -> None:
    structure = MakeStructure(scenario.robot, scenario.cables)
    cables = structure.cables.copy()
    cables[0]["node_b"] += 4
    with pytest.raises(ValueError, match="does not join a body to the next one"):
        make_model(scenario, dataclasses.replace(structure, cables=cables))
