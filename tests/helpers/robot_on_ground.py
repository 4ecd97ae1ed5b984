"""The robot on the ground, all of its bodies moving alike, and its contact modes."""

import numpy as np

from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.contact import MODE_COLUMNS
from tetra_drake.laws.forces import Forces, move_contacts
from tetra_drake.laws.mode_change import modes_after_step, time_to_mode_change
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.scenario import Scenario

REST = (0.0, 0.0, 0.0)
TOUCHING = (0.0, 0.0, -1e-4)
"""Shift (m) that puts the bottom nodes 0.1 mm into the ground."""


class RobotOnGround:
    """A robot whose contact nodes are in the air at first; `modes` are as last updated.

    The robot is at the start, shifted by p (m) and moving at v (m/s), vectors along the t1, t2 and
    n of the ground, whose axes in World are the columns of R.
    """

    def __init__(self, scenario: Scenario, R: np.ndarray) -> None:
        robot = Robot.of(scenario)
        self.structure, self.model, self.R = robot.structure, robot.model, R
        self.modes = np.zeros((len(self.structure.contacts), MODE_COLUMNS))

    def state(self, v=REST, p=TOUCHING) -> np.ndarray:
        state = self.structure.initial_state
        state[:35].reshape(5, 7)[:, 4:] += self.R @ p
        state[35:].reshape(5, 6)[:, 3:] = self.R @ v
        return state

    def update_at(self, state: np.ndarray) -> bool:
        """Updates the modes. Returns True if they changed."""
        parts = Packed((self.model, Forces.of(self.model)))
        return bool(modes_after_step(parts, state, self.modes))

    def update(self, v=REST, p=TOUCHING) -> bool:
        return self.update_at(self.state(v, p))

    def time_to_change(self, v=REST, a=REST, p=TOUCHING) -> float:
        """Time (s) until the next mode change at an acceleration a (m/s²), at most 9 s."""
        state, forces = self.state(v, p), Forces.of(self.model)
        acceleration = np.tile([0.0, 0.0, 0.0, *(self.R @ a)], 5)
        move_contacts(self.model, state, forces)
        return time_to_mode_change(self.model, state, acceleration, self.modes, forces, 9.0)

    def is_due_at(self, state: np.ndarray) -> bool:
        """True if a mode changes at once when a step ends here."""
        kept = self.modes.copy()
        due = self.update_at(state)
        self.modes[:] = kept
        return due

    def is_due(self, v=REST, p=TOUCHING) -> bool:
        return self.is_due_at(self.state(v, p))
