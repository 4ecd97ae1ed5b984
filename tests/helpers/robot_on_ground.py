"""The robot on the ground, all of its bodies moving alike, and its contact modes."""

import numpy as np

from tetra_drake.physics.contact import (
    MODE_COLUMNS,
    PUSH_COLUMNS,
    add_ground_forces,
    meet_ground,
    update_modes,
)
from tetra_drake.physics.kinematics import NODE_COLUMNS
from tetra_drake.physics.mode_change import mode_margin, time_to_mode_change
from tetra_drake.physics.terrain import FRAME_COLUMNS
from tetra_drake.robot.ground import make_ground
from tetra_drake.robot.robot import MakeStructure
from tetra_drake.scenario.schema import Scenario

REST = (0.0, 0.0, 0.0)
TOUCHING = (0.0, 0.0, -1e-4)
"""Shift (m) that puts the bottom nodes 0.1 mm into the ground."""


class RobotOnGround:
    """A robot whose contact nodes are in the air at first; `modes` are as last updated.

    The robot is at the start, shifted by p (m) and moving at v (m/s), vectors along the t1, t2 and
    n of the ground, whose axes in World are the columns of R.
    """

    def __init__(self, scenario: Scenario, R: np.ndarray) -> None:
        self.structure, self.R = MakeStructure(scenario), R
        self.points = self.structure.p_BN, self.structure.first_node
        self.ground = make_ground(scenario, self.structure)
        self.modes = np.zeros((len(self.structure.contacts), MODE_COLUMNS))

    def state(self, v=REST, p=TOUCHING) -> np.ndarray:
        state = self.structure.initial_state
        state[:35].reshape(5, 7)[:, 4:] += self.R @ p
        state[35:].reshape(5, 6)[:, 3:] = self.R @ v
        return state

    def meet(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The nodes and frames of a state."""
        nodes = np.empty((len(self.structure.node_names), NODE_COLUMNS))
        frames = np.empty((len(self.modes), FRAME_COLUMNS))
        meet_ground(state, *self.points, self.ground, nodes, frames)
        return nodes, frames

    def update_at(self, state: np.ndarray) -> bool:
        """Brings the modes up to date; whether they changed."""
        nodes, frames = self.meet(state)
        return update_modes(state, nodes, self.ground, frames, self.modes)

    def update(self, v=REST, p=TOUCHING) -> bool:
        return self.update_at(self.state(v, p))

    def forces(self, v=REST, p=TOUCHING) -> tuple[np.ndarray, np.ndarray]:
        """The nodes with the forces on them, and the ground's pushes."""
        nodes, frames = self.meet(self.state(v, p))
        pushes = np.full((len(self.modes), PUSH_COLUMNS), np.nan)
        add_ground_forces(nodes, self.modes, self.ground, frames, True, pushes)
        return nodes, pushes

    def time_to_change(self, v=REST, a=REST, p=TOUCHING) -> float:
        """Until the next mode change, at most 9 s, at an acceleration a (m/s²)."""
        state = self.state(v, p)
        nodes, frames = self.meet(state)
        acceleration = np.tile([0.0, 0.0, 0.0, *(self.R @ a)], 5)
        args = self.modes, self.ground, frames
        return time_to_mode_change(state, acceleration, nodes, *args, 9.0)

    def margin_at(self, state: np.ndarray) -> float:
        nodes, frames = self.meet(state)
        return mode_margin(state, self.modes, *self.points, self.ground, nodes, frames)

    def margin(self, v=REST, p=TOUCHING) -> float:
        return self.margin_at(self.state(v, p))
