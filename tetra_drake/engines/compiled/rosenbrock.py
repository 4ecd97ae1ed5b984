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

import numpy as np

from tetra_drake.engines.compiled.block_tridiagonal import BLOCK, factorise, solve
from tetra_drake.engines.compiled.dynamics import (
    Forces,
    compute_forces,
    implicit_matrix,
    move_bodies,
)
from tetra_drake.physics.compiling import compiled
from tetra_drake.physics.kinematics import move_nodes
from tetra_drake.robot.model import Model

Array = np.ndarray

GAMMA = 1.0 - 1.0 / math.sqrt(2.0)


@compiled
def take_step(
    robot: Model, state: Array, modes: Array, forces: Forces, signals: Array, step: float
) -> tuple[Array, float]:
    """The state after a step (s) from `state`, where `forces` are; `signals` are the end's.

    Also returns the difference to the first-order solution within: the largest of any body's
    velocity (m/s), of rotation that of its nodes.
    """
    first = state.size // 13 * 7
    velocities = state[first:]
    moved = move_bodies(state, velocities, step)
    nodes = move_nodes(moved, robot.p_BN)
    change = compute_forces(robot, nodes, modes, signals).generalized
    change -= forces.generalized
    change *= GAMMA
    rows = implicit_matrix(robot, modes, forces, GAMMA * step)
    factorise(rows)
    k1 = forces.generalized + change
    solve(rows, k1)
    stage_1 = velocities + GAMMA * step * k1
    end = move_bodies(state, stage_1, step)
    for i in range(change.size):
        end[first + i] = velocities[i] + step * k1[i]

    nodes = move_nodes(end, robot.p_BN)
    k2 = compute_forces(robot, nodes, modes, signals).generalized
    for i in range(change.size):
        k2[i] = k2[i] - 2.0 * (robot.inertia[i] * k1[i]) - change[i]
    solve(rows, k2)

    error = 0.0
    for i in range(change.size):
        # The position's second stage is stage 2's velocity - 2 (stage 1's rate) + γ h k2.
        stage_2 = end[first + i] - 2.0 * stage_1[i] + GAMMA * step * k2[i]
        stage_1[i] = 1.5 * stage_1[i] + 0.5 * stage_2
        difference = 0.5 * step * abs(k1[i] + k2[i])
        if i % BLOCK < 3:
            difference *= robot.radius
        if difference > error or math.isnan(difference):
            error = difference
    end = move_bodies(state, stage_1, step)
    for i in range(change.size):
        end[first + i] = velocities[i] + step * (1.5 * k1[i] + 0.5 * k2[i])
    return end, error
