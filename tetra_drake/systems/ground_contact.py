"""Ground under bodies of a plant, as a LeafSystem: normal forces and friction."""

from __future__ import annotations

import weakref
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiagramBuilder,
    DiscreteValues,
    EventStatus,
    WitnessFunction,
    WitnessFunctionDirection,
)

from tetra_drake.errors import InputError, check_type, checked_numbers
from tetra_drake.kernels.compiling import machine_code
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws import contact
from tetra_drake.laws.forces import Forces, compute_ground_forces
from tetra_drake.laws.kinematics import FORCE
from tetra_drake.laws.mode_change import modes_after_step, next_mode_change
from tetra_drake.laws.model import Model
from tetra_drake.systems.attachment import (
    Attach,
    DeclareOutput,
    Nodes,
    check_constants,
    check_frame,
    check_host,
    check_parameters,
    numbers_for_each,
)
from tetra_drake.systems.scalar_conversion import ConvertibleSystem


class GroundContact(ConvertibleSystem):
    """Normal force (thesis Eq. 1) and friction at m contact nodes, on any terrain.

    | port              | in/out | shape   | unit   | meaning                                      |
    |-------------------|--------|---------|--------|----------------------------------------------|
    | state             | in     | (13*n,) | SI     | [q; v] of n bodies, as if free               |
    | generalized_force | out    | (6*n,)  | N m, N | [t_W; f_W] at each body's origin             |
    | normal_forces     | out    | (m,)    | N      | along the ground's normal, never negative    |
    | friction_forces   | out    | (2*m,)  | N      | per node: along the tangents t1 and t2       |
    | contact_forces    | out    | (3*m,)  | N      | per node: the whole force, in the world      |
    | modes             | out    | (3*m,)  | 1      | per node: 1 if it touches, otherwise 0; then |
    |                   |        |         |        | its direction of slip along t1 and t2, which |
    |                   |        |         |        | is 0 and 0 if it sticks                      |
    | mode_table        | out    | (12*m,) | SI     | the discrete state, 12 numbers per node      |
    | ground_forces     | out    | (3*m,)  | N      | per node: friction along t1, t2, then normal |

    The ground's forces act on the nodes, or on the lowest points of round feet. On flat ground t1
    and t2 are the axes x and y of the world; otherwise see `laws.terrain`.

    The discrete state has 12 numbers per node: the three of `modes`, the stick point (m) where the
    bristle is not deflected, and the heading and orientation of the node's body; see
    `laws.contact`. Deflections follow from the stick points, so no continuous state has to be
    reset. The discrete state is updated at the end of a step; Initialize() sets it from the pose.

    `model` has the bodies, the ground and its contact nodes. With `witness`, a step also ends where
    a mode changes, to within Drake's isolation window: 0.01 s times the accuracy of
    Context.SetAccuracy().

    With `parameters`, the constants of the ground are parameters of the context: the fields of
    laws.contact.NormalForce, then the constants of the law of friction; see SetGround().

    With `modes` (m, 12), the modes are fixed: the system has no discrete state, as Drake's
    Linearize and DirectCollocation need it.
    """

    def __init__(
        self,
        model: Model,
        *,
        witness: bool = False,
        parameters: bool = False,
        modes: np.ndarray | None = None,
    ) -> None:
        super().__init__()
        self._fixed_modes = modes
        ground, normals = model.ground, model.ground.normal.size
        self._constants = np.concatenate([ground.normal, ground.friction.constants])  # a copy
        friction = ground.friction._replace(constants=self._constants[normals:])
        self._ground = ground._replace(normal=self._constants[:normals], friction=friction)
        model = model._replace(ground=self._ground)
        self._has_parameters = parameters
        if parameters:
            self.DeclareNumericParameter(BasicVector(self._constants))
        bodies, count = model.bodies.mass.size, model.ground.contacts.size
        # The kernels write to these arrays at every call.
        self._forces, self._force = Forces.of(model), np.empty(6 * bodies)
        parts = Packed((model, self._forces))
        state, table = np.empty(13 * bodies), np.empty((count, contact.MODE_COLUMNS))
        self._compute_forces = machine_code(compute_ground_forces, parts, state, table, self._force)
        self._update_modes = machine_code(modes_after_step, parts, state, table)
        self._next_change = machine_code(next_mode_change, parts, state, self._force, table, 0.0)
        self._state = self.DeclareVectorInputPort("state", state.size)
        if modes is None:
            self.DeclareDiscreteState(table.size)
            self.DeclareInitializationDiscreteUpdateEvent(self._start)
            self.DeclarePerStepDiscreteUpdateEvent(self._update)
        # The witness function has no event: it only ends the step, and the per-step update follows.
        # A bound method in place of the lambda would keep the system alive for ever.
        this, falls = weakref.proxy(self), WitnessFunctionDirection.kPositiveThenNonPositive
        keeps = self.MakeWitnessFunction(
            "keeps its modes", falls, lambda context: -1.0 if this._is_due(context) else 1.0
        )
        self._witnesses = [keeps] if witness and modes is None else []
        sources = {self._state.ticket(), self.xd_ticket(), self.all_parameters_ticket()}
        self.DeclareVectorOutputPort("generalized_force", 6 * bodies, self._calc_force, sources)
        forces, rows, discrete = GroundContact._table, GroundContact._modes, {self.xd_ticket()}
        n, point = contact.NORMAL, contact.STICK_POINT
        DeclareOutput(self, "normal_forces", count, lambda s, c: forces(s, c)[:, n], sources)
        DeclareOutput(self, "friction_forces", 2 * count, lambda s, c: forces(s, c)[:, :n], sources)
        DeclareOutput(self, "contact_forces", 3 * count, GroundContact._forces_in_world, sources)
        DeclareOutput(self, "modes", 3 * count, lambda s, c: rows(s, c)[:, :point], discrete)
        DeclareOutput(self, "mode_table", table.size, rows, discrete)
        DeclareOutput(self, "ground_forces", 3 * count, forces, sources)

    def SetGround(self, context: Context, ground: contact.Ground) -> None:
        """Copies the constants of normal force and friction of a ground, such as a robot's ground
        or one of robot.ground.make_surface(), to a context of this system. The ground's contact
        nodes are ignored.

        Raises InputError if the constants are no parameters, one of them is negative or not finite,
        or the ground has another law of friction or another terrain.
        """
        check_parameters("SetGround", self, context)
        check_type("SetGround", "ground", ground, contact.Ground)
        check_type("SetGround", "ground.friction", ground.friction, type(self._ground.friction))
        if ground.friction.kind != self._ground.friction.kind:
            raise InputError("SetGround", "ground", "found another law of friction")
        # The last number of a grid is the largest radius of a foot, and rolled surfaces come last.
        own = min(ground.heights.size, self._ground.heights.size)
        theirs, ours = ((*one.grid[:-1], *one.heights[:own]) for one in (ground, self._ground))
        if theirs != ours:
            raise InputError("SetGround", "ground", "found another terrain")
        given, count = np.append(ground.normal, ground.friction.constants), self._constants.size
        numbers = numbers_for_each("SetGround", "ground", given, count=count, least=0.0)
        context.get_mutable_numeric_parameter(0).SetFromVector(numbers)

    def NextModeChange(
        self, context: Context, *, acceleration: np.ndarray, horizon: float
    ) -> tuple[bool, float]:
        """Predicts when a node will touch or leave the ground, stick or slip: a change of mode.

        Returns True if a mode changes at once when a step ends now, and the time (s) from now to
        the next change, at most `horizon` (s). The state in `context` is not changed.

        `acceleration` (6*n,) is dv/dt of the bodies, with v as in the port `state`. The prediction
        assumes that the acceleration of each node is constant.
        """
        modes = self._modes(context).copy()
        change: tuple[bool, float] = self._next_change(
            self._state_in(context), acceleration, modes, horizon
        )
        return change

    def DoGetWitnessFunctions(self, context: Context) -> list[WitnessFunction]:
        """Witness functions of the system: one with `witness`, otherwise none."""
        return self._witnesses

    def _is_due(self, context: Context) -> bool:
        """True if a mode changes at once when a step ends now."""
        return bool(self._update_modes(self._state_in(context), self._modes(context).copy()))

    def _state_in(self, context: Context) -> np.ndarray:
        """The state in a context. The kernels get the constants in this context."""
        if self._has_parameters:
            self._constants[:] = context.get_numeric_parameter(0).value()
        return self._state.Eval(context)

    def _modes(self, context: Context) -> np.ndarray:
        if self._fixed_modes is not None:
            return self._fixed_modes
        return context.get_discrete_state_vector().value().reshape(-1, contact.MODE_COLUMNS)

    def _start(self, context: Context, values: DiscreteValues) -> EventStatus:
        # Zero modes mean no contact. The update makes every node in the ground stick.
        values.set_value(np.zeros(values.value().size))
        self._update(context, values)
        return EventStatus.Succeeded()

    def _update(self, context: Context, values: DiscreteValues) -> EventStatus:
        modes = values.get_mutable_value().reshape(-1, contact.MODE_COLUMNS)
        before = modes.tobytes()
        self._update_modes(self._state_in(context), modes)
        if modes.tobytes() != before:
            return EventStatus.Succeeded()
        return EventStatus.DidNothing()  # Drake keeps the values cached at this state

    def _table(self, context: Context) -> np.ndarray:
        """The forces of the port `ground_forces` as a table (contacts, 3) in N. Also computes the
        generalized force."""
        self._compute_forces(self._state_in(context), self._modes(context), self._force)
        return self._forces.ground_forces

    def _forces_in_world(self, context: Context) -> np.ndarray:
        """Forces f_N_W (contacts, 3) of the ground on the contact nodes in N."""
        self._table(context)
        return self._forces.nodes[self._ground.contacts, FORCE : FORCE + 3]

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        self._table(context)
        output.SetFromVector(self._force)


def AddGroundContact(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    *,
    frames: Sequence[Frame],
    ground: contact.Ground,
    radius: float | Sequence[float] = 0.0,
    witness: bool = False,
    parameters: bool = False,
    modes: npt.ArrayLike | None = None,
    name: str = "ground",
) -> GroundContact:
    """Adds a ground under spheres at the origins of frames of a plant's bodies.

    The plant must be finalized, may have any joints, and should be continuous. `radius` (m) is one
    radius for all spheres, or a radius for each. If it is 0, the ground touches the origins
    themselves. Make `ground` with robot.ground.make_surface(), or use a robot's ground: its contact
    nodes and their radii are then replaced by `frames` and `radius`. For `witness`, `parameters`
    and `modes` see GroundContact. The ports have the contact nodes in the order of `frames`. This
    example puts a scenario's ground under the tip of a link:

    >>> given = load_scenario("coulomb")
    >>> surface = make_surface(given.ground, given.friction, given.terrain)
    >>> tip = AddFrame(plant, "tip", link, [0.0, 0.0, -1.0])  # before plant.Finalize()
    >>> AddGroundContact(builder, plant, frames=[tip], ground=surface)

    Raises InputError if an argument is of a wrong type or size, a frame is of the world, of another
    plant or given twice, another system has the name, or a number is negative or not finite.
    """
    check_host("AddGroundContact", builder, plant, name=name)
    check_type("AddGroundContact", "frames", frames, Sequence)
    check_type("AddGroundContact", "ground", ground, contact.Ground)
    check_type("AddGroundContact", "witness", witness, bool)
    check_type("AddGroundContact", "parameters", parameters, bool)
    normal = contact.NormalForce(*ground.normal.tolist())._asdict()
    check_constants("AddGroundContact", "ground", normal)
    for place, frame in enumerate(frames):
        key = f"frames[{place}]"
        check_frame("AddGroundContact", key, plant, frame)
        if frame.body() is plant.world_body():
            raise InputError("AddGroundContact", key, "found a frame of the world")
        if any(frame is earlier for earlier in frames[:place]):
            raise InputError("AddGroundContact", key, f"frame '{frame.name()}' is given twice")
    nodes = Nodes.of(plant, frames)
    contacts = np.array([nodes.of_frame[frame.index()] for frame in frames], dtype=np.int64)
    radii = numbers_for_each("AddGroundContact", "radius", radius, count=len(frames), least=0.0)
    carriers = nodes.carriers[contacts]
    placed = ground.under(contacts, carriers=carriers, radius=radii, nodes=len(nodes.p_BN))
    model = Model.of_nodes(nodes.p_BN, nodes.first_node, ground=placed)
    if modes is not None:
        source, shape = "AddGroundContact", (len(frames), contact.MODE_COLUMNS)
        modes = checked_numbers(modes, shape, source=source, key="modes", finite=True)
    contacts_of = GroundContact(model, witness=witness, parameters=parameters, modes=modes)
    system = builder.AddNamedSystem(name, contacts_of)
    Attach(builder, plant, system)
    return system
