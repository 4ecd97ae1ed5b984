"""The implicit matrix of the equations of motion, against differences of the forces."""

import numpy as np
import pytest
from helpers.anchored import TREES, scenario_of
from helpers.kernels import Stepper
from helpers.states import disturbed, mass_matrix

from tetra_drake.engines.lanes.dynamics import Solver
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.contact import MODE_COLUMNS
from tetra_drake.laws.forces import Forces
from tetra_drake.laws.friction import Coulomb, ResetIntegrator
from tetra_drake.laws.kinematics import move_bodies
from tetra_drake.laws.mode_change import modes_after_step
from tetra_drake.laws.model import Model
from tetra_drake.laws.sparse import BLOCK
from tetra_drake.laws.terrain import Flat, Rough
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario


def force_of(robot: Model, state: np.ndarray, modes: np.ndarray) -> np.ndarray:
    """Force on the bodies (6 n,) without actuation."""
    return Stepper(robot).force_at(state, modes, np.zeros(1 + robot.cables.signal.max()))


def damping_and_stiffness(
    robot: Model, state: np.ndarray, modes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The matrices D and K (6 n, 6 n) in the implicit matrix M + t D + t² K."""
    stepper = Stepper(robot)
    stepper.force_at(state, modes, np.zeros(1 + robot.cables.signal.max()))
    mass, longer, shorter = (stepper.matrix(modes, time) for time in (0.0, 1e-3, -1e-3))
    np.testing.assert_allclose(mass, mass_matrix(robot, state), atol=1e-12)
    return (longer - shorter) / 2e-3, (longer + shorter - 2.0 * mass) / 2e-6


def disturbed_robot(scenario: Scenario) -> tuple[Model, np.ndarray, np.ndarray]:
    """The robot, its state in motion with some nodes in the ground, and their modes."""
    whole = Robot.of(scenario)
    robot, structure = whole.model, whole.structure
    state = disturbed(structure, 0, pose=1e-3, speed=0.05)
    modes = np.zeros((len(structure.contacts), MODE_COLUMNS))
    modes_after_step(Packed((robot, Forces.of(robot))), state, modes)
    assert np.count_nonzero(modes[:, 0]) > 0, "some nodes touch the ground"
    return robot, state, modes


ROUND_FEET = {"robot.struts.bar.contact_radius": "8 mm"}
UNEVEN = Rough(amplitude=0.0005, wavelength=0.03, seed=1)
"""Ground that slopes by some degrees under the robot, of which some nodes touch it."""


def held_robot(name: str) -> tuple[Model, np.ndarray, np.ndarray]:
    """A structure without ground, its state slightly displaced, and no contact modes."""
    robot = Robot.of(scenario_of(TREES[name]))
    state = disturbed(robot.structure, 0, pose=1e-3, speed=0.0)
    return robot.model, state, np.zeros((0, MODE_COLUMNS))


RESET = ResetIntegrator(
    stiction_range=1e-4, stiction_damping=70.0, stiction_switch=0.7, proportional_stiction=0.0
)
STUCK = Coulomb(static=50.0)
GROUNDS = [("thesis", Flat(), RESET), ("thesis", UNEVEN, STUCK), ("six_bar", UNEVEN, RESET)]
GROUNDS += [("mast", Flat(), STUCK), ("held", None, None), ("star", None, None)]


@pytest.mark.parametrize(("name", "terrain", "friction"), GROUNDS)
def test_the_implicit_matrix_is_the_derivative_of_the_forces(name, terrain, friction):
    # With stiffness left out (it enters squared in time) and the small dependence of bristles
    # on speed switched off, d force / d velocity is minus the damping matrix. (A limit of Coulomb
    # friction would depend on the velocity by the normal force, too.) Gyroscopic torques are left
    # out of the matrix; at these small velocities they hardly count.
    if name in ("held", "star"):
        robot, state, modes = held_robot(name)
        assert (Solver.of(robot).schedule.order[0] == 0) == (name == "held")
    else:
        scenario = load_scenario(name).with_changes({"terrain": terrain, "friction": friction})
        if name == "six_bar":
            scenario = scenario.with_changes(ROUND_FEET)
        robot, state, modes = disturbed_robot(scenario)
    poses = 7 * len(robot.bodies.mass)
    state[poses:] = 0.0

    def force_at(velocity: np.ndarray) -> np.ndarray:
        return force_of(robot, np.append(state[:poses], velocity), modes)

    changes = 1e-4 * np.eye(len(state) - poses)
    jacobian = np.array([force_at(v) - force_at(-v) for v in changes]).T / 2e-4
    damping, _ = damping_and_stiffness(robot, state, modes)
    np.testing.assert_allclose(damping, -jacobian, atol=2e-4 * np.abs(jacobian).max())


def test_the_implicit_matrix_has_the_stiffness_of_contacts(scenario):
    # At rest and without other stiffness, forces change with positions by the normal forces only.
    for key in ("outer_stiffness", "inner_stiffness"):
        scenario = scenario.with_numbers({f"robot.cables.{key}": 1e-12})
    robot, state, modes = disturbed_robot(scenario)
    state[35:] = 0.0

    def forces_moved(motion: np.ndarray) -> np.ndarray:
        moved = state.copy()
        move_bodies(state, motion, 1.0, moved)
        return force_of(robot, moved, modes)

    columns = [forces_moved(m) - forces_moved(-m) for m in 1e-7 * np.eye(30)]
    jacobian = np.array(columns).T / 2e-7
    _, stiffness = damping_and_stiffness(robot, state, modes)
    k = scenario.ground.stiffness
    assert stiffness.max() == pytest.approx(2.0 * k, rel=1e-6), "both feet of a body press"
    for body in range(5):
        place = slice(BLOCK * body, BLOCK * body + BLOCK)
        # Turned levers change torques, too: by the force, k times 1 mm, that is 0.001 k.
        upper = np.triu(stiffness[place, place]), np.triu(-jacobian[place, place])
        np.testing.assert_allclose(*upper, atol=0.003 * k)
