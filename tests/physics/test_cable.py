"""The cable law and what a network of cables can and cannot do to free bodies."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import LinearSpringDamper

from tetra_drake.physics.cable import cable_forces, cable_tension
from tetra_drake.robot.bodies import AddTetrahedra
from tetra_drake.robot.structure import MakeStructure, Structure, node_positions, node_velocities
from tetra_drake.scenario.schema import Scenario


def random_state(structure: Structure, seed: int) -> np.ndarray:
    """A state (13 n,) near the start, every body turned, shifted and moving."""
    generator = np.random.default_rng(seed)
    state = structure.initial_state
    bodies = len(structure.bodies)
    state += np.concatenate(
        [generator.normal(scale=0.01, size=7 * bodies), generator.normal(size=6 * bodies)]
    )
    quaternions = state[: 7 * bodies].reshape(bodies, 7)[:, :4]
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    return state


def forces_of_cables(
    structure: Structure, state: np.ndarray, signals: np.ndarray, *, slack: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    force, tensions = np.empty(6 * len(structure.bodies)), np.empty(len(structure.cables))
    lengths = np.empty_like(tensions)
    cable_forces(state, signals, structure.p_BN, structure.cables, slack, force, tensions, lengths)
    return force, tensions


def test_tension_is_equation_6() -> None:
    # 35 N/m (0.3 m - 0.1 m) + 8 N s/m * -0.25 m/s + 1.5 N = 7 - 2 + 1.5
    assert cable_tension(0.3, -0.25, 1.5, 35.0, 8.0, 0.1, False) == pytest.approx(6.5, rel=1e-15)


def test_a_cable_pushes_unless_it_may_go_slack() -> None:
    assert cable_tension(0.05, 0.0, 0.0, 35.0, 8.0, 0.1, False) == pytest.approx(-1.75)
    assert cable_tension(0.05, 0.0, 0.0, 35.0, 8.0, 0.1, True) == 0.0


def test_cables_keep_momentum_and_angular_momentum(scenario: Scenario) -> None:
    structure = MakeStructure(scenario.robot, scenario.cables)
    state = random_state(structure, seed=1)
    force, _ = forces_of_cables(structure, state, np.array([1.0, -2.0, 0.5, 3.0]))
    wrench = force.reshape(-1, 6)
    bodies = len(structure.bodies)
    p_WB = state[: 7 * bodies].reshape(bodies, 7)[:, 4:]
    total_torque = wrench[:, :3].sum(axis=0) + np.cross(p_WB, wrench[:, 3:]).sum(axis=0)
    np.testing.assert_allclose(wrench[:, 3:].sum(axis=0), 0.0, atol=1e-13)
    np.testing.assert_allclose(total_torque, 0.0, atol=1e-13)


def test_power_of_the_cables_is_tension_times_shortening(scenario: Scenario) -> None:
    # Virtual power: generalized force . v = - sum of T dl/dt.
    structure = MakeStructure(scenario.robot, scenario.cables)
    state = random_state(structure, seed=2)
    force, tensions = forces_of_cables(structure, state, np.array([1.0, 0.0, -1.0, 2.0]))
    p_WN, v_WN = node_positions(structure, state), node_velocities(structure, state)
    a, b = structure.cables["node_a"], structure.cables["node_b"]
    d = p_WN[b] - p_WN[a]
    rates = np.einsum("ij,ij->i", v_WN[b] - v_WN[a], d) / np.linalg.norm(d, axis=1)
    velocities = state[7 * len(structure.bodies) :]
    assert force @ velocities == pytest.approx(-tensions @ rates, rel=1e-12)


def test_passive_cables_are_drakes_linear_spring_dampers(scenario: Scenario) -> None:
    structure = MakeStructure(scenario.robot, scenario.cables)
    state = random_state(structure, seed=3)

    def plant_with(*, springs: bool) -> MultibodyPlant:
        plant = MultibodyPlant(time_step=0.0)
        bodies = AddTetrahedra(plant, structure)
        for cable in structure.cables if springs else []:
            ends = [
                (bodies[node // 4], structure.p_BN[node % 4])
                for node in (cable["node_a"], cable["node_b"])
            ]
            (body_a, p_AP), (body_b, p_BQ) = ends
            plant.AddForceElement(
                LinearSpringDamper(
                    body_a,
                    p_AP,
                    body_b,
                    p_BQ,
                    cable["free_length"],
                    cable["stiffness"],
                    cable["damping"],
                )
            )
        plant.Finalize()
        return plant

    def acceleration(plant: MultibodyPlant, force: np.ndarray) -> np.ndarray:
        context = plant.CreateDefaultContext()
        context.SetContinuousState(state)
        plant.get_applied_generalized_force_input_port().FixValue(context, force)
        return plant.EvalTimeDerivatives(context).get_generalized_velocity().CopyToVector()

    ours, _ = forces_of_cables(structure, state, np.zeros(4))
    expected = acceleration(plant_with(springs=True), np.zeros_like(ours))
    found = acceleration(plant_with(springs=False), ours)
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-9)


def test_each_signal_drives_the_two_bottom_outer_cables_of_its_junction(
    scenario: Scenario,
) -> None:
    structure = MakeStructure(scenario.robot, scenario.cables)
    state = structure.initial_state
    _, passive = forces_of_cables(structure, state, np.zeros(4))
    _, driven = forces_of_cables(structure, state, np.array([1.0, 2.0, 3.0, 4.0]))
    for name, difference in zip(structure.cable_names, driven - passive, strict=True):
        junction = int(name[1])
        expected = junction if "outer bottom" in name else 0
        assert difference == pytest.approx(expected, abs=1e-12), name
