"""Sums over the steps of a Drake or MuJoCo simulation, such as work and lifted time.

See laws.tally for the sums.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from tetra_drake.kernels.compiling import compiled, machine_code
from tetra_drake.kernels.lanes import Table
from tetra_drake.kernels.packed import Packed, unpacked
from tetra_drake.laws.actuator import DRIVE
from tetra_drake.laws.contact import MODE_COLUMNS, update_modes
from tetra_drake.laws.forces import Forces, compute_forces, move_robot
from tetra_drake.laws.model import Model
from tetra_drake.laws.tally import Tally, observe, update_clearance
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot

CLEARED = 16
"""Number of states in one call of add() from one computation of the clearance to the next."""

TallyParts: TypeAlias = Packed[tuple[Model, Tally, Forces]]
"""Robot, tally, and memory for the forces, packed for kernels."""


class Observer:
    """Sums over the steps of a simulation, such as the actuators' work and the time that bodies are
    off the ground, from its states.

    States are added in the order of time, beginning at t = 0. Observing does not change the
    simulation.
    """

    def __init__(self, driven: DrivenRobot) -> None:
        model, signals = driven.robot.model, driven.robot.structure.signals
        self.tally = Tally.of(model, signals=signals, begins=driven.steady_start)
        """Sums over all added states; see laws.tally."""
        self.follow(driven.robot)

    def follow(self, robot: Robot) -> None:
        """Observes what an event has left of the robot, from now on."""
        signals = robot.structure.signals
        parts = Packed((robot.model, self.tally, Forces.of(robot.model)))
        state, drives = robot.structure.initial_state, robot.starting_drives()
        one = np.zeros(1), state[np.newaxis], np.zeros((1, signals)), drives[np.newaxis]
        self._observe = machine_code(observe_states, parts, *one)

    def add(
        self, times: np.ndarray, states: np.ndarray, signals: np.ndarray, drives: np.ndarray
    ) -> None:
        """Adds the k steps that end at `times` (k,) in s to the sums. At the ends, the bodies have
        `states` [q; v] (k, 13*bodies), the signals (k, m) are in N, and the actuators have the
        states `drives` (k, drives)."""
        self._observe(times, states, signals, drives)


@compiled
def observe_states(
    parts: TallyParts, times: Table, states: Table, signals: Table, drives: Table
) -> None:
    """Adds steps of a simulation to the sums in the tally of `parts`; see Observer.add().

    The steps end at `times` (k,) in s. At the ends, the bodies have `states` (k, 13*bodies), the
    signals (k, m) are in N, and the actuators have the states `drives` (k, drives). The forces are
    computed again from these numbers; the tally does not need to know which nodes stick.

    The least distance between struts is slow to compute. So it is computed only for each 16th of
    the k states, and for the last.
    """
    robot, tally, forces = unpacked(parts)
    modes = np.zeros((robot.ground.contacts.size, MODE_COLUMNS))
    generalized = np.empty(6 * robot.bodies.mass.size)
    for k in range(times.size):
        state = states[k]
        move_robot(robot, state, forces)
        update_modes(state, forces.nodes, robot.ground, forces.frames, modes)
        for i in range(drives.shape[1]):
            forces.drives[i, DRIVE] = drives[k, i]
        compute_forces(robot, state, modes, signals[k], True, forces, generalized)
        observe(tally, robot, times[k], signals[k], forces)
        if (k + 1) % CLEARED == 0 or k + 1 == times.size:
            update_clearance(tally, robot, state, forces.nodes)
