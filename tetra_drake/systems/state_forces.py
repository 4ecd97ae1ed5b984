"""Forces that depend on the state alone, as a LeafSystem: contact of struts, anchors, joints,
loads."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context

from tetra_drake.kernels.compiling import machine_code
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.forces import Forces, compute_state_forces, compute_strut_forces
from tetra_drake.robot.robot import Robot
from tetra_drake.systems.scalar_conversion import ConvertibleSystem


class StateForces(ConvertibleSystem):
    """Forces of struts that touch, anchors, joints and constant loads. The system has no state.

    | port              | in, out | shape   | unit   | meaning                                 |
    |-------------------|---------|---------|--------|-----------------------------------------|
    | state             | in      | (13*n,) | SI     | [q; v] of n free bodies, from the plant |
    | generalized_force | out     | (6*n,)  | N m, N | [t_W; f_W] at each body's origin        |

    An anchor holds a node by a damped spring; a load is a constant force on a node. See
    `laws.capsules` and `laws.forces`. The forces are continuous, so no step has to end where struts
    begin to touch. But long steps could carry struts through each other.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        bodies = len(robot.structure.bodies)
        parts = Packed((robot.model, Forces.of(robot.model)))
        state, self._force = np.empty(13 * bodies), np.empty(6 * bodies)
        self._compute = machine_code(compute_state_forces, parts, state, self._force)
        self._touch = machine_code(compute_strut_forces, parts, state, 0.0, self._force)
        self._state = self.DeclareVectorInputPort("state", state.size)
        sources = {self._state.ticket()}
        self.DeclareVectorOutputPort("generalized_force", 6 * bodies, self._calc_force, sources)

    def LongestStep(self, context: Context, *, horizon: float) -> float:
        """Longest step (s), at most `horizon`, that cannot carry a strut through another.

        Args:
            context: the system's own context, from which the bodies' motion is read.
            horizon: upper limit (s).
        """
        return float(self._touch(self._state.Eval(context), horizon, self._force))

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        self._compute(self._state.Eval(context), output.get_mutable_value())
