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

from tetra_drake.engines.compiled.block_tridiagonal import BLOCK, factorise, solve
from tetra_drake.engines.compiled.dynamics import implicit_matrix, inertia
from tetra_drake.physics.forces import Forces, compute_forces, move_robot
from tetra_drake.physics.kinematics import move_bodies
from tetra_drake.physics.model import Model
from tetra_drake.simd.compiling import inlined, merged
from tetra_drake.simd.lanes import Real, Table, select

GAMMA = 1.0 - 1.0 / math.sqrt(2.0)


class Step(NamedTuple):
    """A step from `state` to `end`, (13 bodies,), and what is computed on the way."""

    state: Table
    end: Table
    force: Table
    """(6 bodies,), at the state; so are the following."""
    end_force: Table
    change: Table
    stage: Table
    k1: Table
    k2: Table
    rows: Table
    """(bodies, 6, 12)."""
    lines: Table
    """(JUNCTION_CABLES, 9)."""


@merged
def take_step(
    robot: Model, work: Step, modes: Table, forces: Forces, signals: Table, step: Real, keep: bool
) -> Real:
    """Writes the end of a step (s); `signals` are the end's. What is given of the state: `forces`,
    whose nodes and frames are overwritten, and work.force. With `keep`, all `forces` become those
    of the second stage, at the end of the step to order 1.

    Returns the difference to the first-order solution within: the largest of any body's
    velocity (m/s), of rotation that of its nodes; NaN if one is.
    """
    state, end, k1, k2, stage = work.state, work.end, work.k1, work.k2, work.stage
    size, scaled = work.force.size, GAMMA * step
    bodies = size // BLOCK
    first = state.size - size
    implicit_matrix(robot, modes, forces, scaled, work.lines, work.rows)
    factorise(work.rows)

    for i in range(size):
        stage[i] = end[first + i] = state[first + i]
    move_bodies(state, stage, step, end)
    move_robot(robot, end, forces)
    compute_forces(robot, modes, signals, False, forces, work.end_force)
    for i in range(size):
        work.change[i] = GAMMA * (work.end_force[i] - work.force[i])
        k1[i] = work.force[i] + work.change[i]
    solve(work.rows, k1)

    for i in range(size):
        stage[i] = state[first + i] + scaled * k1[i]
        end[first + i] = state[first + i] + step * k1[i]
    move_bodies(state, stage, step, end)
    move_robot(robot, end, forces)
    compute_forces(robot, modes, signals, keep, forces, work.end_force)
    for body in range(bodies):
        for j in range(BLOCK):
            i = BLOCK * body + j
            k2[i] = work.end_force[i] - 2.0 * (inertia(robot, j) * k1[i]) - work.change[i]
    solve(work.rows, k2)

    turn, shift = 0.0, 0.0
    for body in range(bodies):
        for j in range(BLOCK):
            i = BLOCK * body + j
            velocity, difference = state[first + i], abs(k1[i] + k2[i])
            # The position's second stage is stage 2's velocity - 2 (stage 1's rate) + γ h k2.
            stage_2 = velocity + step * k1[i] - 2.0 * stage[i] + scaled * k2[i]
            stage[i] = 1.5 * stage[i] + 0.5 * stage_2
            end[first + i] = velocity + step * (1.5 * k1[i] + 0.5 * k2[i])
            if j < 3:
                turn = larger(turn, difference)
            else:
                shift = larger(shift, difference)
    move_bodies(state, stage, step, end)
    return 0.5 * step * larger(robot.body.radius[0] * turn, shift)


@inlined
def larger(x: Real, y: Real) -> Real:
    """The larger; NaN if either is."""
    return select((y > x) | (y != y), y, x)
