"""Rates of a robot's state: accelerations of the bodies, and rates of the actuators' states."""

from __future__ import annotations

import numpy as np

from tetra_drake.kernels.compiling import compiled
from tetra_drake.kernels.lanes import Table
from tetra_drake.kernels.packed import Packed, unpacked
from tetra_drake.laws.actuator import DRIVE, RATE
from tetra_drake.laws.forces import Forces, Parts, compute_forces, move_robot
from tetra_drake.laws.inertia import over_inertia
from tetra_drake.laws.model import Model


def rates_of_motion(
    robot: Model, states: np.ndarray, modes: np.ndarray, signals: np.ndarray, drives: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations dv/dt (k, 6*bodies) of the bodies, and rates (k, drives) of the actuators'
    states, at each of k times. For the arguments see forces_of_motion()."""
    accelerations, rates = (
        np.empty((len(states), 6 * robot.bodies.mass.size)),
        np.empty_like(drives),
    )
    parts = Packed((robot, Forces.of(robot)))
    rates_along(parts, states, modes, signals, drives, accelerations, rates)
    return accelerations, rates


@compiled
def rates_along(
    parts: Parts,
    states: Table,
    modes: Table,
    signals: Table,
    drives: Table,
    accelerations: Table,
    rates: Table,
) -> None:
    """Writes the last two arguments, the tables of rates_of_motion(). `parts` is a Model and its
    Forces."""
    robot, forces = unpacked(parts)
    inertia = robot.bodies.inertia if robot.isotropic else forces.inertia
    for k in range(states.shape[0]):
        move_robot(robot, states[k], forces)
        for i in range(drives.shape[1]):
            forces.drives[i, DRIVE] = drives[k, i]
        compute_forces(robot, states[k], modes[k], signals[k], False, forces, accelerations[k])
        for body in range(robot.bodies.mass.size):
            a = 6 * body
            torque = accelerations[k, a], accelerations[k, a + 1], accelerations[k, a + 2]
            spin = over_inertia(inertia, body, torque)
            for axis in range(3):
                accelerations[k, a + axis] = spin[axis]
                accelerations[k, a + 3 + axis] /= robot.bodies.mass[body]
        for i in range(drives.shape[1]):
            rates[k, i] = forces.drives[i, RATE]
