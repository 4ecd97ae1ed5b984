"""Forces that depend on the state alone, as LeafSystems: contact of struts, anchors, loads."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from tetra_drake.physics import forces
from tetra_drake.robot.robot import Robot
from tetra_drake.simd.compiling import machine_code
from tetra_drake.simd.packed import Packed


class StateForce(LeafSystem):
    """A force on the bodies that depends on the state alone. The system has no state.

    | port              | shape   | unit   | meaning                                 |
    |-------------------|---------|--------|-----------------------------------------|
    | state             | (13 n,) | SI     | [q; v] of n free bodies, from the plant |
    | generalized_force | (6 n,)  | N m, N | [t_W; f_W] at each body's origin        |

    `compute` is the kernel of physics.forces that writes the generalized force.
    """

    def __init__(self, robot: Robot, compute: Callable[..., None]) -> None:
        super().__init__()
        bodies = len(robot.structure.bodies)
        self._parts = Packed((robot.model, forces.Forces.of(robot.model)))
        state, force = np.empty(13 * bodies), np.empty(6 * bodies)
        self._compute = machine_code(compute, self._parts, state, force)
        self._state = self.DeclareVectorInputPort("state", state.size)
        sources = {self._state.ticket()}
        self.DeclareVectorOutputPort("generalized_force", force.size, self._calc_force, sources)

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        self._compute(self._parts, self._state.Eval(context), output.get_mutable_value())


class StrutContact(StateForce):
    """Forces between struts of different bodies that touch; see `physics.capsules`. For the ports,
    see StateForce.

    The force is continuous, so no step has to end where struts begin to touch.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot, forces.compute_strut_forces)


class Anchors(StateForce):
    """Springs and dampers that hold nodes of bodies in the world; see `physics.node_forces`. For
    the ports, see StateForce."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot, forces.compute_anchor_forces)


class Loads(StateForce):
    """Constant forces on nodes, in the world frame; see `physics.node_forces`. For the ports, see
    StateForce."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot, forces.compute_loads)
