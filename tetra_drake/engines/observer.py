"""Observer of a Drake or MuJoCo simulation: computes the tally (see laws.tally) from states."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from tetra_drake.kernels.allocation import write_tables
from tetra_drake.kernels.compiling import compiled, machine_code
from tetra_drake.kernels.lanes import Table
from tetra_drake.kernels.packed import Packed, unpacked
from tetra_drake.laws.actuator import DRIVE
from tetra_drake.laws.contact import MODE_COLUMNS, update_modes
from tetra_drake.laws.forces import Forces, compute_forces, move_robot
from tetra_drake.laws.model import Model
from tetra_drake.laws.tally import Tally, observe, update_clearance
from tetra_drake.robot.driven import DrivenRobot

Parts: TypeAlias = Packed[tuple[Model, Tally, Forces]]
"""A robot, its tally, and the memory for its forces."""


class Observer:
    """Observer that computes the tally of a simulation from its states.

    States are added in the order of time, beginning at t = 0. Observing does not change the
    simulation.
    """

    def __init__(self, driven: DrivenRobot) -> None:
        robot = driven.robot
        model, signals = robot.model, robot.structure.signals
        self._tally = Tally.of(model, signals=signals, begins=driven.steady_start)
        self._parts = Packed((model, self._tally, Forces.of(model)))
        state, drives = robot.structure.initial_state, robot.starting_drives()
        self._observe = machine_code(
            observe_state, self._parts, 0.0, state, np.zeros(signals), drives
        )

    def add(self, time: float, state: np.ndarray, signals: np.ndarray, drives: np.ndarray) -> None:
        """Adds the state (13 bodies,), signals (m,) in N, and drives at a time (s)."""
        self._observe(self._parts, time, state, signals, drives)

    def follow(self, other: Observer) -> None:
        """Continues the tally of another observer."""
        write_tables(self._tally, other._tally)

    def totals(self) -> Tally:
        """The tally of all added states."""
        return self._tally


@compiled
def observe_state(parts: Parts, time: float, state: Table, signals: Table, drives: Table) -> None:
    """Adds a state (13 bodies,), signals (m,) and drives at a time (s) to the tally.

    The tally does not depend on friction modes.
    """
    robot, tally, forces = unpacked(parts)
    modes = np.zeros((robot.ground.contacts.size, MODE_COLUMNS))
    generalized = np.empty(6 * robot.bodies.mass.size)
    move_robot(robot, state, forces)
    update_modes(state, forces.nodes, robot.ground, forces.frames, modes)
    for i in range(drives.size):
        forces.drives[i, DRIVE] = drives[i]
    compute_forces(robot, state, modes, signals, True, forces, generalized)
    observe(tally, robot, time, signals, forces)
    update_clearance(tally, robot, state, forces.nodes)
