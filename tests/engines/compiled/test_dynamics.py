"""The equations of motion, against Drake's plant and the laws of conservation."""

import numpy as np
import pytest
from helpers.forces import forces_at
from helpers.states import disturbed

from tetra_drake.engines.compiled.block_sparse import BLOCK
from tetra_drake.engines.compiled.dynamics import (
    CABLES_AT_ONCE,
    LINE_COLUMNS,
    Solver,
    implicit_matrix,
)
from tetra_drake.physics.contact import MODE_COLUMNS, modes_after_step
from tetra_drake.physics.forces import Forces
from tetra_drake.physics.kinematics import move_bodies
from tetra_drake.physics.model import Model
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.friction_kinds import Coulomb, ResetIntegrator
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.terrain_kinds import Flat, Rough
from tetra_drake.systems.diagram import MakeTensegrityDiagram


def forces_of(robot: Model, state: np.ndarray, modes: np.ndarray) -> tuple[Forces, np.ndarray]:
    """All forces without actuation, and as forces on the bodies."""
    bodies = len(state) // 13
    forces, generalized = Forces.of(robot), np.empty(6 * bodies)
    forces_at(robot, state, modes, np.zeros(bodies - 1), forces, generalized)
    return forces, generalized


def inertia_of(robot: Model, bodies: int) -> np.ndarray:
    """The diagonal of the mass matrix."""
    return np.tile([*3 * [robot.body.moment[0]], *3 * [robot.body.mass[0]]], bodies)


def disturbed_robot(scenario: Scenario, seed: int) -> tuple[Model, np.ndarray, np.ndarray]:
    """The robot, its state in motion with some nodes in the ground, and their modes."""
    whole = Robot.of(scenario)
    robot, structure = whole.model, whole.structure
    state = disturbed(structure, seed, pose=1e-3, speed=0.05)
    modes = np.zeros((len(structure.contacts), MODE_COLUMNS))
    forces = Forces.of(robot)
    modes_after_step(state, robot.p_BN, robot.first_node, robot.ground, forces.nodes, forces.frames, modes)
    assert np.count_nonzero(modes[:, 0]) > 0, "some nodes touch the ground"
    return robot, state, modes


@pytest.mark.parametrize("tetrahedra", [2, 5, 8])
@pytest.mark.parametrize(
    "changes", [{}, {"terrain": Rough(amplitude=2e-4, wavelength=0.03), "friction": Coulomb()}]
)
@pytest.mark.parametrize("seed", [0, 1])
def test_accelerations_are_those_of_the_diagram(scenario, tetrahedra, changes, seed):
    scenario = scenario.with_changes({"robot.tetrahedra": tetrahedra, **changes})
    robot, state, modes = disturbed_robot(scenario, seed)
    acceleration = forces_of(robot, state, modes)[1] / inertia_of(robot, tetrahedra)

    diagram = MakeTensegrityDiagram(Robot.of(scenario), seeded_gait(scenario))
    context = diagram.CreateDefaultContext()
    context.SetContinuousState(state)
    ground = diagram.GetSubsystemByName("ground")
    ground.GetMyMutableContextFromRoot(context).SetDiscreteState(0, modes.ravel())
    expected = diagram.EvalTimeDerivatives(context).CopyToVector()[7 * tetrahedra :]
    # The diagram's plant makes up for the rounding of rotated inertias; both are exact to 1e-9.
    np.testing.assert_allclose(acceleration, expected, rtol=1e-7, atol=1e-7)


UNEVEN = Rough(amplitude=0.0005, wavelength=0.03, seed=1)
"""Ground that slopes by some degrees under the robot, of which some nodes touch it."""


@pytest.mark.parametrize("terrain", [Flat(), UNEVEN])
@pytest.mark.parametrize(
    "friction",
    [
        ResetIntegrator(
            stiction_range=1e-4,
            stiction_damping=70.0,
            stiction_switch=0.7,
            proportional_stiction=0.0,
        ),
        Coulomb(static=50.0),
    ],
)
def test_the_implicit_matrix_is_the_derivative_of_the_forces(scenario, terrain, friction):
    # With stiffness left out (it enters squared in time) and the small dependence of bristles
    # on speed switched off, d force / d velocity is minus the damping matrix. (A limit of Coulomb
    # friction would depend on the velocity by the normal force, too.)
    scenario = scenario.with_changes({"terrain": terrain, "friction": friction})
    robot, state, modes = disturbed_robot(scenario, 0)

    def with_velocity(velocity: np.ndarray) -> np.ndarray:
        return np.append(state[:35], velocity)

    columns = [
        forces_of(robot, with_velocity(change), modes)[1]
        - forces_of(robot, with_velocity(-change), modes)[1]
        for change in 1e-4 * np.eye(30)
    ]
    jacobian = np.array(columns).T / 2e-4
    time = 1e-9  # s, so short that time² stiffness counts for nothing
    forces, _ = forces_of(robot, with_velocity(np.zeros(30)), modes)
    rows, lines = np.zeros((5, BLOCK, ROW)), np.empty((JUNCTION_CABLES, 9))
    implicit_matrix(robot, modes, forces, time, lines, rows)
    full = np.zeros((30, 30 + BLOCK))
    for body in range(5):
        full[BLOCK * body : BLOCK * body + 6, BLOCK * body : BLOCK * body + ROW] = rows[body]
    upper = np.triu(full[:, :30], 1)
    damping = (upper + upper.T + np.diag(full.diagonal() - inertia_of(robot, 5))) / time
    # Differencing M + 1e-9 D costs 7 of 16 digits.
    np.testing.assert_allclose(damping, -jacobian, atol=2e-4 * np.abs(jacobian).max())


def test_the_implicit_matrix_has_the_stiffness_of_contacts(scenario):
    # At rest and without other stiffness, forces change with positions by the normal forces only.
    for key in ("outer_stiffness", "inner_stiffness"):
        scenario = scenario.with_numbers({f"robot.cables.{key}": 1e-12})
    robot, state, modes = disturbed_robot(scenario, 0)
    state[35:] = 0.0

    def forces_moved(motion: np.ndarray) -> np.ndarray:
        moved = state.copy()
        move_bodies(state, motion, 1.0, moved)
        return forces_of(robot, moved, modes)[1]

    columns = [forces_moved(m) - forces_moved(-m) for m in 1e-7 * np.eye(30)]
    jacobian = np.array(columns).T / 2e-7

    def matrix(time: float) -> np.ndarray:
        rows, lines = np.zeros((5, BLOCK, ROW)), np.empty((JUNCTION_CABLES, 9))
        implicit_matrix(robot, modes, forces_of(robot, state, modes)[0], time, lines, rows)
        return np.array([row[:, :BLOCK] for row in rows])

    # M + t D + t^2 K, at t = 0, 1, 2 s: the second difference is 2 K.
    stiffness = (matrix(2.0) - 2.0 * matrix(1.0) + matrix(0.0)) / 2.0
    k = scenario.ground.stiffness
    assert stiffness[:, 5, 5].max() == pytest.approx(2.0 * k, rel=1e-6), "both feet of a body press"
    for body in range(5):
        place = slice(BLOCK * body, BLOCK * body + BLOCK)
        expected = np.triu(-jacobian[place, place])
        # Turned levers change torques, too: by the force, k times 1 mm, that is 0.001 k.
        np.testing.assert_allclose(np.triu(stiffness[body]), expected, atol=0.003 * k)
