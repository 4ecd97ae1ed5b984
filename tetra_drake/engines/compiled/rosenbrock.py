"""One step of ROS2, a linearly implicit Runge-Kutta method of order 2.

J. G. Verwer, E. J. Spee, J. G. Blom and W. Hundsdorfer, "A second-order Rosenbrock method
applied to photochemical dispersion problems", SIAM J. Sci. Comput. 20 (1999). With
A an approximation of the Jacobian of y' = f(t, y):

    (1 - γ h A) k1 = f(t, y) + γ h df/dt
    (1 - γ h A) k2 = f(t + h, y + h k1) - 2 k1 - γ h df/dt
    y(t + h) = y + 3/2 h k1 + 1/2 h k2

It is of order 2 whatever A is, and stable at any step with the exact one. Here A holds the
dampings (a symmetric matrix, block-tridiagonal since cables join neighbours) and the
stiffness of contacts. How forces change with positions otherwise, and with the signals, is not
stiff, but where damping dominates it decides the motion: left out, the method falls to order 1.
It enters by its product with the velocities, a difference of forces along the motion.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tetra_drake.engines.compiled.block_tridiagonal import BLOCK, ROW, factorise, solve
from tetra_drake.engines.compiled.dynamics import (
    Forces,
    compute_forces,
    implicit_matrix,
    make_forces,
    move_bodies,
    multiply_by_mass,
)
from tetra_drake.physics.compiling import compiled
from tetra_drake.robot.model import Model

Array = np.ndarray

GAMMA = 1.0 - 1.0 / math.sqrt(2.0)


class Stages(NamedTuple):
    """Room for a step to work in."""

    forces: Forces
    rows: Array
    row: Array
    state: Array
    force_change: Array
    rates_1: Array
    rates_2: Array
    velocities: Array


@compiled
def make_stages(robot: Model, bodies: int) -> Stages:
    """Room for the steps of a robot of this many bodies."""
    size = BLOCK * bodies
    return Stages(
        make_forces(robot, bodies),
        np.empty((bodies, BLOCK, ROW)),
        np.zeros(ROW),
        np.empty(13 * bodies),
        np.empty(size),
        np.empty(size),
        np.empty(size),
        np.empty(size),
    )


@compiled
def take_step(
    robot: Model,
    state: Array,
    modes: Array,
    forces: Forces,
    signals: Array,
    step: float,
    stages: Stages,
) -> float:
    """Takes a step (s); the new state is left in `stages.state`.

    `forces` are those at `state`, `signals` those at the step's end. Returns the difference to
    the first-order solution within: the largest of any body's velocity (m/s), of rotation
    that of its nodes.
    """
    bodies = state.size // 13
    first = 7 * bodies
    velocities = state[first:]
    end, change, k1, k2 = stages.forces, stages.force_change, stages.rates_1, stages.rates_2

    stages.state[first:] = velocities
    move_bodies(state, velocities, step, stages.state)
    compute_forces(robot, stages.state, modes, signals, end)
    for i in range(change.size):
        change[i] = GAMMA * (end.generalized_force[i] - forces.generalized_force[i])
    implicit_matrix(robot, modes, forces, GAMMA * step, stages.row, stages.rows)
    factorise(stages.rows)

    for i in range(k1.size):
        k1[i] = forces.generalized_force[i] + change[i]
    solve(stages.rows, k1)
    for i in range(k1.size):
        stages.velocities[i] = velocities[i] + GAMMA * step * k1[i]
        stages.state[first + i] = velocities[i] + step * k1[i]
    move_bodies(state, stages.velocities, step, stages.state)

    compute_forces(robot, stages.state, modes, signals, end)
    multiply_by_mass(robot, k1, k2)
    for i in range(k2.size):
        k2[i] = end.generalized_force[i] - 2.0 * k2[i] - change[i]
    solve(stages.rows, k2)

    error = 0.0
    for i in range(k2.size):
        # The position's second stage is stage 2's velocity - 2 (stage 1's rate) + γ h k2.
        second = stages.state[first + i] - 2.0 * stages.velocities[i] + GAMMA * step * k2[i]
        stages.velocities[i] = 1.5 * stages.velocities[i] + 0.5 * second
        stages.state[first + i] = velocities[i] + step * (1.5 * k1[i] + 0.5 * k2[i])
        difference = 0.5 * step * abs(k1[i] + k2[i])
        if i % BLOCK < 3:
            difference *= robot.radius
        if difference > error or math.isnan(difference):
            error = difference
    move_bodies(state, stages.velocities, step, stages.state)
    return error
