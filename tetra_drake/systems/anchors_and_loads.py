"""Anchors of the robot, or constant loads on it, as a LeafSystem."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from tetra_drake.physics.forces import Forces
from tetra_drake.robot.robot import Robot
from tetra_drake.simd.compiling import machine_code
from tetra_drake.simd.packed import Packed


class NodeForces(LeafSystem):
    """Forces of the surroundings on nodes: anchors, or constant loads (see physics.node_forces).
    The system has no state.

    | port              | shape   | unit   | meaning                                  |
    |-------------------|---------|--------|------------------------------------------|
    | state             | (13 n,) | SI     | [q; v] of n free bodies, from the plant  |
    | generalized_force | (6 n,)  | N m, N | [t_W; f_W] at each body's origin         |
    """

    def __init__(self, robot: Robot, *, kernel: Callable[..., None]) -> None:
        """`kernel` is compute_anchor_forces() or compute_loads() of physics.forces."""
        super().__init__()
        bodies = len(robot.structure.bodies)
        self._parts = Packed((robot.model, Forces.of(robot.model)))
        state, force = np.empty(13 * bodies), np.empty(6 * bodies)
        self._compute_forces = machine_code(kernel, self._parts, state, force)
        self._state = self.DeclareVectorInputPort("state", state.size)
        inputs = {self._state.ticket()}
        self.DeclareVectorOutputPort("generalized_force", force.size, self._calc_force, inputs)

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        self._compute_forces(self._parts, self._state.Eval(context), output.get_mutable_value())
