"""A step of the compiled engine, and the forces at a state, by themselves."""

from tetra_drake.engines.compiled.dynamics import Solver
from tetra_drake.engines.compiled.rosenbrock import Step
from tetra_drake.physics.forces import Forces, compute_forces, move_robot, sizes_of
from tetra_drake.physics.model import Model
from tetra_drake.simd.allocation import allocate
from tetra_drake.simd.compiling import compiled
from tetra_drake.simd.lanes import Table


def make_step(robot: Model) -> Step:
    """Room for a step of a robot."""
    width = Solver.of(robot).schedule.width
    return allocate(Step, sizes_of(robot) | {"width": width})


@compiled
def forces_at(
    robot: Model, state: Table, modes: Table, signals: Table, forces: Forces, generalized: Table
) -> None:
    """Writes the `forces` and the generalized force (6 bodies,) in the modes of contacts."""
    move_robot(robot, state, forces)
    compute_forces(robot, state, modes, signals, True, forces, generalized)
