"""Linear system of small motions about a state: matrices, damped modes, LQR."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from pydrake.systems.primitives import LinearSystem
from scipy import linalg
from scipy.spatial.transform import Rotation

from tetra_drake.errors import InputError, check_type, checked_numbers
from tetra_drake.lab.differences import derivatives
from tetra_drake.lab.linearization.rates import rates_and_forces
from tetra_drake.laws.cable import TENSION
from tetra_drake.laws.contact import MODE_COLUMNS
from tetra_drake.robot.command import Controller
from tetra_drake.robot.equilibrium import Unactuated, displace, force_at_rest, free_motions
from tetra_drake.robot.readings import Readings, bodies_state
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure, node_motions
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.settings.refusals import no_such

STEP = 1e-6
"""Step of the central differences: in rad, as a share of the largest body's radius (m, and m/s), of
the greatest force (N) as far as no signal makes a cable slack, and of the greatest state of an
actuator. The matrices are exact to some 1e-10 of their greatest numbers; the spin of a thin bar,
whose inertia is small, to 1e-8."""
_ROUNDED, _UNRESISTED, _SOLVED = 1e-9, 1e-7, 1e-3
"""Greatest errors: of an eigenvalue, as a share of the greatest one; of numbers of the matrices, as
a share of the greatest; of LQR's equation, as a share of its greatest term."""
BALANCED = 1e-4
"""Force left at rest, at most, as a share of the greatest force."""


class DampedModes(NamedTuple):
    """Oscillations of a linearized robot, the slowest first. Motions that creep back without
    oscillation, and motions that no force resists, are left out.

    A mode moves as the real part of shape * exp((-damping_ratio * w + 2 pi i frequency) t), with w
    = 2 pi frequency / sqrt(1 - damping_ratio²).
    """

    frequencies: np.ndarray
    """Damped frequencies (modes,) in Hz."""
    damping_ratios: np.ndarray
    """Damping ratios (modes,), 0 without damping to 1. Negative if the oscillation grows."""
    shapes: np.ndarray
    """Complex displacements (modes, nodes, 3) of the nodes in the world frame. The node that moves
    farthest moves by 1."""
    motions: np.ndarray
    """Complex motions (modes, bodies, 6) of the bodies that make the shapes: a rotation vector
    (rad), then a translation (m), in the world frame."""


@dataclass(frozen=True, eq=False)
class Linearization:
    """Result of linearize(): linear system of a robot's small motions about a state; SI units.

    Its states x are deviations. First come six displacements per body in the world frame, a
    rotation vector `theta` (rad) and a translation (m); then six velocities per body, angular `w`
    (rad/s) and linear `v` (m/s); then the actuators' states, `drive`. Unlike quaternions, these
    states are independent of each other.
    """

    robot: Robot
    """The robot, which starts in the state."""
    system: LinearSystem
    """Drake's system dx/dt = A x + B u, y = C x + D u, in continuous time."""
    states: tuple[str, ...]
    """Names of the states x, such as "n0 n4 theta_x", "n0 n4 x", "n0 n4 w_x", "n0 n4 v_x", "drive
    side n0 n3": body and coordinate, or cable."""
    inputs: tuple[str, ...]
    """Names of the inputs u: deviations of the signals (N) from `signals`."""
    outputs: tuple[str, ...]
    """Names of the outputs y, deviations of readings: "n3 z", "length side n0 n3", "load n0"."""
    state: np.ndarray
    """State [q; v] (13*bodies,) about which the motions are small."""
    signals: np.ndarray
    """Signals (inputs,) in N in this state."""
    resisted: np.ndarray
    """Orthonormal basis (states, k), in columns, of the states without motions that no force
    resists, such as the spin of a bar about its axis."""

    def modes(self) -> DampedModes:
        """The oscillations of the system: damped frequencies, damping ratios, and shapes."""
        A, kept, bodies = self.system.A(), self.resisted, len(self.robot.structure.bodies)
        roots, vectors = linalg.eig(kept.T @ A @ kept)
        swings = np.flatnonzero(roots.imag > _ROUNDED * np.abs(roots).max(initial=0.0))
        swings = swings[roots.imag[swings].argsort(kind="stable")]
        roots = roots[swings]
        # Twice A, because it then maps the parts that are left out to 0.
        whole = A @ (A @ (kept @ vectors[:, swings])) / roots**2
        motions = whole[: 6 * bodies].T.reshape(-1, bodies, 6)
        shapes = node_motions(self.robot.structure, self.state, motions)
        # In this phase the real part is greatest.
        phase = np.exp(-0.5j * np.angle((shapes**2).sum(axis=(1, 2))))
        farthest = np.linalg.norm(shapes, axis=2).max(axis=1)
        scale = (phase / farthest)[:, np.newaxis, np.newaxis]
        ratios = -roots.real / np.abs(roots)
        return DampedModes(
            roots.imag / (2.0 * math.pi), ratios, scale * shapes, motions=scale * motions
        )

    def lqr(self, state_cost: npt.ArrayLike, input_cost: npt.ArrayLike) -> np.ndarray:
        """Gain K (inputs, states) of the linear-quadratic regulator (LQR): u = -K x has the least
        integral of xᵀ Q x + uᵀ R u.

        What no force resists is left out, because no signal can hold it: a bar spins about its
        axis, a floating robot drifts.

        Args:
            state_cost: the matrix Q (states, states), symmetric without negative eigenvalues.
            input_cost: the matrix R (inputs, inputs), symmetric with positive eigenvalues.

        Raises:
            InputError: if a matrix is wrong, or the signals cannot bring the motions to rest.
        """
        if not (self.inputs and self.resisted.size):
            problem = "has no signals for LQR, or no motions that they could hold"
            raise InputError(self.robot.scenario.name, "robot.actuated", problem)
        A, B = self.system.A(), self.system.B()
        Q = _checked_cost(state_cost, len(A), "state_cost")
        R = _checked_cost(input_cost, B.shape[1], "input_cost")
        kept = self.resisted  # keptᵀ x are states of their own, without the states left out
        A, B, Q = kept.T @ A @ kept, kept.T @ B, kept.T @ Q @ kept
        try:
            to_go = linalg.solve_continuous_are(A, B, Q, R)
            gain = np.linalg.solve(R, B.T @ to_go)
        except ValueError as error:  # also NumPy's LinAlgError
            raise InputError("lqr", "", f"finds no gain: {error}") from error
        terms = [A.T @ to_go, to_go @ A, -gain.T @ R @ gain, Q]
        is_solved = np.abs(sum(terms)).max() < _SOLVED * np.abs(terms).max()
        slowest = linalg.eigvals(A - B @ gain).real.max()
        # A has errors, a gain has none: the fastest motions with it have no say.
        if not (is_solved and slowest < -_ROUNDED * np.abs(linalg.eigvals(A)).max()):
            raise InputError("lqr", "", "finds no gain that brings all motions to rest")
        return np.asarray(gain @ kept.T)

    def controller(self, gain: npt.ArrayLike) -> Controller:
        """State feedback u = -K x: a function from the time (s) and the readings of a robot to its
        signals, for simulate(controller=...) and SampledController.

        Args:
            gain: the gain K (inputs, states), for example from lqr().

        Raises:
            InputError: if the gain has another shape or is not finite, or if the actuators have
                states, which are not among the readings.
        """
        shape = len(self.inputs), len(self.states)
        K = checked_numbers(gain, shape, source="controller", key="gain", finite=True)
        self._check_readable()
        return lambda time, readings: self.signals - K @ self.deviation(readings)

    def deviation(self, readings: Readings) -> np.ndarray:
        """States x (states,) of a robot with these readings: its deviations from `state`. Raises
        InputError if the actuators have states, which are not among the readings."""
        check_type("deviation", "readings", readings, Readings)
        self._check_readable()
        structure, count = self.robot.structure, 7 * len(self.robot.structure.bodies)
        now = bodies_state(readings, structure)
        poses, rest = now[:count].reshape(-1, 7), self.state[:count].reshape(-1, 7)
        turned, before = (Rotation.from_quat(each[:, [1, 2, 3, 0]]) for each in (poses, rest))
        moved = np.hstack([(turned * before.inv()).as_rotvec(), poses[:, 4:] - rest[:, 4:]])
        return np.concatenate([moved.ravel(), now[count:] - self.state[count:]])

    def _check_readable(self) -> None:
        if len(self.states) > 12 * len(self.robot.structure.bodies):
            kind = type(self.robot.scenario.actuation).__name__
            problem = f"found !{kind}, whose states are not among the readings, expected !Force"
            raise InputError(self.robot.scenario.name, "actuation", problem)


def linearize(
    given: Robot | GivenScenario,
    state: npt.ArrayLike | None = None,
    *,
    modes: npt.ArrayLike | None = None,
    outputs: Sequence[str] = ("p_WN", "lengths", "tensions"),
) -> Linearization:
    """Linear system of a robot's small motions about rest, or about a given state.

        >>> linear = td.linearize("prism")
        >>> linear.modes().frequencies.round(1)[:3]
        >>> A, names = linear.system.A(), linear.states

    The matrices are central differences of the equations of motion. Contact nodes keep their modes:
    those in the ground stick, with the stiffness and damping of their friction, the others stay in
    the air. Struts with an axial stiffness keep their lengths, as they do in motion.

    Args:
        given: a scenario, its name or file, or a run: its robot gets a signal for each driven
            cable, in the order of `Simulation.step`. Or a robot, with its own `first_signals`.
        state: state [q; v] (13*bodies,) about which motions are small, as of the diagram's port
            `state`; by default the equilibrium on flat ground. If it moves or is not at rest, the
            system describes deviations from the motion through it.
        modes: table (contacts, 12) of contact and friction modes, see laws.contact; by default the
            nodes in the ground stick where they are.
        outputs: names of readings, see robot.readings.Readings: lengths, rates, tensions,
            normal_forces, w_WB, p_WN, v_WN.

    Raises:
        InputError: if the robot has no equilibrium, or an argument does not fit it.
    """
    robot = given if isinstance(given, Robot) else Robot.of(given_scenario(given))
    size = 13 * len(robot.structure.bodies)
    start = robot.equilibrium.state if state is None else state
    at = checked_numbers(start, (size,), source="linearize", key="state", finite=True)
    poses = at[: size // 13 * 7].reshape(-1, 7)
    structure = dataclasses.replace(robot.structure, q_WB=poses[:, :4], p_WB=poses[:, 4:])
    robot = dataclasses.replace(robot, structure=structure)
    robot = robot if isinstance(given, Robot) else robot.controlled
    own_modes = robot.starting_modes if modes is None else modes
    rows = len(structure.contacts), MODE_COLUMNS
    fixed = checked_numbers(own_modes, rows, source="linearize", key="modes", finite=True)
    names = _reading_names(structure)
    check_type("linearize", "outputs", outputs, list, tuple)
    for output in outputs:
        check_type("linearize", "outputs", output, str)
        if output not in names:
            raise InputError("linearize", "outputs", no_such("readings", output, [*names]))
    left, greatest, least = _forces_left(robot, at, fixed)
    if state is None and left > BALANCED * greatest:
        problem = "does not rest on this terrain with these actuators; give a state"
        raise InputError(robot.scenario.name, "robot", problem)
    A, *matrices = _matrices(
        robot, at, fixed, outputs, of_signals=min(greatest, 0.5 * least / STEP)
    )
    if not all(np.isfinite(matrix).all() for matrix in (A, *matrices)):
        raise InputError("linearize", "state", "found a state whose forces are not finite")
    resisted = _resisted_states(robot, at, A)
    return Linearization(
        robot=robot,
        system=LinearSystem(A, *matrices),
        states=_state_names(robot),
        inputs=robot.structure.oscillators,
        outputs=tuple(name for output in outputs for name in names[output]),
        state=at,
        signals=robot.first_signals,
        resisted=resisted,
    )


def _checked_cost(given: npt.ArrayLike, size: int, key: str) -> np.ndarray:
    """A cost matrix (size, size) of lqr(). Raises InputError unless it is symmetric without
    negative eigenvalues, which Drake does not check."""
    cost = checked_numbers(given, (size, size), source="lqr", key=key, finite=True)
    least = np.linalg.eigvalsh(cost).min(initial=0.0)
    if not np.allclose(cost, cost.T, 1e-12, 0.0) or least < -1e-12 * np.abs(cost).max(initial=0.0):
        raise InputError("lqr", key, "expected a symmetric matrix without negative eigenvalues")
    return np.asarray(0.5 * (cost + cost.T))


def _matrices(
    robot: Robot,
    state: np.ndarray,
    modes: np.ndarray,
    outputs: Sequence[str],
    *,
    of_signals: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The matrices A, B, C and D of linearize(), by central differences. Steps of the signals are a
    share of `of_signals` (N)."""
    structure, drives, signals = robot.structure, robot.starting_drives(), robot.first_signals
    bodies = len(structure.bodies)
    w_WB = state[7 * bodies :].reshape(-1, 6)[:, :3]

    def rates_and_outputs(x: np.ndarray) -> np.ndarray:
        """Rates of the states, then outputs, with the states and inputs x."""
        moves, velocities, wound, pulls = np.split(x, ends)
        moved = state.copy()
        displace(state, moves, moved)
        moved[7 * bodies :] += velocities
        acceleration, rates, forces = rates_and_forces(
            robot.model, moved, modes, signals + pulls, drives + wound
        )
        speeds = velocities.reshape(-1, 6).copy()
        speeds[:, :3] += np.cross(w_WB, moves.reshape(-1, 6)[:, :3])
        cables, ground = forces.cable_forces, forces.ground_forces
        readings = Readings.of(
            structure, time=0.0, state=moved, cable_forces=cables, ground_forces=ground
        )
        seen = [getattr(readings, output).ravel() for output in outputs]
        return np.concatenate([speeds.ravel(), acceleration, rates, *seen])

    ends = np.cumsum([6 * bodies, 6 * bodies, drives.size])
    radius = float(structure.radius.max() or np.ptp(structure.p_WN))
    of_bodies = np.tile(np.repeat([1.0, radius], 3), 2 * bodies)
    of_drives = np.full(drives.size, np.abs(drives).max(initial=0.0) or 1.0)
    scales = np.concatenate([of_bodies, of_drives, np.full(signals.size, of_signals)])
    jacobian, size = derivatives(rates_and_outputs, STEP * scales), ends[-1]
    of_states, of_inputs = jacobian[:, :size], jacobian[:, size:]
    return of_states[:size], of_inputs[:size], of_states[size:], of_inputs[size:]


def _resisted_states(robot: Robot, state: np.ndarray, A: np.ndarray) -> np.ndarray:
    """`resisted` of a Linearization with the matrix A: all but the structure's free motions, as far
    as nothing in A resists them, such as friction. Their forces in A, rounding errors, become 0."""
    unactuated = Unactuated(robot.model)
    force_at_rest(unactuated, state)
    free, spaces = free_motions(unactuated, state), []
    n, radii = len(free), np.repeat([unactuated.radius, 1.0], 3)
    free /= np.tile(radii, n // 6)[:, np.newaxis]
    for first in (0, n):  # displacements, then velocities
        _, rates, ways = np.linalg.svd(A[n : 2 * n, first : first + n] @ free, full_matrices=False)
        free = free @ ways[rates <= _UNRESISTED * np.abs(A[n : 2 * n, :n]).max()].T
        spaces.append(free)
    free = np.pad(linalg.block_diag(*spaces), ((0, len(A) - 2 * n), (0, 0)))
    A[n:] -= A[n:] @ free @ np.linalg.pinv(free)
    return np.asarray(linalg.null_space(free.T))


def _forces_left(robot: Robot, state: np.ndarray, modes: np.ndarray) -> tuple[float, float, float]:
    """The force (N) that accelerates a body most, infinite if an actuator moves; the greatest
    force, a tension or the robot's weight, 1 if both are 0; and the least tension of a driven cable
    that pulls. Torques count with the radius of the body."""
    bodies, drives = robot.model.bodies, robot.starting_drives()
    acceleration, rates, forces = rates_and_forces(
        robot.model, state, modes, robot.first_signals, drives
    )
    turns, ways = np.abs(acceleration).reshape(-1, 2, 3).max(axis=2).T
    levers = bodies.inertia.max(axis=1) / np.maximum(bodies.radius, np.finfo(float).tiny)
    left = max((turns * levers).max(), (ways * bodies.mass).max())
    if np.abs(rates).max(initial=0.0) > BALANCED * np.abs(drives).max(initial=1.0):
        left = math.inf
    tensions = forces.cable_forces[:, TENSION]
    greatest = max(float(tensions.max(initial=0.0)), robot.weight) or 1.0
    pulls = tensions[robot.driven]
    return float(left), greatest, pulls[pulls > _ROUNDED * greatest].min(initial=math.inf)


def _state_names(robot: Robot) -> tuple[str, ...]:
    """Names of the states of a robot's linear system."""
    structure, kinds = robot.structure, ("theta_x theta_y theta_z x y z", "w_x w_y w_z v_x v_y v_z")
    names = [f"{body} {of}" for kind in kinds for body in structure.bodies for of in kind.split()]
    driven = np.sort(robot.driven)[: robot.starting_drives().size]
    return (*names, *(f"drive {structure.cable_names[cable]}" for cable in driven))


def _reading_names(structure: Structure) -> dict[str, list[str]]:
    """Names of the numbers of readings, by the name of the reading."""
    nodes, bodies, cables = structure.node_names, structure.bodies, structure.cable_names
    return {
        "lengths": [f"length {cable}" for cable in cables],
        "rates": [f"rate {cable}" for cable in cables],
        "tensions": [f"tension {cable}" for cable in cables],
        "normal_forces": [f"load {nodes[contact]}" for contact in structure.contacts],
        "w_WB": [f"{body} w_{axis}" for body in bodies for axis in "xyz"],
        "p_WN": [f"{node} {axis}" for node in nodes for axis in "xyz"],
        "v_WN": [f"{node} v_{axis}" for node in nodes for axis in "xyz"],
    }
