"""The equations of motion, against Drake's plant and the laws of conservation."""

import numpy as np
import pytest
from helpers.states import disturbed

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
from tetra_drake.robot.model import Model, make_model
from tetra_drake.robot.structure import MakeStructure
from tetra_drake.scenario.schema import Scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram


def disturbed_robot(scenario: Scenario, seed: int) -> tuple[Model, np.ndarray, np.ndarray]:
    """The robot, its state in motion with some nodes in the ground, and their modes."""
    structure = MakeStructure(scenario.robot, scenario.cables)
    state = disturbed(structure, seed, pose=1e-3, speed=0.05)
    robot = make_model(scenario, structure)
    modes = np.zeros((len(structure.contacts), MODE_COLUMNS))
    update_modes(node_motion(state, structure.p_BN), robot.contacts, robot.ground, modes)
    assert np.count_nonzero(modes[:, 0]) > 0, "some nodes touch the ground"
    return robot, state, modes


@pytest.mark.parametrize("tetrahedra", [2, 5, 8])
@pytest.mark.parametrize("seed", [0, 1])
def test_accelerations_are_those_of_the_diagram(
    scenario: Scenario, tetrahedra: int, seed: int
) -> None:
    scenario.robot.tetrahedra = tetrahedra
    robot, state, modes = disturbed_robot(scenario, seed)
    forces, acceleration = make_forces(robot, tetrahedra), np.empty(6 * tetrahedra)
    compute_forces(robot, state, modes, np.zeros(tetrahedra - 1), forces)
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
    scenario.friction.proportional_stiction = 0.0
    robot, state, modes = disturbed_robot(scenario, 0)
    forces = make_forces(robot, 5)

    def force_at(velocity: np.ndarray) -> np.ndarray:
        compute_forces(robot, np.append(state[:35], velocity), modes, np.zeros(4), forces)
        return forces.generalized_force.copy()

    columns = [force_at(change) - force_at(-change) for change in 1e-4 * np.eye(30)]
    jacobian = np.array(columns).T / 2e-4
    force_at(np.zeros(30))
    rows = np.zeros((5, BLOCK, ROW))
    time = 1e-9  # s, so short that time² stiffness counts for nothing
    implicit_matrix(robot, modes, forces, time, np.zeros(ROW), rows)
    full = np.zeros((30, 30 + BLOCK))
    for body in range(5):
        full[BLOCK * body : BLOCK * body + 6, BLOCK * body : BLOCK * body + ROW] = rows[body]
    upper = np.triu(full[:, :30], 1)
    mass = np.diag(np.tile([robot.moment] * 3 + [robot.mass] * 3, 5))
    damping = (upper + upper.T + np.diag(full.diagonal()) - mass) / time
    # Differencing M + 1e-9 D costs 7 of 16 digits.
    np.testing.assert_allclose(damping, -jacobian, atol=2e-4 * np.abs(jacobian).max())


def test_bodies_turn_as_drakes_quaternions_do() -> None:
    # A turn by angle w t about z: quaternion (cos(w t / 2), 0, 0, sin(w t / 2)).
    state = np.append(1.0, np.zeros(12))
    moved = state.copy()
    move_bodies(state, np.array([0.0, 0.0, 3.0, 0.1, 0.2, 0.3]), 0.01, moved)
    np.testing.assert_allclose(moved[:4], [np.cos(0.015), 0, 0, np.sin(0.015)], atol=1e-11)
    np.testing.assert_allclose(moved[4:7], [1e-3, 2e-3, 3e-3], atol=1e-18)
