"""Integration step by ROS2, a linearly implicit Runge-Kutta method of order 2.

J. G. Verwer, E. J. Spee, J. G. Blom and W. Hundsdorfer, "A second-order Rosenbrock method
applied to photochemical dispersion problems", SIAM J. Sci. Comput. 20 (1999). With
A an approximation of the Jacobian of y' = f(t, y):

    (1 - γ h A) k1 = f(t, y) + γ h df/dt
    (1 - γ h A) k2 = f(t + h, y + h k1) - 2 k1 - γ h df/dt
    y(t + h) = y + 3/2 h k1 + 1/2 h k2

The method is of order 2 for any A. With the exact Jacobian it is stable at any step. Here k1 and k2
are the rates of the velocities v. The rates of the positions are explicit:

    q1 = v + γ h k1
    q2 = v + h k1 - 2 q1 + γ h k2

A contains the stiff terms: dampings (a symmetric matrix with a block for each pair of bodies joined
by cables) and the stiffness of contacts, also of struts, and of anchors. A new law with stiffness
needs no Jacobian; a new law with damping must return dT/d(dl/dt).

In stage 2, the stiffness K of struts that touch adds -γ h² (1 - 2 γ) K k1 on the right-hand side,
the rest of γ h A k2 beside its part in the matrix. Without it, stiff contacts that hardly dissipate
would never come to rest.

The term df/dt is a difference of forces along the motion. It contains the effect of signals, and of
positions as far as A lacks it. Without df/dt, the method would be of order 1 where damping
dominates.

The equations are multiplied by the mass matrix at the beginning of the step. The mass matrix of a
body that is not isotropic turns with the body. Torques at the end of the step are converted to the
mass matrix at the beginning.
"""

from __future__ import annotations

import math

from tetra_drake.engines.lanes.dynamics import Solver, StepMemory, implicit_matrix, momentum
from tetra_drake.engines.lanes.touching import (
    add_touching,
    solve_touching,
    subtract_springs,
)
from tetra_drake.kernels.compiling import inlined, merged
from tetra_drake.kernels.lanes import Real, Table, select
from tetra_drake.laws.forces import Forces, compute_forces, move_robot
from tetra_drake.laws.inertia import INERTIA_COLUMNS, over_inertia, times_inertia
from tetra_drake.laws.kinematics import P_BN_W, move_bodies
from tetra_drake.laws.model import Model
from tetra_drake.laws.sparse import BLOCK, factorise
from tetra_drake.laws.vectors import Vector3, cross, vector_at

GAMMA = 1.0 - 1.0 / math.sqrt(2.0)


@merged
def take_step(
    robot: Model,
    solver: Solver,
    work: StepMemory,
    modes: Table,
    forces: Forces,
    step: Real,
    write_parts: bool,
) -> Real:
    """Writes the end of a step of length `step` (s) to `work.end`. Returns an estimate of its
    error.

    Input: `work.state`; `work.force` and `forces`, both computed for this state; and
    `work.end_signals`. `forces` is overwritten; with `write_parts` it holds the forces of cables
    and ground in stage 2 of ROS2.

    The error is the difference to the embedded first-order solution: the largest difference of a
    velocity (m/s) of a body or, for rotations, of its nodes. NaN if a velocity is NaN.
    """
    state, end, k1, k2 = work.state, work.end, work.k1, work.k2
    velocity, q1, mean_rate = work.velocity, work.q1, work.mean_rate
    size, scaled = work.force.size, GAMMA * step
    bodies = size // BLOCK
    first = state.size - size
    implicit_matrix(robot, solver, work, modes, forces, scaled)
    factorise(work.blocks, solver.schedule)
    add_touching(robot, solver.schedule, forces, scaled, work.blocks, work.touching)
    if not robot.isotropic:
        for body in range(bodies):
            for c in range(INERTIA_COLUMNS):
                work.inertia[body, c] = forces.inertia[body, c]

    for i in range(size):
        velocity[i] = end[first + i] = state[first + i]
    move_bodies(state, velocity, step, end)
    compute_end_forces(robot, work, modes, forces, False)
    for i in range(size):
        work.change[i] = GAMMA * (work.end_force[i] - work.force[i])
        k1[i] = work.force[i] + work.change[i]
    solve_touching(work.blocks, solver.schedule, work.touching, k1)

    for i in range(size):
        q1[i] = velocity[i] + scaled * k1[i]
        end[first + i] = velocity[i] + step * k1[i]
    move_bodies(state, q1, step, end)
    compute_end_forces(robot, work, modes, forces, write_parts)
    for body in range(bodies):
        gained = momentum(robot, work.inertia, k1, body)
        for j in range(BLOCK):
            i = BLOCK * body + j
            k2[i] = work.end_force[i] - 2.0 * gained[j] - work.change[i]
    subtract_springs(work.touching, (1.0 - 2.0 * GAMMA) / GAMMA, k1, k2)
    solve_touching(work.blocks, solver.schedule, work.touching, k2)

    for i in range(size):
        q2 = velocity[i] + step * k1[i] - 2.0 * q1[i] + scaled * k2[i]
        mean_rate[i] = 1.5 * q1[i] + 0.5 * q2
        end[first + i] = velocity[i] + step * (1.5 * k1[i] + 0.5 * k2[i])
    move_bodies(state, mean_rate, step, end)
    return 0.5 * step * largest_difference(robot, forces.nodes, k1, k2)


@inlined
def compute_end_forces(
    robot: Model, work: StepMemory, modes: Table, forces: Forces, write_parts: bool
) -> None:
    """Writes the generalized forces (6*bodies,) at the state work.end to work.end_force.

    Torques are converted to the mass matrix at the beginning of the step: the angular accelerations
    stay the same. `modes` are the contact modes during the step. `forces` is working memory;
    with `write_parts` it then holds the forces of cables and ground.
    """
    force = work.end_force
    move_robot(robot, work.end, forces)
    compute_forces(robot, work.end, modes, work.end_signals, write_parts, forces, force)
    if robot.isotropic:
        return
    for body in range(force.size // BLOCK):
        i = BLOCK * body
        torque = force[i], force[i + 1], force[i + 2]
        acceleration = over_inertia(forces.inertia, body, torque)
        force[i], force[i + 1], force[i + 2] = times_inertia(work.inertia, body, acceleration)


@inlined
def largest_difference(robot: Model, nodes: Table, k1: Table, k2: Table) -> Real:
    """Largest absolute component of k1 + k2, as the acceleration (m/s²) of a body or, for
    rotations, of its nodes and feet. NaN if a component is NaN.

    With the stages k1 and k2 (6*bodies,) of ROS2, (k1 + k2) / 2 times the step is the difference to
    the first-order solution. The spin of a thin bar about its axis does not count, unless it moves
    a round foot.
    """
    largest = 0.0
    for body in range(k1.size // BLOCK):
        i = BLOCK * body
        for j in range(3, BLOCK):
            largest = larger(largest, abs(k1[i + j] + k2[i + j]))
        x, y, z = k1[i] + k2[i], k1[i + 1] + k2[i + 1], k1[i + 2] + k2[i + 2]
        if robot.isotropic:
            turn = larger(larger(abs(x), abs(y)), abs(z))
            largest = larger(largest, robot.bodies.radius[body] * turn)
        else:
            for node in range(robot.first_node[body], robot.first_node[body + 1]):
                largest = larger(largest, motion_at(nodes, node, (x, y, z)))
    if not robot.ground.is_round:
        return largest
    for c in range(robot.ground.contacts.size):
        i = BLOCK * robot.ground.carriers[c]
        x, y, z = k1[i] + k2[i], k1[i + 1] + k2[i + 1], k1[i + 2] + k2[i + 2]
        largest = larger(largest, motion_at(nodes, robot.ground.contacts[c], (x, y, z)))
    return largest


@inlined
def motion_at(nodes: Table, row: int, turn: Vector3) -> Real:
    """Largest absolute component of turn x p. `turn` is an angular velocity or acceleration of a
    body, and p the vector from its origin to the node in row number `row` of `nodes`."""
    x, y, z = cross(turn, vector_at(nodes, row, P_BN_W))
    return larger(larger(abs(x), abs(y)), abs(z))


@inlined
def larger(x: Real, y: Real) -> Real:
    """The larger of two numbers; NaN if one is NaN."""
    return select((y > x) | (y != y), y, x)
