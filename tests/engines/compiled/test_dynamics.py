"""The equations of motion, against Drake's plant and the laws of conservation."""

from __future__ import annotations

import numpy as np
import pytest

from tetra_drake.engines.compiled.block_tridiagonal import BLOCK, ROW
from tetra_drake.engines.compiled.dynamics import (
    compute_forces,
    divide_by_mass,
    implicit_matrix,
    make_forces,
    move_bodies,
)
from tetra_drake.physics.contact import MODE_COLUMNS, update_modes
from tetra_drake.physics.kinematics import node_motion
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.model import make_model
from tetra_drake.robot.structure import MakeStructure, Structure
from tetra_drake.scenario.schema import Scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram


def disturbed(structure: Structure, seed: int) -> np.ndarray:
    """A state near the start, with some nodes in the ground, in motion."""
    generator = np.random.default_rng(seed)
    state = structure.initial_state
    bodies = len(structure.bodies)
    state[: 7 * bodies] += generator.normal(scale=1e-3, size=7 * bodies)
    for body in range(bodies):
        state[7 * body : 7 * body + 4] /= np.linalg.norm(state[7 * body : 7 * body + 4])
    state[7 * bodies :] = generator.normal(scale=0.05, size=6 * bodies)
    return state


@pytest.mark.parametrize("tetrahedra", [2, 5, 8])
@pytest.mark.parametrize("seed", [0, 1])
def test_accelerations_are_those_of_the_diagram(
    scenario: Scenario, tetrahedra: int, seed: int
) -> None:
    scenario = scenario.with_changes({"robot.tetrahedra": tetrahedra})
    structure = MakeStructure(scenario.robot, scenario.cables)
    state = disturbed(structure, seed)
    modes = np.zeros((len(structure.contacts), MODE_COLUMNS))
    robot = make_model(scenario, structure)
    update_modes(node_motion(state, structure.p_BN), robot.contacts, robot.ground, modes)
    forces = make_forces(robot, tetrahedra)
    acceleration = np.empty(6 * tetrahedra)
    compute_forces(robot, state, modes, np.zeros(structure.signals), forces)
    divide_by_mass(robot, forces.generalized_force, acceleration)

    diagram = MakeTensegrityDiagram(scenario, seeded_gait(scenario))
    context = diagram.CreateDefaultContext()
    context.SetContinuousState(state)
    ground = diagram.GetSubsystemByName("ground")
    ground.GetMyMutableContextFromRoot(context).SetDiscreteState(0, modes.ravel())
    expected = diagram.EvalTimeDerivatives(context).CopyToVector()[7 * tetrahedra :]
    # The diagram's plant makes up for the rounding of rotated inertias; both are exact to 1e-9.
    np.testing.assert_allclose(acceleration, expected, rtol=1e-7, atol=1e-7)


def test_the_implicit_matrix_is_the_derivative_of_the_forces(scenario: Scenario) -> None:
    # With stiffness left out (it enters squared in time) and the small dependence of bristles
    # on speed switched off, d force / d velocity is minus the damping matrix.
    scenario = scenario.with_changes({"friction.proportional_stiction": 0.0})
    structure = MakeStructure(scenario.robot, scenario.cables)
    robot = make_model(scenario, structure)
    state, bodies = disturbed(structure, 0), 5
    state[7 * bodies :] = 0.0
    modes = np.zeros((len(structure.contacts), MODE_COLUMNS))
    update_modes(node_motion(state, structure.p_BN), robot.contacts, robot.ground, modes)
    forces = make_forces(robot, bodies)

    def force_at(velocity: np.ndarray) -> np.ndarray:
        moving = state.copy()
        moving[7 * bodies :] = velocity
        compute_forces(robot, moving, modes, np.zeros(4), forces)
        return forces.generalized_force.copy()

    size, change = 6 * bodies, 1e-4
    jacobian = np.array(
        [force_at(change * row) - force_at(-change * row) for row in np.eye(size)]
    ).T / (2.0 * change)
    force_at(np.zeros(size))
    rows = np.zeros((bodies, BLOCK, ROW))
    time = 1e-9  # s, so short that time² stiffness counts for nothing
    implicit_matrix(robot, modes, forces, time, np.zeros(ROW), rows)
    full = np.zeros((size, size + BLOCK))
    for body in range(bodies):
        full[BLOCK * body : BLOCK * body + 6, BLOCK * body : BLOCK * body + ROW] = rows[body]
    upper = np.triu(full[:, :size], 1)
    mass = np.diag(np.tile([robot.moment] * 3 + [robot.mass] * 3, bodies))
    damping = (upper + upper.T + np.diag(full.diagonal()) - mass) / time
    assert np.count_nonzero(modes[:, 0]) > 3, "some nodes touch the ground"
    # Differencing M + 1e-9 D costs 7 of 16 digits.
    np.testing.assert_allclose(damping, -jacobian, atol=2e-4 * np.abs(jacobian).max())


def test_bodies_turn_as_drakes_quaternions_do() -> None:
    # A turn by angle w t about z: quaternion (cos(w t / 2), 0, 0, sin(w t / 2)).
    state = np.zeros(13)
    state[0] = 1.0
    moved = state.copy()
    velocities = np.array([0.0, 0.0, 3.0, 0.1, 0.2, 0.3])
    move_bodies(state, velocities, 0.01, moved)
    np.testing.assert_allclose(moved[:4], [np.cos(0.015), 0, 0, np.sin(0.015)], atol=1e-11)
    np.testing.assert_allclose(moved[4:7], [1e-3, 2e-3, 3e-3], atol=1e-18)
