"""A single step of the compiled engine, by itself."""

import numpy as np

from tetra_drake.engines.compiled.block_sparse import BLOCK
from tetra_drake.engines.compiled.dynamics import CABLES_AT_ONCE, LINE_COLUMNS, Solver
from tetra_drake.engines.compiled.rosenbrock import Step
from tetra_drake.physics.inertia import INERTIA_COLUMNS
from tetra_drake.physics.model import Model


def make_rows(robot: Model) -> np.ndarray:
    """Room for the implicit matrix of a robot."""
    return np.empty((len(robot.bodies.mass), BLOCK, Solver.of(robot).schedule.width))


def make_lines() -> np.ndarray:
    """Room for what is computed on the way to an implicit matrix."""
    return np.empty((CABLES_AT_ONCE, LINE_COLUMNS))


def make_step(robot: Model) -> Step:
    """Room for a step of a robot."""
    bodies = len(robot.bodies.mass)
    vectors = ("force", "end_force", "change", "stage", "k1", "k2")
    return Step(
        state=np.empty(13 * bodies),
        end=np.empty(13 * bodies),
        **{name: np.empty(BLOCK * bodies) for name in vectors},
        rows=make_rows(robot),
        lines=make_lines(),
        inertia=np.empty((bodies, INERTIA_COLUMNS)),
    )
