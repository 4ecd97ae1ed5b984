"""The ground under the robot as a system: normal force and friction."""

from __future__ import annotations

import weakref

import numpy as np
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiscreteValues,
    EventStatus,
    LeafSystem,
    WitnessFunction,
    WitnessFunctionDirection,
)

from tetra_drake.physics.contact import (
    MODE_COLUMNS,
    NORMAL,
    PUSH_COLUMNS,
    STICK_POINT,
    ground_arguments,
    ground_forces,
    modes_after_step,
)
from tetra_drake.physics.kinematics import NODE_COLUMNS
from tetra_drake.physics.mode_change import mode_margin, next_mode_change
from tetra_drake.physics.terrain import FRAME_COLUMNS
from tetra_drake.robot.robot import Robot


class GroundContact(LeafSystem):
    """Normal force (thesis Eq. 1) and friction at m contact nodes, on the scenario's terrain.

    | port              | shape   | unit   | meaning                                           |
    |-------------------|---------|--------|---------------------------------------------------|
    | state             | (13 n,) | SI     | [q; v] of n free bodies, from the plant           |
    | generalized_force | (6 n,)  | N m, N | [t_W; f_W] at each body's origin                  |
    | normal_forces     | (m,)    | N      | along the normal of the surface, by contact node  |
    | friction_forces   | (2 m,)  | N      | along its tangents t1 and t2, by contact node     |
    | modes             | (3 m,)  | 1      | contact (0, 1), then friction mode along t1 and   |
    |                   |         |        | t2: where it slips to, 0 sticks, by contact node  |

    On flat ground t1 and t2 are x and y; else see `physics.terrain`. The law of friction is the
    scenario's (see `physics.friction`): the reset integrator of the thesis (Eq. 3-5), whose modes
    are 0 or ±1 along each tangent, or Coulomb's, whose mode is a unit vector or 0.

    Discrete state: `modes` of `physics.contact`; deflections follow from the stick points, so no
    continuous state has to be reset. The modes are frozen within a step, which keeps the forces
    smooth there, and updated at its end; Initialize() sets them from the pose.

    With `witness`, steps also end where a mode is due to change, to within Drake's isolation
    window: 0.01 s times the accuracy set by Context.SetAccuracy.
    """

    def __init__(self, robot: Robot, *, witness: bool = False) -> None:
        super().__init__()
        structure = robot.structure
        self._p_BN, self._first_node = structure.p_BN, structure.first_node
        self._ground = robot.ground
        self._ground_arguments = ground_arguments(self._ground)
        bodies, count = len(structure.bodies), len(structure.contacts)
        # Room for the kernels, which write what they need of it at every call.
        self._nodes = np.empty((len(structure.node_names), NODE_COLUMNS))
        self._frames = np.empty((count, FRAME_COLUMNS))
        self._pushes = np.empty((count, PUSH_COLUMNS))
        self._force = np.empty(6 * bodies)
        self._state = self.DeclareVectorInputPort("state", 13 * bodies)
        self.DeclareDiscreteState(MODE_COLUMNS * count)
        self.DeclareInitializationDiscreteUpdateEvent(self._start)
        self.DeclarePerStepDiscreteUpdateEvent(self._update)
        # It carries no event of its own: it ends the step, and the update follows there.
        # (A bound method in its place would keep the system alive for ever.)
        this, falls = weakref.proxy(self), WitnessFunctionDirection.kPositiveThenNonPositive
        margin = self.MakeWitnessFunction("mode margin", falls, lambda c: this._margin(c))
        self._witnesses = [margin] if witness else []
        sources = {self._state.ticket(), self.xd_ticket()}
        self.DeclareVectorOutputPort("generalized_force", 6 * bodies, self._calc_force, sources)
        self.DeclareVectorOutputPort("normal_forces", count, self._calc_normal, sources)
        self.DeclareVectorOutputPort("friction_forces", 2 * count, self._calc_friction, sources)
        self.DeclareVectorOutputPort("modes", 3 * count, self._calc_modes, {self.xd_ticket()})

    def NextModeChange(
        self, context: Context, *, acceleration: np.ndarray, horizon: float
    ) -> tuple[bool, float]:
        """Mode change due if a step ends here, and the predicted time (s) from here to
        the next change after that, at most `horizon` (s).

        `acceleration`, (6 n,), is dv/dt of the bodies; each node's is taken as constant.
        """
        return next_mode_change(
            self._state.Eval(context),
            acceleration,
            self._modes(context).copy(),
            self._p_BN,
            self._first_node,
            self._ground,
            self._nodes,
            self._frames,
            horizon,
        )

    def DoGetWitnessFunctions(self, context: Context) -> list[WitnessFunction]:
        """The one witness, if asked for."""
        return self._witnesses

    def _modes(self, context: Context) -> np.ndarray:
        return context.get_discrete_state_vector().value().reshape(-1, MODE_COLUMNS)

    def _start(self, context: Context, values: DiscreteValues) -> EventStatus:
        # From "nowhere in contact", an update makes every node in the ground stick where it is.
        values.set_value(np.zeros(values.value().size))
        self._update(context, values)
        return EventStatus.Succeeded()

    def _update(self, context: Context, values: DiscreteValues) -> EventStatus:
        modes = values.get_mutable_value().reshape(-1, MODE_COLUMNS)
        changed = modes_after_step(
            self._state.Eval(context),
            self._p_BN,
            self._first_node,
            self._ground,
            self._nodes,
            self._frames,
            modes,
        )
        if changed:
            return EventStatus.Succeeded()
        return EventStatus.DidNothing()  # so that what was computed at this state stays valid

    def _margin(self, context: Context) -> float:
        return mode_margin(
            self._state.Eval(context),
            self._modes(context),
            self._p_BN,
            self._first_node,
            self._ground,
            self._nodes,
            self._frames,
        )

    def _push(self, context: Context) -> None:
        """Writes the generalized force and the ground's `pushes`."""
        ground_forces(
            self._state.Eval(context),
            self._modes(context),
            self._p_BN,
            self._first_node,
            *self._ground_arguments,
            self._nodes,
            self._frames,
            self._pushes,
            self._force,
        )

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        self._push(context)
        output.SetFromVector(self._force)

    def _calc_normal(self, context: Context, output: BasicVector) -> None:
        self._push(context)
        output.SetFromVector(self._pushes[:, NORMAL])

    def _calc_friction(self, context: Context, output: BasicVector) -> None:
        self._push(context)
        output.SetFromVector(self._pushes[:, :NORMAL].ravel())

    def _calc_modes(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._modes(context)[:, :STICK_POINT].ravel())
