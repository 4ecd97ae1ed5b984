"""Equilibrium of a robot on flat ground without actuation, by Newton's method."""

from __future__ import annotations

import functools
import logging
import math
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pydrake.multibody.tree import RotationalInertia
from scipy import linalg
from scipy.sparse import bsr_array

from tetra_drake.errors import InputError
from tetra_drake.kernels.compiling import LOGGER, compiled
from tetra_drake.kernels.lanes import Table
from tetra_drake.kernels.packed import Packed, unpacked
from tetra_drake.laws import cable
from tetra_drake.laws.capsules import BARREL, PARALLEL
from tetra_drake.laws.contact import MODE_COLUMNS, NORMAL, Ground, update_modes
from tetra_drake.laws.forces import Forces, Parts, compute_forces, move_robot
from tetra_drake.laws.kinematics import FORCE, P_WN, move_bodies, rigid_motions
from tetra_drake.laws.model import Model
from tetra_drake.laws.sparse import BLOCK, Schedule, factorise, solve
from tetra_drake.laws.stiffness import stiffness_matrix

ROUNDING = 64 * np.finfo(float).eps
"""Tolerance for the force left in equilibrium, as a share of the robot's greatest stiffness times
its farthest coordinate. Positions are rounded, and springs turn the rounding errors into force."""

MOST_STEPS, LEAST_STEPS = 1000, 10
"""Upper limits of the steps of a search: for few bodies, and for the largest structures."""

MOST_WORK = 2e11
"""Upper limit of the work of a search, about two minutes: its steps times the work of a
factorisation. It sets the limit of steps between MOST_STEPS and LEAST_STEPS."""

FIRST_REACH, LONGEST_REACH, SHORTEST_REACH = 0.05, 0.2, 1e-12
"""Reach (upper limit of a step) as a share of the largest body's radius: at first, at most, and
where the search ends."""
LEAST_GAIN, GOOD_GAIN = 0.1, 0.5
"""Limits for the gain of a step: the energy that it releases, as a share of the energy predicted
from forces and stiffness at its beginning. Below the first limit a step is too long; above the
second, the next may be longer."""

CORRECTIONS = 8
"""Largest number of corrections of one step; see _Descent."""
HOLD = 30.0
"""Stiffness that is added for a correction (a shift, see _Descent), as a multiple of the greatest
force over the largest body's radius. This force can have such a stiffness along motions that the
springs do not resist."""

POWER_STEPS = 10
"""Number of inverse power iterations for the least stable motion of a balanced robot."""

RESISTED = 1e-6
"""Threshold for anchors: an anchor resists a motion that moves its node by more than this share of
the greatest displacement."""

LEAST_STIFFNESS = 1e-12
"""Stiffness that is assumed for a motion that nothing resists, as a share of the robot's greatest
stiffness."""

LONG = 5.0
"""Time (s) after which a warning says that the search takes a while."""
LENGTH_DIGITS = 9
"""Decimals of a cable length (m) in equilibrium. Further digits depend on the processor, and a
simulation with feedback would amplify their differences."""

_LOG = logging.getLogger(LOGGER)


class Equilibrium(NamedTuple):
    """Equilibrium of a robot on flat ground."""

    state: np.ndarray
    """State [q; v] of the bodies (13*n,)."""
    lengths: np.ndarray
    """Lengths of the cables (cables,), in m, rounded to nm."""
    feet: int
    """Number of contact nodes that bear a load."""


class Unactuated:
    """A robot whose cables are all passive, and arrays that kernels fill with the forces on it."""

    def __init__(self, model: Model) -> None:
        """Makes all cables of a model passive."""
        cables = model.cables._replace(signal=np.full_like(model.cables.signal, cable.PASSIVE))
        self.model = model._replace(cables=cables)
        self.forces = Forces.of(model)
        """Forces at the state that was last computed."""
        self.parts = Packed((self.model, self.forces))
        gyration = np.sqrt(model.bodies.inertia.max(axis=1) / model.bodies.mass)
        self.radius = float(model.bodies.radius.max() or gyration.max())
        """Largest radius (m) of a body, or of its gyration if all are points. It turns rotations
        into lengths."""


def find_equilibrium(
    model: Model, start: np.ndarray, *, bodies: Sequence[str], source: str
) -> Equilibrium:
    """Finds the equilibrium of a robot on flat ground without actuation.

    The search goes downhill in potential energy to a minimum. It begins at `start` (13*n,), a state
    [q; v] of the n bodies. Friction bears no load there. `bodies` are the names of the bodies.
    Raises InputError, naming `source` (the scenario) and a body, if no equilibrium is found.
    """
    weights = np.array([0.0, 0.0, -model.bodies.weight.sum()])
    forces = np.vstack([model.loads.forces, weights])
    unheld = forces.sum(axis=0)
    unheld[np.abs(unheld) <= ROUNDING * np.abs(forces).sum(axis=0)] = 0.0
    held = (model.anchors.stiffness > 0.0).any(axis=0)
    held |= len(model.p_BN) > model.first_node[-1]  # cables from fixed nodes
    held[2] |= model.ground.contacts.size > 0 and unheld[2] <= 0.0
    unheld[held] = 0.0
    if unheld.any():
        amounts = ", ".join(f"{force:.3g}" for force in unheld)
        problem = f"has no equilibrium: nothing holds it against the force [{amounts}] N"
        raise InputError(source, "robot", f"{problem} of its weight and loads")
    robot = Unactuated(model)
    descent = _Descent(robot, start)
    most = min(MOST_STEPS, max(LEAST_STEPS, int(MOST_WORK / max(descent.work, 1.0))))
    announce_at, count = math.inf, 0
    while count < most and descent.step():
        count += 1
        now = time.perf_counter()
        if count == 1:  # kernels are compiled by now
            announce_at = now + LONG
        if now > announce_at:
            _LOG.warning("%s: finding the robot's equilibrium takes a while", source)
            announce_at = math.inf
    if not descent.is_balanced():
        left = np.abs(descent.force.reshape(-1, 6)).max(axis=1)
        body = int(left.argmax())  # argmax takes the first NaN, if there is one
        found = f"finds no equilibrium in {count} steps; {left[body]:.3g} N are left"
        reason = "it still moves; give positions nearer to an equilibrium, or more tension"
        if not np.isfinite(left[body]):
            reason = "its position is not finite"
        raise InputError(source, "robot", f"{found} on '{bodies[body]}': {reason}")
    force_at_rest(robot, descent.state)
    lengths = np.round(robot.forces.cable_forces[:, cable.LENGTH], LENGTH_DIGITS)
    feet = int(np.count_nonzero(robot.forces.ground_forces[:, NORMAL]))
    return Equilibrium(descent.state, lengths, feet)


class _Descent:
    """Descent to a minimum of the potential energy, by Newton's method.

    A shift, the same stiffness for all displacements, is added to the stiffness matrix. It makes
    the energy convex and the step no longer than the reach, the upper limit of a step. The reach
    grows after good steps and shrinks after bad ones.

    The energy of a mechanism has long curved valleys, whose sides are up to 10^12 times as steep as
    their floor. A step along the floor ends on a side. Corrections lead it back to the floor. Only
    then the energy decides if the step is good.
    """

    def __init__(self, robot: Unactuated, start: np.ndarray) -> None:
        self._robot = robot
        self._reach = FIRST_REACH * self._robot.radius
        self._shift = self._rounding = self.work = 0.0
        self._arrive(start, force_at_rest(robot, start))

    def _arrive(self, state: np.ndarray, force: np.ndarray) -> None:
        """Makes `state` (13*n,) the current one. `force` (6*n,) is force_at_rest() of this state.
        No call of force_at_rest() for another state may lie in between, because this method uses
        the arrays that it fills."""
        self.state, self.force = state, force
        if not np.isfinite(force).all():
            return
        self._stiffness = stiffness_at_rest(self._robot)
        self.work = blocks_of(self._stiffness)[0].work
        self._held = _rigid_motions(self._robot, state)
        cables = self._robot.model.cables.law.stiffness  # of slack ones, too
        hardest = max(self._stiffness.diagonal().max(), cables.max(initial=0.0))
        farthest = np.abs(self._robot.forces.nodes[:, P_WN : P_WN + 3]).max()
        self._rounding = ROUNDING * hardest * farthest
        steepest = np.abs(force).max() / self._robot.radius
        self._least = LEAST_STIFFNESS * max(hardest, steepest, np.finfo(float).eps)
        self._doubt = self._least
        if self._robot.forces.near_struts.count.any():
            # The place where parallel struts touch is rounded more, by their slenderness squared.
            # It is not quite the nearest one, so that a push has a little stiffness sideways.
            struts = self._robot.model.struts
            slenderness = struts.length.max() / (2.0 * BARREL * struts.radius.min())
            pushes = np.abs(self._robot.forces.nodes[:, FORCE : FORCE + 3]).max()
            self._rounding += ROUNDING * slenderness**2 * pushes
            self._doubt += 10.0 * PARALLEL**2 * pushes / struts.radius.min()

    def is_balanced(self) -> bool:
        """True if no force is left, except for rounding errors."""
        return bool(np.abs(self.force).max() <= self._rounding)

    def step(self) -> bool:
        """Takes one step downhill in energy, to a new state. Returns False without a step if none
        leads down, for example in a stable equilibrium."""
        if self.is_balanced() and self._factor(self._stiffness, self._doubt) is not None:
            return False
        while self._reach > SHORTEST_REACH * self._robot.radius and np.isfinite(self.force).all():
            step, expected = self._longest_step()
            length = np.abs(step).max()
            moved, force, step, gain = self._corrected(step, expected)
            if gain > LEAST_GAIN:
                if gain > GOOD_GAIN and length > 0.3 * self._reach:
                    self._reach = min(2.0 * self._reach, LONGEST_REACH * self._robot.radius)
                self._shift *= 0.1
                self._arrive(moved, force)
                return True
            self._reach = 0.5 * length
        return False

    def _longest_step(self) -> tuple[np.ndarray, float]:
        """Next step (6*n,) in m within reach, not yet taken, and twice the energy (J) that it
        should release.

        It is Newton's step with the smallest shift that keeps it within reach. In an equilibrium
        that is not stable, it is a step along the least stable motion. For the components of a
        step see displaced().
        """
        if self.is_balanced():
            shift = self._least
            while (factor := self._factor(self._stiffness, shift)) is None:
                shift *= 2.0
            # Any direction, not by NumPy's cosine, whose last digits depend on the processor.
            step = np.array([math.cos(k) for k in range(self.force.size)])
            for _ in range(POWER_STEPS):
                step = self._solved(factor, step)
                step *= self._reach / np.abs(step).max()
            return step, -product(step, self._stiffness @ step)

        self._shift = max(self._shift, self._least)
        while True:
            factor = self._factor(self._stiffness, self._shift)
            if factor is None:
                self._shift *= 4.0
                continue
            step = self._solved(factor, self.force)
            excess = np.abs(step).max() / self._reach
            if excess <= 1.0:
                return step, product(self.force + self._shift * step, step)
            self._shift *= min(max(2.0, 0.7 * excess), 100.0)

    def _corrected(
        self, step: np.ndarray, expected: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """Takes a trial `step` and corrects it back to the floor of the energy's valley; see the
        class.

        `step` and `expected`, twice the expected energy (J), are from _longest_step(). Returns the
        state after the corrected step, the force there, the corrected step (6*n,), and its gain:
        the released energy divided by the expected one.
        """
        longest = 0.5 * np.abs(step).max()
        moved = displaced(self._robot, self.state, step)
        for count in range(CORRECTIONS + 1):
            force = force_at_rest(self._robot, moved)
            gain = product(self.force + force, step) / expected
            if gain > GOOD_GAIN or count == CORRECTIONS or not np.isfinite(force).all():
                break
            stiffness = stiffness_at_rest(self._robot)
            shift = max(HOLD * np.abs(force).max() / self._robot.radius, self._least)
            while (factor := self._factor(stiffness, shift)) is None:
                shift *= 4.0
            correction = self._solved(factor, force)
            if np.abs(correction).max() > longest:
                break
            moved, step = displaced(self._robot, moved, correction), step + correction
        return moved, force, step, gain

    def _factor(self, stiffness: bsr_array, shift: float) -> Factor | None:
        """Factor of `stiffness` (6*n, 6*n) plus `shift` (N/m) on its diagonal; None if
        this sum is not positive definite."""
        return Factor.of(stiffness, shift, least=0.5 * self._least)

    def _solved(self, factor: Factor, force: np.ndarray) -> np.ndarray:
        """Displacements (6*n,) in m under a force (6*n,) in N, for the stiffness whose `factor` is
        from _factor(). Motions of the whole robot that nothing resists are projected out."""
        step = factor.solved(force)
        for motion in self._held:
            step = step - product(motion, step) * motion
        return step


class Factor(NamedTuple):
    """Factor of a sparse symmetric matrix (6*n, 6*n) with 6 x 6 blocks; see laws.sparse."""

    blocks: np.ndarray
    schedule: Schedule

    @classmethod
    def of(cls, matrix: bsr_array, shift: float, *, least: float) -> Factor | None:
        """The factor of a matrix with `shift` added to its diagonal. None if a pivot is at most
        `least`."""
        schedule, place = blocks_of(matrix)
        blocks = np.zeros((len(schedule.later), BLOCK, BLOCK))
        blocks[place[place >= 0]] = matrix.data[place >= 0]
        blocks[: schedule.order.size] += shift * np.eye(BLOCK)
        factorise_blocks(blocks, schedule)
        inverse_pivots = blocks[: schedule.order.size].diagonal(axis1=1, axis2=2)
        is_positive = (inverse_pivots > 0.0) & (inverse_pivots * least < 1.0)
        return cls(blocks, schedule) if is_positive.all() else None

    def solved(self, right: np.ndarray) -> np.ndarray:
        """Solution (6*n,) for a right-hand side (6*n,)."""
        x = right.copy()
        solve_blocks(self.blocks, self.schedule, x)
        return x


def blocks_of(matrix: bsr_array) -> tuple[Schedule, np.ndarray]:
    """Schedule for the factorisation of a sparse symmetric matrix, and the index (blocks,) in it of
    each 6 x 6 block of the matrix; -1 for blocks in the lower half."""
    return _scheduled(tuple(matrix.indptr.tolist()), tuple(matrix.indices.tolist()))


@functools.lru_cache(maxsize=32)
def _scheduled(first: tuple[int, ...], columns: tuple[int, ...]) -> tuple[Schedule, np.ndarray]:
    """The result of blocks_of(), for blocks in compressed rows with these columns."""
    bodies = len(first) - 1
    rows = np.repeat(np.arange(bodies), np.diff(first)).tolist()
    pairs = [*zip(rows, columns, strict=True)]
    schedule = Schedule.of(bodies, [(a, b) for a, b in pairs if a < b])
    index = schedule.blocks | {(body, body): body for body in range(bodies)}
    return schedule, np.array([index.get(pair, -1) for pair in pairs])


@compiled
def factorise_blocks(blocks: Table, schedule: Schedule) -> None:
    """Factorises a matrix in place; see laws.sparse.factorise(). LAPACK is not used because its
    threads wait for each other on busy processors, and its last digits depend on the processor."""
    factorise(blocks, schedule)


@compiled
def solve_blocks(blocks: Table, schedule: Schedule, x: Table) -> None:
    """Solves a system in place that factorise_blocks() has factorised; see laws.sparse.solve()."""
    solve(blocks, schedule, x)


def free_motions(robot: Unactuated, state: np.ndarray) -> np.ndarray:
    """Orthonormal basis (6*n, motions), in columns, of the displacements that no force resists:
    motions of the whole robot, and what else has no stiffness but rounding errors, such as the spin
    of a bar about its axis. For the components see displaced(). The state (13*n,) is the one of the
    last call of force_at_rest()."""
    stiffness = stiffness_at_rest(robot).toarray()
    farthest = np.abs(robot.forces.nodes[:, P_WN : P_WN + 3]).max()
    rounding = ROUNDING * farthest / (robot.model.bodies.radius.max() or farthest)
    share = max(LEAST_STIFFNESS, rounding)
    soft = soft_space(stiffness, share * stiffness.diagonal().max())
    return linalg.orth(np.hstack([_rigid_motions(robot, state).T, soft]), rcond=0.1)


def _rigid_motions(robot: Unactuated, state: np.ndarray) -> np.ndarray:
    """Orthonormal basis (motions, 6*n) of rigid displacements of the whole robot that change no
    energy: along x, along y and about z; for a robot without weight and contacts all six. Motions
    that anchors, cables from fixed nodes, or loads resist are left out. For the components see
    displaced(). force_at_rest() must have been called for this state before."""
    model, nodes = robot.model, robot.forces.nodes
    floats = not model.bodies.weight.any() and not model.ground.contacts.size
    kept = [3, 4, 2, 5, 0, 1] if floats else [3, 4, 2]  # in the order of rigid_motions()
    p_WB = state[: 7 * model.bodies.mass.size].reshape(-1, 7)[:, 4:]
    centre, radius = p_WB.mean(axis=0), robot.radius
    turns = np.broadcast_to(np.eye(3, 6), (len(p_WB), 3, 6))
    motions = np.concatenate([turns, rigid_motions((p_WB - centre) / radius)], axis=1)[:, :, kept]
    of_nodes = rigid_motions((nodes[:, P_WN : P_WN + 3] - centre) / radius)
    turned = rigid_motions(model.loads.forces)  # a load does not turn with the robot
    turned[..., 3:] = 0.0
    resisted = np.concatenate(
        [
            of_nodes[model.first_node[-1] :].reshape(-1, 6),
            of_nodes[model.anchors.nodes][model.anchors.stiffness > 0.0],
            turned.reshape(-1, 6) / np.abs(model.loads.forces).max(initial=np.finfo(float).tiny),
        ]
    )[:, kept]
    greatest = np.abs(resisted).max(initial=0.0)
    basis = orthonormal(resisted, RESISTED * greatest)
    free = np.eye(len(kept)) - np.einsum("ri,rj->ij", basis, basis)
    free = orthonormal(free, RESISTED)[: len(kept) - len(basis)]
    return orthonormal(np.einsum("bik,fk->fbi", motions, free).reshape(-1, 6 * len(p_WB)), 0.0)


def product(a: np.ndarray, b: np.ndarray) -> float:
    """Scalar product of two vectors. Unlike NumPy's, which calls BLAS, it has the same digits on
    all processors."""
    return float((a * b).sum())


def soft_space(matrix: np.ndarray, least: float) -> np.ndarray:
    """Orthonormal basis (n, vectors), in columns, of a symmetric matrix (n, n): of the eigenvectors
    whose eigenvalues are at most `least` in size."""
    eigenvalues, vectors = linalg.eigh(matrix)
    return np.asarray(vectors[:, np.abs(eigenvalues) <= least])


def orthonormal(vectors: np.ndarray, least: float) -> np.ndarray:
    """Orthonormal basis (dimensions, n) of the space of some vectors (k, n), with the same digits
    on all processors; by the method of Gram and Schmidt, the longest first. Remainders
    that are at most `least` long count as 0."""
    left, basis = np.array(vectors), np.zeros((0, vectors.shape[1]))
    for _ in range(min(vectors.shape)):
        lengths = np.sqrt((left * left).sum(axis=1))
        longest = int(lengths.argmax())
        if lengths[longest] <= least:
            break
        unit = left[longest] / lengths[longest]
        for other in basis:  # what rounding has left of them
            unit = unit - product(unit, other) * other
        unit /= math.sqrt(product(unit, unit))
        basis = np.vstack([basis, unit])
        left -= (left * unit).sum(axis=1)[:, np.newaxis] * unit
    return basis


def force_at_rest(robot: Unactuated, state: np.ndarray) -> np.ndarray:
    """Generalized force (6*n,) in N on the bodies at rest in a state (13*n,).

    It is [t_W / radius; f_W] at each body's origin. Torques are divided by `robot.radius`, so that
    all numbers are in N. Contact nodes stick where they are, so friction exerts no force. The
    arrays in `robot.forces` are overwritten."""
    modes = np.zeros((len(robot.forces.ground_forces), MODE_COLUMNS))
    force = np.zeros(6 * robot.model.bodies.mass.size)
    still = np.concatenate([state[: -force.size], force])
    compute_forces_at_rest(robot.parts, still, modes, force)
    force.reshape(-1, 6)[:, :3] /= robot.radius
    return force


@compiled
def compute_forces_at_rest(parts: Parts, state: Table, modes: Table, generalized: Table) -> None:
    """Writes the forces on a robot at rest in `state` (13*n,) to `generalized` (6*n,): [t_W; f_W]
    at each body's origin, in N m and N.

    `parts` are the robot's constants and arrays of forces, from Unactuated; the forces are also
    overwritten. `modes` (contacts, 12) is the table of contact states of laws.contact. It must be
    0, which means nodes in the air. The kernel replaces it: nodes in the ground stick."""
    robot, forces = unpacked(parts)
    move_robot(robot, state, forces)
    update_modes(state, forces.nodes, robot.ground, forces.frames, modes)
    compute_forces(robot, state, modes, np.zeros(1), True, forces, generalized)


def displaced(robot: Unactuated, state: np.ndarray, step: np.ndarray) -> np.ndarray:
    """A copy of a state (13*n,), displaced by `step` (6*n,) in m. For each body the step has a
    rotation vector times `robot.radius`, then a translation, in the world frame."""
    moved, motion = state.copy(), step.copy()
    motion.reshape(-1, 6)[:, :3] /= robot.radius
    displace(state, motion, moved)
    return moved


@compiled
def displace(state: Table, motion: Table, moved: Table) -> None:
    """Writes the poses of `state` (13*n,), displaced by `motion` (6*n,), to `moved` (13*n,).

    For each body, `motion` has a rotation vector (rad), then a translation (m)."""
    move_bodies(state, motion, 1.0, moved)


def stiffness_at_rest(robot: Unactuated) -> bsr_array:
    """Stiffness matrix (6*n, 6*n) in N/m of the robot without actuation, for displacements as in
    displaced(); sparse. The state is the one of the last call of force_at_rest()."""
    matrix = stiffness_matrix(robot.model, robot.forces)
    per_radius = np.repeat([1.0 / robot.radius, 1.0], 3)
    matrix.data = per_radius[:, np.newaxis] * matrix.data * per_radius
    return matrix


def damping_at_rest(robot: Unactuated, state: np.ndarray) -> np.ndarray:
    """Damping matrix (6*n, 6*n) in N s/m of cables, anchors and joints in a state (13*n,) at rest,
    for displacements as in displaced()."""
    force_at_rest(robot, state)
    lengths, model = robot.forces.cable_forces[:, cable.LENGTH].copy(), robot.model
    # Springs in place of the dampers, so that the stiffness matrix is the damping matrix.
    law = model.cables.law._replace(stiffness=model.cables.law.damping, free_length=lengths)
    damped = Unactuated(
        model._replace(
            cables=model.cables._replace(law=law),
            anchors=model.anchors._replace(stiffness=model.anchors.damping),
            joints=model.joints._replace(stiffness=model.joints.damping),
            loads=model.loads._replace(forces=np.zeros_like(model.loads.forces)),
            ground=Ground(),
            strut_contact=model.strut_contact._replace(acts=False),
            slack=False,
        )
    )
    force_at_rest(damped, state)
    return np.asarray(stiffness_at_rest(damped).toarray())


def mass_matrix(robot: Unactuated) -> np.ndarray:
    """Mass matrix (6*n, 6*n) in kg, for displacements as in displaced(). The state is the one of
    the last call of force_at_rest()."""
    bodies = robot.model.bodies
    inertia_W = bodies.inertia if robot.model.isotropic else robot.forces.inertia
    matrix = np.diag(np.repeat(bodies.mass, 6))
    for body, inertia in enumerate(inertia_W):
        turning = slice(6 * body, 6 * body + 3)
        tensor = RotationalInertia(*inertia).CopyToFullMatrix3()
        matrix[turning, turning] = tensor / robot.radius**2
    return matrix
