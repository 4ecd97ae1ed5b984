"""Cables between bodies of a plant, as a LeafSystem."""

from __future__ import annotations

import functools
import itertools
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder
from pydrake.systems.primitives import Integrator

from tetra_drake.errors import InputError, SimulationFailure, check_type
from tetra_drake.kernels.compiling import machine_code
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws import actuator, cable, kinematics
from tetra_drake.laws.actuator import Actuation, ActuatorKind, DrivenCables, Force
from tetra_drake.laws.forces import Forces, compute_cable_forces
from tetra_drake.laws.model import Model
from tetra_drake.settings.refusals import hint
from tetra_drake.systems.attachment import (
    Attach,
    DeclareOutput,
    Nodes,
    check_constants,
    check_frame,
    check_host,
    check_parameters,
    check_part,
    numbers_for_each,
)
from tetra_drake.systems.scalar_conversion import ConvertibleSystem


class CableNetwork(ConvertibleSystem):
    """Cables between bodies (thesis Eq. 6), also over rings. The system has no state.

    | port              | shape          | unit   | meaning                                  |
    |-------------------|----------------|--------|------------------------------------------|
    | state             | (13*n,)        | SI     | [q; v] of n bodies, as if free           |
    | signals           | (m,)           | N      | actuation, one per group of cables       |
    | drives            | (drives,)      | m or N | states of the actuators                  |
    | generalized_force | (6*n,)         | N m, N | [t_W; f_W] at each body's origin         |
    | tensions          | (cables,)      | N      | tension of each cable                    |
    | lengths           | (cables,)      | m      | length of each cable                     |
    | rates             | (cables,)      | m/s    | rate of each cable's length              |
    | cable_forces      | (7 cables,)    | SI     | table of laws.cable, row by row          |
    | ends              | (6*pieces,)    | m      | per piece: position of start, then end   |
    | drive_rates       | (drives,)      | 1/s    | rate of each drive, in its unit per s    |

    The 7 numbers of a cable are the direction from end a to end b in the world (3), the length (m),
    the tension (N), the derivative of the tension by the rate (N s/m), and the rate (m/s).

    A drive is the state of the actuator of one driven cable: a free length (m) or a tension (N).
    The port `signals` exists only if there are any, `drives` and `drive_rates` only if the kind of
    actuators has states.

    `lengths` and `rates` depend on the state alone, so a controller of lengths makes no algebraic
    loop. Where the model is `slack`, a cable goes slack instead of pushing. A cable whose ends meet
    does not pull; see laws.cable.MEETING.

    With `parameters`, the constants of the cables are parameters of the context (5*cables,): each
    number of laws.cable.CableLaw for all cables, one after the other, then the rows of their
    curves, if any; see SetLaw().
    """

    def __init__(
        self, model: Model, *, names: Sequence[str], signals: int, parameters: bool = False
    ) -> None:
        """Makes the system for the cables of `model`, which has their constants, their actuators
        and the bodies. `names` are the cables' names, for errors. `signals` is the number m of
        signals, not the signals themselves."""
        super().__init__()
        self._names, own = names, model.cables.law
        counts = np.diff(model.cables.routes.first).clip(2) - 1
        self.pieces = [
            name if count == 1 else f"{name} {number}"
            for name, count in zip(names, counts.tolist(), strict=True)
            for number in range(1, count + 1)
        ]
        """Names of the straight pieces of the cables."""
        self._curve = own.curve
        # A copy, which a context may replace.
        self._constants = np.concatenate([*own[:-1], own.curve.rows.ravel()])
        law = _law_of(self._constants, self._curve)
        model = model._replace(cables=model.cables._replace(law=law))
        self._has_parameters, self._law = parameters, law
        self.warns = False
        """True if a force that pulls a slack cable is to be told."""
        if parameters:
            self.DeclareNumericParameter(BasicVector(self._constants))
        bodies, count = model.bodies.mass.size, model.cables.signal.size
        # The kernel writes to these arrays at every call.
        self._forces, self._force = Forces.of(model), np.empty(6 * bodies)
        parts, state = Packed((model, self._forces)), np.empty(13 * bodies)
        self._no_signals, self._ends = np.zeros(signals), model.cables.pieces
        self._compute_forces = machine_code(
            compute_cable_forces, parts, state, self._no_signals, self._force
        )
        self._state = self.DeclareVectorInputPort("state", state.size)
        motion = {self._state.ticket()}
        inputs = {*motion, self.all_parameters_ticket()}
        self._signals = self._drives = None
        if signals:
            self._signals = self.DeclareVectorInputPort("signals", signals)
            inputs.add(self._signals.ticket())
        drives = len(self._forces.drives)
        if drives:
            self._drives = self.DeclareVectorInputPort("drives", drives)
            inputs.add(self._drives.ticket())
            DeclareOutput(self, "drive_rates", drives, CableNetwork._drive_rates, inputs)
        self.DeclareVectorOutputPort("generalized_force", 6 * bodies, self._calc_force, inputs)
        size, table = self._forces.cable_forces.size, CableNetwork._table
        moved = functools.partial(table, moves_only=True)
        DeclareOutput(self, "tensions", count, lambda s, c: table(s, c)[:, cable.TENSION], inputs)
        DeclareOutput(self, "lengths", count, lambda s, c: moved(s, c)[:, cable.LENGTH], motion)
        DeclareOutput(self, "rates", count, lambda s, c: moved(s, c)[:, cable.RATE], motion)
        DeclareOutput(self, "cable_forces", size, table, inputs)
        size = 6 * len(self._ends)
        DeclareOutput(self, "ends", size, CableNetwork._ends_of_pieces, motion)

    def GetLaw(self, context: Context) -> cable.CableLaw:
        """Constants of the cables in a context of this system: a CableLaw of arrays (cables,), in
        the order of the cables. Raises InputError if they are no parameters."""
        check_parameters("GetLaw", self, context)
        return _law_of(context.get_numeric_parameter(0).CopyToVector(), self._curve)

    def SetLaw(self, context: Context, law: cable.CableLaw) -> None:
        """Replaces the constants of the cables in a context of this system.

        The states of actuators stay. Each number of `law` is an array (cables,), or one number for
        all cables; its curves are like the present ones, or the present ones stay. Raises
        InputError if the constants are no parameters, or one of them is negative or not finite.
        """
        check_parameters("SetLaw", self, context)
        check_type("SetLaw", "law", law, cable.CableLaw)
        count, own = len(self._names), self.GetLaw(context).curve
        check_type("SetLaw", "law.curve", law.curve, cable.Curve)
        curve = np.ravel(law.curve.rows if law.curve.pieces else own.rows)
        numbers = [
            numbers_for_each("SetLaw", key, getattr(law, key), count=count, least=0.0)
            for key in cable.NUMBERS
        ]
        numbers.append(numbers_for_each("SetLaw", "curve", curve, count=own.rows.size))
        context.get_mutable_numeric_parameter(0).SetFromVector(np.concatenate(numbers))

    def _table(self, context: Context, *, moves_only: bool = False) -> np.ndarray:
        """The numbers of the port `cable_forces` as a table (cables, 7). Also computes the
        generalized force.

        With `moves_only`, the inputs other than the state are not read: only lengths and rates are
        valid. Raises SimulationFailure if a number of a cable is not finite although the state is.
        """
        signals = self._no_signals
        if self._has_parameters:
            self._constants[:] = context.get_numeric_parameter(0).value()
        if self._drives is not None and not moves_only:
            self._forces.drives[:, actuator.DRIVE] = self._drives.Eval(context)
        if self._signals is not None and not moves_only:
            signals = self._signals.Eval(context)
        state, table = self._state.Eval(context), self._forces.cable_forces
        total = self._compute_forces(state, signals, self._force)
        if self.warns and not moves_only:
            self._warn(table)
        if math.isfinite(total) or not np.isfinite(state).all():
            return table
        place = int(np.argmin(np.isfinite(table).all(axis=1)))
        reason = f"the forces of cable '{self._names[place]}' are too large"
        raise SimulationFailure(time=context.get_time(), reason=reason)

    def _warn(self, table: np.ndarray) -> None:
        """Warns, once, of a signal that pulls a slack cable."""
        is_slack = table[:, cable.LENGTH] < self._law.free_length
        pulled = np.where(is_slack, table[:, cable.TENSION], 0.0)
        if pulled.any():
            most, self.warns = int(pulled.argmax()), False
            told = f"'{self._names[most]}' is slack, and its signal pulls with {pulled[most]:.3g} N"
            warnings.warn(f"{told}; see actuation of AddCables", RuntimeWarning, stacklevel=2)

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        self._table(context)
        output.SetFromVector(self._force)

    def _ends_of_pieces(self, context: Context) -> np.ndarray:
        self._table(context, moves_only=True)
        return self._forces.nodes[self._ends, kinematics.P_WN : kinematics.P_WN + 3]

    def _drive_rates(self, context: Context) -> np.ndarray:
        self._table(context)
        return self._forces.drives[:, actuator.RATE]


def _law_of(constants: np.ndarray, curve: cable.Curve) -> cable.CableLaw:
    """The parameters of a CableNetwork as a CableLaw of arrays (cables,), which share their
    memory, with a curve like `curve`."""
    numbers, rows = np.split(constants, [constants.size - curve.rows.size])
    fields = np.split(numbers, len(cable.NUMBERS))
    return cable.CableLaw._make([*fields, curve._replace(rows=rows.reshape(-1, 5))])


@dataclass(frozen=True)
class Cable:
    """Cable between the origins of two frames of a plant, straight or over rings."""

    name: str
    frame_a: Frame
    frame_b: Frame
    law: cable.CableLaw
    """Its constants in SI units."""
    rings: tuple[Frame, ...] = ()
    """Frames at whose origins the cable runs over rings, from a to b. Without friction, `law.mu`,
    it has one tension along its whole path."""

    @property
    def path(self) -> tuple[Frame, ...]:
        """Frames along the cable, from end a to end b."""
        return (self.frame_a, *self.rings, self.frame_b)


def AddCables(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    *,
    cables: Sequence[Cable],
    actuated: Mapping[str, Sequence[str]] | None = None,
    actuation: Actuation | None = None,
    drives: npt.ArrayLike | None = None,
    slack: bool = True,
    scene_graph: SceneGraph | None = None,
    parameters: bool = False,
    warns: bool = True,
    name: str = "cables",
) -> CableNetwork:
    """Adds cables between bodies of a plant, or from a body to the world.

    The plant must be finalized, may have any joints, and should be continuous. Connect the port
    `signals` of the returned system if cables are actuated.

    Args:
        builder: the builder that the plant was added to; the cables are added to it.
        plant: the plant whose bodies the cables pull.
        cables: the cables: names, ends and constants.
        actuated: for each signal, in the order of the signals, the names of the cables that it
            drives. The keys name the signals, in errors only. By default all cables are passive.
        actuation: kind of the actuators. Force(), the default, adds the signal to the tension, also
            of a slack cable: for cables that stay taut. Winch() winds and pays out, as if signals
            were lengths: for cables that are shortened. TensionMotor() is for commanded tensions.
            Kinds with states are added as the system NAME_actuators, which is Drake's Integrator of
            `drive_rates`.
        drives: states of the actuators at t = 0, in the order of the cables. By default those
            that fit signals of 0 at the plant's default positions.
        slack: False if cables also push.
        scene_graph: where to show the cables.
        parameters: True if the constants of the cables are parameters of the context, which
            CableNetwork.SetLaw() replaces. The forces then take a few microseconds more.
        warns: True for a RuntimeWarning when a Force first pulls a slack cable.
        name: name of the system.

    Raises:
        InputError: an argument is of a wrong type or size; a frame is of another plant; the ends of
            a cable are at one place at the plant's default positions; two cables or systems have
            one name; a constant is negative or not finite; `actuated` has an unknown cable.
    """
    actuated = {} if actuated is None else actuated
    actuation = Force() if actuation is None else actuation
    check_host("AddCables", builder, plant, name=name)
    _check_cables(plant, cables)
    check_type("AddCables", "actuated", actuated, Mapping)
    check_type("AddCables", "actuation", actuation, ActuatorKind)
    check_type("AddCables", "slack", slack, bool)
    check_type("AddCables", "parameters", parameters, bool)
    check_type("AddCables", "warns", warns, bool)
    pieces = _default_lengths(plant, cables)
    lengths = np.array([sum(of_pieces) for of_pieces in pieces])
    nodes = Nodes.of(plant, (frame for one in cables for frame in one.path))
    table = _cable_table(cables, actuated, nodes)
    rings = {
        place: [nodes.of_frame[ring.index()] for ring in one.rings]
        for place, one in enumerate(cables)
        if one.rings
    }
    driven = np.flatnonzero(table["signal"] != cable.PASSIVE)
    law, signals = cable.CableLaw.of(table[driven]), np.zeros(driven.size)
    default = actuation.drives(DrivenCables.at_rest(law, lengths[driven], signals))
    starts = default if drives is None else drives
    if np.size(starts) and not len(default):
        raise InputError("AddCables", "drives", f"found {drives!r:.60}, expected none")
    starts = numbers_for_each("AddCables", "drives", starts, count=len(default))
    names = [one.name for one in cables]
    if scene_graph is not None:
        check_part("AddCables", "scene_graph", builder, scene_graph, SceneGraph)
    model = Model.of_nodes(
        nodes.p_BN,
        nodes.first_node,
        cables=cable.Cables.of(table, rings),
        actuator=actuation.actuator(),
        slack=slack,
    )
    network = CableNetwork(model, names=names, signals=len(actuated), parameters=parameters)
    network.warns = warns and slack and not len(starts) and driven.size > 0
    AddNetwork(builder, plant, network, drives=starts, name=name)
    if scene_graph is not None and names:
        from tetra_drake.systems.cable_geometry import AddCableGeometry

        shown = dict(zip(network.pieces, itertools.chain.from_iterable(pieces), strict=True))
        AddCableGeometry(builder, scene_graph, network, shown)
    return network


def AddNetwork(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    network: CableNetwork,
    *,
    drives: np.ndarray,
    name: str = "cables",
) -> None:
    """Attaches a CableNetwork to a plant, and adds the integrator of its actuators, whose states at
    t = 0 are `drives`."""
    builder.AddNamedSystem(name, network)
    Attach(builder, plant, network)
    if len(drives):
        actuators = builder.AddNamedSystem(f"{name}_actuators", Integrator(drives))
        builder.Connect(network.GetOutputPort("drive_rates"), actuators.get_input_port())
        builder.Connect(actuators.get_output_port(), network.GetInputPort("drives"))


def _check_cables(plant: MultibodyPlant, cables: Sequence[Cable]) -> None:
    """Raises InputError unless the cables have different names, valid constants, and frames of this
    plant as their ends."""
    check_type("AddCables", "cables", cables, Sequence)
    for place, one in enumerate(cables):
        check_type("AddCables", f"cables[{place}]", one, Cable)
        check_type("AddCables", f"cables[{place}].name", one.name, str)
        key = f"cables.{one.name}"
        if any(one.name == earlier.name for earlier in cables[:place]):
            raise InputError("AddCables", key, "is given twice")
        check_type("AddCables", f"{key}.law", one.law, cable.CableLaw)
        check_constants("AddCables", key, dict(zip(cable.NUMBERS, one.law, strict=False)))
        check_type("AddCables", f"{key}.law.curve", one.law.curve, cable.Curve)
        for end in ("frame_a", "frame_b"):
            check_frame("AddCables", f"{key}.{end}", plant, getattr(one, end))
        check_type("AddCables", f"{key}.rings", one.rings, tuple, list)
        for number, ring in enumerate(one.rings):
            check_frame("AddCables", f"{key}.rings[{number}]", plant, ring)


def _cable_table(
    cables: Sequence[Cable], actuated: Mapping[str, Sequence[str]], nodes: Nodes
) -> np.ndarray:
    """Records (cables,) of laws.cable.cable_type(): nodes, signal and constants of each cable.

    `actuated` has the names of the cables that each signal drives; see AddCables().

    Raises InputError if `actuated` has an unknown cable, or a cable twice.
    """
    places = {one.name: place for place, one in enumerate(cables)}
    node_a = [nodes.of_frame[one.frame_a.index()] for one in cables]
    node_b = [nodes.of_frame[one.frame_b.index()] for one in cables]
    table = cable.CableLaw.put([one.law for one in cables], node_a, node_b)
    for signal, (group, driven) in enumerate(actuated.items()):
        key = f"actuated.{group}"
        check_type("AddCables", key, driven, list, tuple)
        for cable_name in driven:
            if cable_name not in places:
                problem = f"found unknown cable '{cable_name}'; {hint(cable_name, [*places])}"
                raise InputError("AddCables", key, problem)
            if table["signal"][places[cable_name]] != cable.PASSIVE:
                raise InputError("AddCables", key, f"cable '{cable_name}' has a signal already")
            table["signal"][places[cable_name]] = signal
    return table


def _default_lengths(plant: MultibodyPlant, cables: Sequence[Cable]) -> list[list[float]]:
    """Lengths in m of the straight pieces of each cable at the plant's default positions. Raises
    InputError if the ends of a piece are at one place."""
    context, lengths = plant.CreateDefaultContext(), []
    for one in cables:
        pieces = itertools.pairwise(one.path)
        offsets = [end.CalcPose(context, start).translation() for start, end in pieces]
        of_pieces: list[float] = np.linalg.norm(offsets, axis=1).tolist()
        lengths.append(of_pieces)
        if not all(cable.MEETING <= length < math.inf for length in of_pieces):
            problem = f"found a length of {min(of_pieces):.3g} m at the plant's default positions"
            raise InputError("AddCables", f"cables.{one.name}", f"{problem}, expected more")
    return lengths
