"""A single step of the compiled engine, by itself."""

from tetra_drake.engines.compiled.dynamics import Solver
from tetra_drake.engines.compiled.rosenbrock import Step
from tetra_drake.physics.forces import sizes_of
from tetra_drake.physics.model import Model
from tetra_drake.simd.allocation import allocate


def make_step(robot: Model) -> Step:
    """Room for a step of a robot."""
    width = Solver.of(robot).schedule.width
    return allocate(Step, sizes_of(robot) | {"width": width})
