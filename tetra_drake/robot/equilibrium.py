"""Equilibrium of a robot on flat ground without actuation, by Newton's method."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.physics import cable, contact
from tetra_drake.physics.forces import Forces, compute_forces, move_robot
from tetra_drake.physics.kinematics import P_WN, move_bodies
from tetra_drake.physics.model import Model
from tetra_drake.physics.rigid_motions import rigid_motions
from tetra_drake.robot.statics import null_space
from tetra_drake.simd.compiling import LOGGER, compiled
from tetra_drake.simd.lanes import Table

TOLERANCE = 1e-11
"""Largest remaining force in equilibrium, as a share of the greatest tension or of the weight."""
LEAST_FORCE = 1e-9
"""Least force (N) that TOLERANCE refers to. It counts if tensions and weight are smaller."""

MOST_STEPS, LEAST_STEPS = 1000, 10
"""Largest number of steps of a search: for few bodies, and for the most bodies that are
possible."""

MOST_WORK = 2e11
"""Limit of the work of a search, between MOST_STEPS and LEAST_STEPS: number of steps times the cube
of the number of unknowns. This takes about two minutes."""

FIRST_REACH, LONGEST_REACH = 0.05, 0.2
"""Largest step of Newton's method at first, and later, as a share of the largest body's radius."""
OVERSHOOT = 0.9
"""A step is too long if the force at its end points backward and exceeds this share of the force at
its beginning; only the components along the step count."""
DIFFERENCE = 1e-7
"""Displacement for finite differences, as a share of the largest body's radius."""

RESISTED = 1e-6
"""Least share of the greatest displacement of an anchored node by which a motion is resisted."""

LEAST_STIFFNESS = 1e-9
"""Least stiffness of a stable mode, as a share of the ground's stiffness."""

LONG = 5.0
"""Time (s) after which a long search is announced."""
LENGTH_DIGITS = 9
"""Decimals of a cable length (m) in equilibrium. Further digits depend on the processor, and a
simulation with feedback would amplify their differences."""

_LOG = logging.getLogger(LOGGER)


class Equilibrium(NamedTuple):
    """Equilibrium of a robot on flat ground."""

    state: np.ndarray
    """State [q; v] of the bodies (13 n,)."""
    lengths: np.ndarray
    """Lengths of the cables (cables,), in m, rounded to nm."""
    feet: int
    """Number of contact nodes that bear a load."""


class Unactuated(NamedTuple):
    """A robot without actuation, with memory for its forces."""

    model: Model
    forces: Forces
    """Forces at the state that was last computed."""

    @classmethod
    def of(cls, model: Model) -> Self:
        """The robot of a model, with all cables passive."""
        cables = model.cables._replace(signal=np.full_like(model.cables.signal, cable.PASSIVE))
        return cls(model._replace(cables=cables), Forces.of(model))


def find_equilibrium(
    model: Model, start: np.ndarray, *, bodies: Sequence[str], source: str
) -> Equilibrium:
    """Finds the equilibrium of a robot on flat ground without actuation.

    The search goes downhill in potential energy from the state `start` (13 n,) to a minimum.
    Friction bears no load. Raises InputError, naming `source` and a body, if none is found.
    """
    robot, state = Unactuated.of(model), start
    weight, radius = model.bodies.weight.sum(), model.bodies.radius.max()
    # Anchors turn the rounding of positions into forces.
    borne = max(weight, 1e-4 * radius * model.anchors.stiffness.max(initial=0.0))
    descent = _Descent(robot)
    reach, announce_at = FIRST_REACH * radius, math.inf
    most = min(MOST_STEPS, max(LEAST_STEPS, int(MOST_WORK / (6 * len(bodies)) ** 3)))
    for count in range(most):
        force = force_at_rest(robot, state)
        if not np.isfinite(force).all():
            break
        tensions = np.abs(robot.forces.cable_forces[:, cable.TENSION])
        greatest = max(tensions.max(initial=borne), LEAST_FORCE)
        if np.abs(force).max() <= TOLERANCE * greatest:
            lengths = np.round(robot.forces.cable_forces[:, cable.LENGTH], LENGTH_DIGITS)
            feet = int(np.count_nonzero(robot.forces.ground_forces[:, contact.NORMAL]))
            return Equilibrium(state, lengths, feet)
        now = time.perf_counter()
        if count == 1:  # kernels are compiled by now
            announce_at = now + LONG
        if now > announce_at:
            _LOG.warning("%s: finding the robot's equilibrium takes a while", source)
            announce_at = math.inf
        step = descent.step(state, force)
        if step is None:
            break
        step *= min(1.0, reach / np.abs(step).max())
        moved = displaced(robot, state, step)
        if force_at_rest(robot, moved) @ step >= -OVERSHOOT * (force @ step):
            state, reach = moved, min(2.0 * reach, LONGEST_REACH * radius)
        else:  # also if the force is NaN because the ends of a cable meet
            reach = 0.5 * np.abs(step).max()
    left = np.abs(force.reshape(-1, 6)).max(axis=1)
    body = int(left.argmax())  # argmax takes the first NaN, if there is one
    amount = f"{left[body]:.3g} N" if np.isfinite(left[body]) else "which is not finite"
    found = f"finds no equilibrium until step {count + 1}"
    problem = f"{found}; the greatest force left, {amount}, is on '{bodies[body]}'"
    raise InputError(source, "robot", problem)


class _Descent:
    """Newton's method for a minimum of the potential energy."""

    def __init__(self, robot: Unactuated) -> None:
        self._robot = robot
        self._hard = float(contact.NormalForce(*robot.model.ground.normal).stiffness)
        self._shifts = [0.0, LEAST_STIFFNESS * self._hard]
        """Stiffnesses (N/m) to try. A step adds the least one that makes the energy convex."""
        while self._shifts[-1] < math.inf:
            self._shifts.append(10.0 * self._shifts[-1])
        self._index = 0
        """Index of the last step's shift. The next step mostly needs the same shift."""

    def step(self, state: np.ndarray, force: np.ndarray) -> np.ndarray | None:
        """Newton step: displacements (6 n,) that bring the force to zero.

        If the potential energy is not convex, the displacements lead downhill. The robot as a whole
        does not move. None if the derivatives of the forces are not finite.
        """
        held, stiffness = _free_motions(self._robot, state), stiffness_at_rest(self._robot, state)
        stiffness = 0.5 * (stiffness + stiffness.T) + self._hard * held @ held.T
        before = self._index
        while (step := self._solved(stiffness, force, self._index)) is None:
            self._index += 1
            if self._index == len(self._shifts):
                return None
        while 0 < self._index <= before:
            longer = self._solved(stiffness, force, self._index - 1)
            if longer is None:
                break
            self._index, step = self._index - 1, longer
        return step

    def _solved(self, stiffness: np.ndarray, force: np.ndarray, index: int) -> np.ndarray | None:
        """The step with a shift; None if the energy is not convex with this shift."""
        shifted, step = stiffness + self._shifts[index] * np.eye(len(force)), np.empty_like(force)
        is_convex = solve_convex(shifted, force, LEAST_STIFFNESS * self._hard, step)
        return step if is_convex else None


def _free_motions(robot: Unactuated, state: np.ndarray) -> np.ndarray:
    """Displacements (6 n, motions) of the whole robot that change no energy: along x, along y and
    about z, and the other three for a robot without weight and contacts. Motions that anchors or
    loads resist are left out. The forces of the state must have been computed."""
    model, nodes = robot.model, robot.forces.nodes
    floats = not model.bodies.weight.any() and not model.ground.contacts.size
    kept = [3, 4, 2, 5, 0, 1] if floats else [3, 4, 2]  # in the order of rigid_motions()
    p_WB = state[: 7 * model.bodies.mass.size].reshape(-1, 7)[:, 4:]
    centre, radius = p_WB.mean(axis=0), model.bodies.radius.max()
    turns = np.broadcast_to(np.eye(3, 6), (len(p_WB), 3, 6))
    motions = np.concatenate([turns, rigid_motions((p_WB - centre) / radius)], axis=1)[:, :, kept]
    of_nodes = rigid_motions((nodes[:, P_WN : P_WN + 3] - centre) / radius)
    turned = rigid_motions(model.loads.forces)  # a load does not turn with the robot
    turned[..., 3:] = 0.0
    resisted = np.concatenate(
        [
            of_nodes[model.first_node[-1] :].reshape(-1, 6),
            of_nodes[model.anchors.nodes][model.anchors.stiffness > 0.0],
            turned.reshape(-1, 6) / np.abs(model.loads.forces).max(initial=LEAST_FORCE),
        ]
    )[:, kept]
    free = null_space(resisted, RESISTED)
    return (motions @ free).reshape(6 * len(p_WB), free.shape[1])


@compiled
def solve_convex(matrix: Table, right: Table, least: float, x: Table) -> bool:
    """Solves a symmetric system by Cholesky's method. Returns False if a pivot is at most `least`.

    The upper half of the matrix is overwritten. LAPACK is not used because its threads wait for
    each other on busy processors.
    """
    n = right.size
    for i in range(n):
        if not matrix[i, i] > least:
            return False
        matrix[i, i:] /= np.sqrt(matrix[i, i])
        for row in range(i + 1, n):
            matrix[row, row:] -= matrix[i, row] * matrix[i, row:]
    x[:] = right
    for i in range(n):
        x[i] /= matrix[i, i]
        x[i + 1 :] -= matrix[i, i + 1 :] * x[i]
    for i in range(n - 1, -1, -1):
        x[i] = (x[i] - (matrix[i, i + 1 :] * x[i + 1 :]).sum()) / matrix[i, i]
    return True


@compiled
def force_at_rest(robot: Unactuated, state: Table) -> Table:
    """Generalized force (6 n,) at rest: [t_W / radius; f_W] at each body's origin. Contact nodes
    stick at their positions."""
    model, forces = robot.model, robot.forces
    modes = np.zeros((forces.ground_forces.shape[0], contact.MODE_COLUMNS))
    generalized = np.empty(6 * (state.size // 13))
    move_robot(model, state, forces)
    contact.update_modes(state, forces.nodes, model.ground, forces.frames, modes)
    compute_forces(model, state, modes, np.zeros(1), True, forces, generalized)
    radius = model.bodies.radius.max()
    for body in range(generalized.size // 6):
        generalized[6 * body : 6 * body + 3] /= radius
    return generalized


@compiled
def displaced(robot: Unactuated, state: Table, step: Table) -> Table:
    """A state displaced by `step` (6 n,): rotation times radius, and translation, in m."""
    moved, motion = state.copy(), step.copy()
    radius = robot.model.bodies.radius.max()
    for body in range(step.size // 6):
        motion[6 * body : 6 * body + 3] /= radius
    move_bodies(state, motion, 1.0, moved)
    return moved


@compiled
def stiffness_at_rest(robot: Unactuated, state: Table) -> Table:
    """Stiffness matrix (6 n, 6 n) in N/m: minus the derivative of the forces with respect to the
    displacements."""
    count, half = state.size // 13 * 6, DIFFERENCE * robot.model.bodies.radius.max()
    stiffness, motion = np.empty((count, count)), np.zeros(count)
    for j in range(count):
        motion[j] = half
        ahead = force_at_rest(robot, displaced(robot, state, motion))
        motion[j] = -half
        behind = force_at_rest(robot, displaced(robot, state, motion))
        motion[j] = 0.0
        stiffness[:, j] = (behind - ahead) / (2.0 * half)
    return stiffness
