"""One step of the compiled engine: its order, and its estimate of the error."""

import numpy as np
import pytest
from helpers.kernels import Stepper

from tetra_drake.engines.lanes.ros2 import larger
from tetra_drake.laws.contact import CONTACT, MODE, MODE_COLUMNS, STICK_POINT
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.scenario import Scenario

PULL = np.array([1.0, -2.0, 3.0, 0.5])
"""Rise of the signals per second, in 100 N."""


class FrozenStepper(Stepper):
    """The robot on the ground, its nodes sticking or slipping, with frozen modes and rising
    signals: nothing jumps, so a method shows its order."""

    def __init__(self, scenario: Scenario) -> None:
        robot = Robot.of(scenario)
        super().__init__(robot.model)
        self.structure = robot.structure
        contacts = self.structure.contacts
        self.modes = np.zeros((len(contacts), MODE_COLUMNS))
        self.modes[:-1, CONTACT] = 1.0
        self.modes[:4, MODE] = [1.0, 0.0, -1.0, 1.0]
        self.modes[3:6, MODE + 1] = [-1.0, 1.0, 0.0]
        places = node_positions(self.structure, self.structure.initial_state)[contacts, :2]
        self.modes[:, STICK_POINT : STICK_POINT + 2] = places

    def start(self) -> np.ndarray:
        """A state half a millimetre in the ground, all bodies sliding to one side and turning."""
        state, generator = self.structure.initial_state, np.random.default_rng(3)
        state[6:35:7] -= 5e-4
        state[35:] = np.tile([0.0, 0.0, 0.0, 0.06, 0.04, 0.0], 5)
        state[35:] += generator.normal(scale=0.005, size=30)
        return state

    def walk(self, duration: float, steps: int) -> tuple[np.ndarray, float]:
        """The state after so many equal steps, and the estimated error of the first."""
        h, work = duration / steps, self.work
        work.state[:] = self.start()
        pull = 1e2 * PULL * h
        estimates = [self.take(self.modes, pull * i, pull * (i + 1), h) for i in range(steps)]
        return work.state.copy(), estimates[0]


@pytest.fixture
def stepper(scenario: Scenario) -> FrozenStepper:
    # With a fortieth of the damping of cables and ground: the stiffer an equation, the shorter the
    # steps from which on a method shows its order.
    soft = {"robot.cables.damping": "0.2 N*s/m", "friction.stiction_damping": "2.0 N*s/m"}
    soft["ground.damping"] = "5e3 N*s/m^2"
    soft["ground.stiffness"] = "200 N/m"  # so that the weight keeps the nodes in the ground
    soft["friction.reset"] = "reversal"  # without the jumps of a deflection that restarts
    return FrozenStepper(scenario.with_changes(soft))


def test_half_the_step_has_a_quarter_of_the_error(stepper):
    duration = 4e-3
    exact, _ = stepper.walk(duration, 4096)
    errors = [np.abs(stepper.walk(duration, steps)[0] - exact) for steps in (32, 64)]
    # Positions, turns, velocities and spins each converge, at order 2.
    for part in (slice(0, 35), slice(35, 65)):
        assert errors[0][part].max() / errors[1][part].max() == pytest.approx(4.0, rel=0.12)


def test_the_estimate_is_the_error_of_a_solution_of_first_order(stepper):
    # Half the step has a quarter of it, and it bounds the true error of small steps.
    estimates, true = [], []
    for h in (1e-4, 5e-5):
        exact, _ = stepper.walk(h, 64)
        end, estimate = stepper.walk(h, 1)
        estimates.append(estimate)
        speeds = (end - exact)[35:].reshape(5, 6)
        speeds[:, :3] *= stepper.robot.bodies.radius[0]
        true.append(np.abs(speeds).max())
    assert estimates[0] / estimates[1] == pytest.approx(4.0, rel=0.1)
    assert 0.0 < true[0] < estimates[0] and 0.0 < true[1] < estimates[1]
    assert true[0] / true[1] == pytest.approx(8.0, rel=0.2), "of a step of order 2"


def test_an_error_that_is_not_a_number_is_not_lost():
    assert larger(1.0, 2.0) == larger(2.0, 1.0) == 2.0
    assert np.isnan(larger(1.0, np.nan)) and np.isnan(larger(np.nan, 1.0))
