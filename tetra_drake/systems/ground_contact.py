"""The ground under the robot as a system: normal force and reset-integrator friction."""

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
    STICK_POINT,
    ground_forces,
    mode_margin,
    time_to_mode_change,
    update_modes,
)
from tetra_drake.physics.kinematics import NODE_COLUMNS
from tetra_drake.robot.model import ground_law
from tetra_drake.robot.structure import Structure, moved_nodes
from tetra_drake.scenario.schema import Friction, GroundScenario


class GroundContact(LeafSystem):
    """Normal force (thesis Eq. 1) and reset-integrator friction (Eq. 3-5) at m contact nodes.

    | port              | shape   | unit   | meaning                                          |
    |-------------------|---------|--------|--------------------------------------------------|
    | state             | (13 n,) | SI     | [q; v] of n free bodies, from the plant          |
    | generalized_force | (6 n,)  | N m, N | [t_W; f_W] at each body's origin                 |
    | normal_forces     | (m,)    | N      | upward, by contact node                          |
    | friction_forces   | (2 m,)  | N      | along x and y, by contact node                   |
    | modes             | (3 m,)  | 1      | contact (0, 1), then friction mode along x and y |
    |                   |         |        | (0 sticks, ±1 slips that way), by contact node   |

    Discrete state: `modes` of `physics.contact`; deflections follow from the stick points, so no
    continuous state has to be reset. The modes are frozen within a step, which keeps the forces
    smooth there, and updated at its end; Initialize() sets them from the pose.

    With `witness`, steps also end where a mode is due to change, to within Drake's isolation
    window: 0.01 s times the accuracy set by Context.SetAccuracy.
    """

    def __init__(
        self,
        structure: Structure,
        ground: GroundScenario,
        friction: Friction,
        *,
        witness: bool = False,
    ) -> None:
        super().__init__()
        self._structure, self._contacts = structure, structure.contacts
        self._law = ground_law(ground, friction)
        bodies, count = len(structure.bodies), len(structure.contacts)
        self._size, self._shape = 6 * bodies, (len(structure.node_names), NODE_COLUMNS)
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

    def TimeToModeChange(
        self, context: Context, *, acceleration: np.ndarray, horizon: float
    ) -> float:
        """Predicted time (s) to the next mode change, at most `horizon` (s).

        `acceleration`, (6 n,), is dv/dt of the bodies; each node's is taken as constant.
        Changes due right now count as made.
        """
        nodes, rows = self._nodes(context), self._rows(context).copy()
        update_modes(nodes, self._contacts, self._law, rows)
        state, ground = self._state.Eval(context), (self._contacts, self._law)
        return time_to_mode_change(state, acceleration, nodes, rows, *ground, horizon)

    def ModeChangeIsDue(self, context: Context) -> bool:
        """Whether a mode will change if a step ends here."""
        rows = self._rows(context).copy()
        return update_modes(self._nodes(context), self._contacts, self._law, rows)

    def DoGetWitnessFunctions(self, context: Context) -> list[WitnessFunction]:
        """The one witness, if asked for."""
        return self._witnesses

    def _rows(self, context: Context) -> np.ndarray:
        return context.get_discrete_state_vector().value().reshape(-1, MODE_COLUMNS)

    def _nodes(self, context: Context) -> np.ndarray:
        return moved_nodes(self._structure, self._state.Eval(context))

    def _start(self, context: Context, values: DiscreteValues) -> EventStatus:
        # From "nowhere in contact", an update makes every node at or below 0 stick where it is.
        values.set_value(np.zeros(values.value().size))
        self._update(context, values)
        return EventStatus.Succeeded()

    def _update(self, context: Context, values: DiscreteValues) -> EventStatus:
        rows = values.get_mutable_value().reshape(-1, MODE_COLUMNS)
        if update_modes(self._nodes(context), self._contacts, self._law, rows):
            return EventStatus.Succeeded()
        return EventStatus.DidNothing()  # so that what was computed at this state stays valid

    def _margin(self, context: Context) -> float:
        rows = self._rows(context)
        return mode_margin(self._nodes(context), rows, self._contacts, self._law)

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        self._push(context, output.get_mutable_value())

    def _push(self, context: Context, force: np.ndarray) -> np.ndarray:
        """Writes the generalized force; returns (m, 3): friction along x and y, normal force."""
        state, rows = self._state.Eval(context), self._rows(context)
        nodes, pushes = np.empty(self._shape), np.empty((len(self._contacts), 3))
        law = self._structure.p_BN, self._contacts, self._law
        ground_forces(state, rows, *law, nodes, pushes, force)
        return pushes

    def _calc_normal(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._push(context, np.empty(self._size))[:, 2])

    def _calc_friction(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._push(context, np.empty(self._size))[:, :2].ravel())

    def _calc_modes(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._rows(context)[:, :STICK_POINT].ravel())
