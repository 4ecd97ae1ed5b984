"""The equations of motion, against Drake's plant and the laws of conservation."""

import numpy as np
import pytest
from helpers.states import disturbed

from tetra_drake.engines.compiled.block_tridiagonal import BLOCK, ROW
from tetra_drake.engines.compiled.dynamics import (
    Forces,
    compute_forces,
    implicit_matrix,
    move_bodies,
)
from tetra_drake.physics.contact import MODE_COLUMNS, update_modes
from tetra_drake.physics.kinematics import move_nodes
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
    update_modes(move_nodes(state, structure.p_BN), robot.contacts, robot.ground, modes)
    assert np.count_nonzero(modes[:, 0]) > 0, "some nodes touch the ground"
    return robot, state, modes


@pytest.mark.parametrize("tetrahedra", [2, 5, 8])
@pytest.mark.parametrize("seed", [0, 1])
def test_accelerations_are_those_of_the_diagram(scenario, tetrahedra, seed):
    scenario.robot.tetrahedra = tetrahedra
    robot, state, modes = disturbed_robot(scenario, seed)
    nodes = move_nodes(state, robot.p_BN)
    forces = compute_forces(robot, nodes, modes, np.zeros(tetrahedra - 1))
    acceleration = forces.generalized / robot.inertia

    diagram = MakeTensegrityDiagram(scenario, seeded_gait(scenario))
    context = diagram.CreateDefaultContext()
    context.SetContinuousState(state)
    ground = diagram.GetSubsystemByName("ground")
    ground.GetMyMutableContextFromRoot(context).SetDiscreteState(0, modes.ravel())
    expected = diagram.EvalTimeDerivatives(context).CopyToVector()[7 * tetrahedra :]
    # The diagram's plant makes up for the rounding of rotated inertias; both are exact to 1e-9.
    np.testing.assert_allclose(acceleration, expected, rtol=1e-7, atol=1e-7)


def test_the_implicit_matrix_is_the_derivative_of_the_forces(scenario):
    # With stiffness left out (it enters squared in time) and the small dependence of bristles
    # on speed switched off, d force / d velocity is minus the damping matrix.
    scenario.friction.proportional_stiction = 0.0
    robot, state, modes = disturbed_robot(scenario, 0)

    def forces_at(velocity: np.ndarray) -> Forces:
        nodes = move_nodes(np.append(state[:35], velocity), robot.p_BN)
        return compute_forces(robot, nodes, modes, np.zeros(4))

    columns = [
        forces_at(change).generalized - forces_at(-change).generalized
        for change in 1e-4 * np.eye(30)
    ]
    jacobian = np.array(columns).T / 2e-4
    time = 1e-9  # s, so short that time² stiffness counts for nothing
    rows = implicit_matrix(robot, modes, forces_at(np.zeros(30)), time)
    full = np.zeros((30, 30 + BLOCK))
    for body in range(5):
        full[BLOCK * body : BLOCK * body + 6, BLOCK * body : BLOCK * body + ROW] = rows[body]
    upper = np.triu(full[:, :30], 1)
    damping = (upper + upper.T + np.diag(full.diagonal() - robot.inertia)) / time
    # Differencing M + 1e-9 D costs 7 of 16 digits.
    np.testing.assert_allclose(damping, -jacobian, atol=2e-4 * np.abs(jacobian).max())


def test_bodies_turn_as_drakes_quaternions_do():
    # A turn by angle w t about z: quaternion (cos(w t / 2), 0, 0, sin(w t / 2)).
    state = np.append(1.0, np.zeros(12))
    moved = move_bodies(state, np.array([0.0, 0.0, 3.0, 0.1, 0.2, 0.3]), 0.01)
    np.testing.assert_allclose(moved[:4], [np.cos(0.015), 0, 0, np.sin(0.015)], atol=1e-11)
    np.testing.assert_allclose(moved[4:7], [1e-3, 2e-3, 3e-3], atol=1e-18)
