"""Rates of a robot's state: accelerations of the bodies, and rates of the actuators' states."""

from __future__ import annotations

import numpy as np

from tetra_drake.engines.lanes.dynamics import accelerate
from tetra_drake.kernels.compiling import compiled
from tetra_drake.kernels.lanes import Table
from tetra_drake.kernels.packed import Packed, unpacked
from tetra_drake.laws.actuator import DRIVE, RATE
from tetra_drake.laws.forces import Forces, Parts, compute_forces, move_robot
from tetra_drake.laws.model import Model


def rates_and_forces(
    robot: Model, state: np.ndarray, modes: np.ndarray, signals: np.ndarray, drives: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Forces]:
    """Acceleration dv/dt (6*bodies,) of the bodies, rates (drives,) of the actuators' states, and
    the tables of forces, in a state.

    The state is [q; v] (13*bodies,), with the contact and friction modes (contacts, 12), signals
    (m,) in N, and states of the actuators `drives` (drives,).
    """
    forces, acceleration = Forces.of(robot), np.empty(6 * robot.bodies.mass.size)
    forces.drives[:, DRIVE] = drives
    compute_acceleration(Packed((robot, forces)), state, modes, signals, acceleration)
    return acceleration, forces.drives[:, RATE].copy(), forces


@compiled
def compute_acceleration(
    parts: Parts, state: Table, modes: Table, signals: Table, acceleration: Table
) -> None:
    """Writes dv/dt of the bodies to `acceleration` (6*bodies,), and all tables to the Forces. For
    the arguments see rates_and_forces(). `parts` is a Model and its Forces, which have the states
    of the actuators."""
    robot, forces = unpacked(parts)
    move_robot(robot, state, forces)
    compute_forces(robot, state, modes, signals, True, forces, acceleration)
    accelerate(robot, forces.inertia, acceleration, acceleration)
