"""Contact of struts as a LeafSystem."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from tetra_drake.physics.forces import Forces, compute_strut_forces
from tetra_drake.robot.robot import Robot
from tetra_drake.simd.compiling import machine_code
from tetra_drake.simd.packed import Packed


class StrutContact(LeafSystem):
    """Forces between struts of different bodies that touch. The system has no state.

    | port              | shape   | unit   | meaning                                 |
    |-------------------|---------|--------|-----------------------------------------|
    | state             | (13 n,) | SI     | [q; v] of n free bodies, from the plant |
    | generalized_force | (6 n,)  | N m, N | [t_W; f_W] at each body's origin        |

    Struts are capsules; see `physics.capsules`. The force is continuous, so no step has to end
    where struts begin to touch.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        bodies = len(robot.structure.bodies)
        self._parts = Packed((robot.model, Forces.of(robot.model)))
        state, force = np.empty(13 * bodies), np.empty(6 * bodies)
        self._compute_forces = machine_code(compute_strut_forces, self._parts, state, force)
        self._state = self.DeclareVectorInputPort("state", state.size)
        sources = {self._state.ticket()}
        self.DeclareVectorOutputPort("generalized_force", force.size, self._calc_force, sources)

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        self._compute_forces(self._parts, self._state.Eval(context), output.get_mutable_value())
