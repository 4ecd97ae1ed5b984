"""Observer of a Drake or MuJoCo simulation: computes the tally (see physics.tally) from states."""

from __future__ import annotations

import numpy as np

from tetra_drake.physics.actuator import DRIVE
from tetra_drake.physics.contact import MODE_COLUMNS, update_modes
from tetra_drake.physics.forces import Forces, compute_forces, move_robot
from tetra_drake.physics.model import Model
from tetra_drake.physics.tally import Tally, observe, update_clearance
from tetra_drake.results.metrics import steady_start
from tetra_drake.robot.robot import Robot
from tetra_drake.simd.compiling import compiled
from tetra_drake.simd.lanes import Table

_TOGETHER = 1000  # observations per call: calls of kernels with many tables are slow


class Observer:
    """Observer that computes the tally of a simulation from its states.

    States are added in the order of time, beginning at t = 0. Observing does not change the
    simulation.
    """

    def __init__(self, robot: Robot) -> None:
        self._model, begins = robot.model, steady_start(robot.scenario)
        self._tally = Tally.of(robot.model, signals=robot.structure.signals, begins=begins)
        self._modes = np.zeros((len(robot.structure.contacts), MODE_COLUMNS))
        self._forces = Forces.of(robot.model)
        self._waiting: list[tuple[float, np.ndarray, np.ndarray, np.ndarray]] = []

    def add(self, time: float, state: np.ndarray, signals: np.ndarray, drives: np.ndarray) -> None:
        """Adds the state (13 bodies,), signals (m,) in N, and drives at a time (s)."""
        self._waiting.append((time, state, signals, drives))
        if len(self._waiting) == _TOGETHER:
            self._flush()

    def totals(self) -> Tally:
        """The tally of all added states."""
        self._flush()
        return self._tally

    def _flush(self) -> None:
        if not self._waiting:
            return
        columns = tuple(np.array(column) for column in zip(*self._waiting, strict=True))
        observe_states(self._model, self._tally, self._forces, self._modes, *columns)
        self._waiting = []


@compiled
def observe_states(
    robot: Model,
    tally: Tally,
    forces: Forces,
    modes: Table,
    times: Table,
    states: Table,
    signals: Table,
    drives: Table,
) -> None:
    """Adds states (k, 13 bodies), signals (k, m) and drives at times (k,) to a tally.

    `modes` (contacts, MODE_COLUMNS) is scratch memory. The tally does not depend on friction modes.
    """
    generalized = np.empty(6 * robot.bodies.mass.size)
    for k in range(times.size):
        modes[:] = 0.0
        move_robot(robot, states[k], forces)
        update_modes(states[k], forces.nodes, robot.ground, forces.frames, modes)
        forces.drives[:, DRIVE] = drives[k]
        compute_forces(robot, states[k], modes, signals[k], True, forces, generalized)
        observe(tally, robot, times[k], states[k], signals[k], forces)
        update_clearance(tally, robot, states[k], forces.nodes)
