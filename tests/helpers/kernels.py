"""A step of the compiled engine, and the forces at a state, by themselves."""

import numpy as np

from tetra_drake.engines.lanes.dynamics import Solver, StepMemory, implicit_matrix
from tetra_drake.engines.lanes.ros2 import take_step
from tetra_drake.kernels.compiling import compiled
from tetra_drake.kernels.lanes import Real, Table
from tetra_drake.kernels.packed import Packed, allocate, unpacked
from tetra_drake.laws.forces import Forces, compute_forces, move_robot, sizes_of
from tetra_drake.laws.model import Model
from tetra_drake.laws.sparse import Schedule

Parts = Packed[tuple[Model, Solver, Forces, StepMemory]]


class Stepper:
    """A robot in steps of the compiled engine, without lanes."""

    def __init__(self, robot: Model) -> None:
        self.solver, self.forces = Solver.of(robot), Forces.of(robot)
        self.robot = robot = self.solver.oriented(robot)
        sizes = {
            "blocks": len(self.solver.schedule.later),
            "signals": 1 + robot.cables.signal.max(),
        }
        self.work = allocate(StepMemory, sizes_of(robot) | sizes)
        self.parts: Parts = Packed((robot, self.solver, self.forces, self.work))

    def force_at(self, state: np.ndarray, modes: np.ndarray, signals: np.ndarray) -> np.ndarray:
        """The generalized force (6 bodies,) in the modes of contacts; `forces` has its parts."""
        self.work.state[:] = state
        compute_force(self.parts, modes, signals)
        return self.work.force.copy()

    def take(self, modes: np.ndarray, start: np.ndarray, end: np.ndarray, h: float) -> float:
        """Moves `work.state` by a step h (s) with signals at its start and end. Returns the
        estimate of its error."""
        compute_force(self.parts, modes, start)
        self.work.end_signals[:] = end
        error = step_once(self.parts, modes, h)
        self.work.state[:] = self.work.end
        return error

    def matrix(self, modes: np.ndarray, time: float) -> np.ndarray:
        """The implicit matrix (6 bodies, 6 bodies) at the state of the last force_at()."""
        blocks, lines = self.work.blocks, self.work.lines
        blocks[:] = lines[:] = np.nan  # what is not written must not be read
        write_matrix(self.parts, modes, time)
        return written_out(blocks, self.solver.schedule)


def written_out(blocks: np.ndarray, schedule: Schedule) -> np.ndarray:
    """A symmetric matrix (6 bodies, 6 bodies) from its blocks."""
    bodies = len(schedule.first) - 1
    matrix = np.zeros((bodies, bodies, 6, 6))
    for body in range(bodies):
        matrix[body, body] = blocks[body]
    for pair, block in schedule.blocks.items():
        matrix[pair], matrix[pair[::-1]] = blocks[block], blocks[block].T
    upper = np.triu(matrix.swapaxes(1, 2).reshape(6 * bodies, 6 * bodies))
    return upper + np.triu(upper, 1).T


@compiled
def compute_force(parts: Parts, modes: Table, signals: Table) -> None:
    robot, _, forces, work = unpacked(parts)
    move_robot(robot, work.state, forces)
    compute_forces(robot, work.state, modes, signals, True, forces, work.force)


@compiled
def step_once(parts: Parts, modes: Table, h: Real) -> Real:
    robot, solver, forces, work = unpacked(parts)
    return take_step(robot, solver, work, modes, forces, h, False)


@compiled
def write_matrix(parts: Parts, modes: Table, time: Real) -> None:
    robot, solver, forces, work = unpacked(parts)
    implicit_matrix(robot, solver, work, modes, forces, time)
