"""Attachment of forces to the bodies of a MultibodyPlant with any joints.

Attached systems, such as CableNetwork, take the state of all bodies as if these were free, and give
a torque and a force on each. If the bodies are free, these are the plant's own state and
generalized force; otherwise BodyStates_ and BodyForces_ translate.
"""

from __future__ import annotations

import contextlib
import math
import numbers
import weakref
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np
import numpy.typing as npt
from pydrake.autodiffutils import AutoDiffXd
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform_
from pydrake.multibody.math import SpatialForce_, SpatialVelocity_
from pydrake.multibody.plant import (
    ExternallyAppliedSpatialForce_,
    ExternallyAppliedSpatialForceMultiplexer,
    MultibodyPlant,
)
from pydrake.multibody.tree import BodyIndex, Frame, FrameIndex, RigidBody
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DependencyTicket,
    DiagramBuilder,
    LeafSystem,
    LeafSystem_,
    System,
    SystemScalarConverter,
)
from pydrake.systems.primitives import Adder
from pydrake.systems.scalar_conversion import TemplateSystem

from tetra_drake.errors import InputError, check_type
from tetra_drake.laws.model import WORLD

SystemT = TypeVar("SystemT", bound=LeafSystem)


def DeclareOutput(
    system: SystemT,
    name: str,
    size: int,
    read: Callable[[SystemT, Context], np.ndarray],
    sources: set[DependencyTicket],
) -> None:
    """Declares a vector output port of a system, without keeping the system alive.

    The port has `size` numbers. `read`, given the system and a context, computes them; an array is
    flattened row by row. `sources` are the tickets of all that the values depend on.
    """
    # A reference to the system in its port would keep it alive for ever.
    this: Any = weakref.proxy(system)
    system.DeclareVectorOutputPort(
        name,
        size,
        lambda context, output: output.SetFromVector(np.ravel(read(this, context))),
        sources,
    )


class Nodes(NamedTuple):
    """Points (nodes) at the origins of frames of a plant, as arrays that kernels read."""

    p_BN: np.ndarray
    """Positions (nodes, 3) in the frames of the bodies, in the order of the bodies; then positions
    of the world's nodes."""
    first_node: np.ndarray
    """Index of each body's first node (bodies + 1,); the last number is the index of the world's
    first node. Bodies are numbered as in the plant, without the world."""
    carriers: np.ndarray
    """Index of the body of each node (nodes,); WORLD for the world."""
    of_frame: dict[FrameIndex, int]
    """Index of the node at each frame."""

    @classmethod
    def of(cls, plant: MultibodyPlant, frames: Iterable[Frame]) -> Self:
        """The nodes at the origins of frames of a finalized plant. A frame that occurs several
        times gets one node."""
        # The world is a plant's first body, and its nodes are the last ones.
        places = {}
        for frame in frames:
            body = int(frame.body().index()) + WORLD
            places[body == WORLD, body, int(frame.index())] = frame
        ordered = [places[place] for place in sorted(places)]
        carriers = np.array([body for _, body, _ in sorted(places)], dtype=np.int64)
        counts = np.bincount(carriers[carriers != WORLD], minlength=plant.num_bodies() - 1)
        p_BN = [frame.GetFixedPoseInBodyFrame().translation() for frame in ordered]
        return cls(
            p_BN=np.array(p_BN).reshape(-1, 3),
            first_node=np.append(0, np.cumsum(counts)),
            carriers=carriers,
            of_frame={frame.index(): node for node, frame in enumerate(ordered)},
        )


@TemplateSystem.define("BodyStates_", T_list=[float, AutoDiffXd])
def BodyStates_(T: type) -> type:
    """State of the bodies of a plant, as if they were free; a class for each type of scalars."""

    class Impl(LeafSystem_[T]):
        """State of the n bodies of a plant other than the world, as if they were free. The system
        has no state.

        | port               | in, out | shape    | unit | meaning                                 |
        |--------------------|---------|----------|------|-----------------------------------------|
        | body_poses         | in      | abstract | SI   | list of poses X_WB, from the plant      |
        | spatial_velocities | in      | abstract | SI   | list of velocities V_WB, from the plant |
        | state              | out     | (13*n,)  | SI   | [q; v] of the bodies                    |

        As for free bodies in Drake, q has a quaternion (w first) and a position per body, and v an
        angular and a linear velocity in the world frame.
        """

        def _construct(self, bodies: int, *, converter: SystemScalarConverter) -> None:
            LeafSystem_[T].__init__(self, converter)
            self._bodies = bodies
            poses = AbstractValue.Make([RigidTransform_[T]()])
            velocities = AbstractValue.Make([SpatialVelocity_[T]()])
            self._poses = self.DeclareAbstractInputPort("body_poses", poses)
            self._velocities = self.DeclareAbstractInputPort("spatial_velocities", velocities)
            sources = {self._poses.ticket(), self._velocities.ticket()}
            self.DeclareVectorOutputPort("state", 13 * bodies, self._calc_state, sources)

        def _construct_copy(self, other: Any, *, converter: SystemScalarConverter) -> None:
            Impl._construct(self, other._bodies, converter=converter)

        def _calc_state(self, context: Context, output: BasicVector) -> None:
            poses, velocities = self._poses.Eval(context)[1:], self._velocities.Eval(context)[1:]
            q = [[*X_WB.rotation().ToQuaternion().wxyz(), *X_WB.translation()] for X_WB in poses]
            v = [V_WB.get_coeffs() for V_WB in velocities]
            output.SetFromVector(np.concatenate([np.ravel(q), np.ravel(v)]))

    return Impl


@TemplateSystem.define("BodyForces_", T_list=[float, AutoDiffXd])
def BodyForces_(T: type) -> type:
    """Forces on the bodies of a plant, as a list that the plant reads; a class for each type of
    scalars."""
    Applied, Wrench = ExternallyAppliedSpatialForce_[T], SpatialForce_[T]
    differentiates = T is AutoDiffXd

    class Impl(LeafSystem_[T]):
        """Forces on the n bodies of a plant other than the world, as a list that the plant reads.
        The system has no state.

        | port              | in, out | shape    | unit   | meaning                                |
        |-------------------|---------|----------|--------|----------------------------------------|
        | generalized_force | in      | (6*n,)   | N m, N | [t_W; f_W] at the origin of each body  |
        | spatial_forces    | out     | abstract | N m, N | list of ExternallyAppliedSpatialForce; |
        |                   |         |          |        | zeros only where they have derivatives |
        """

        def _construct(self, bodies: int, *, converter: SystemScalarConverter) -> None:
            LeafSystem_[T].__init__(self, converter)
            self._bodies = bodies
            self._force = self.DeclareVectorInputPort("generalized_force", 6 * bodies)
            self.DeclareAbstractOutputPort(
                "spatial_forces",
                lambda: AbstractValue.Make([Applied()]),
                self._calc_forces,
                {self._force.ticket()},
            )

        def _construct_copy(self, other: Any, *, converter: SystemScalarConverter) -> None:
            Impl._construct(self, other._bodies, converter=converter)

        def _calc_forces(self, context: Context, output: AbstractValue) -> None:
            forces, acting = self._force.Eval(context).reshape(-1, 6), []
            bodies = range(len(forces)) if differentiates else np.flatnonzero(forces.any(axis=1))
            for body in map(int, bodies):
                applied = Applied()
                if differentiates:  # the default is no number, unlike the one for floats
                    applied.p_BoBq_B = np.zeros(3)  # at the body's origin
                applied.body_index = BodyIndex(body - WORLD)
                applied.F_Bq_W = Wrench(forces[body])
                acting.append(applied)
            output.set_value(acting)

    return Impl


def numbers_for_each(
    source: str, key: str, given: npt.ArrayLike, *, count: int, least: float = -math.inf
) -> np.ndarray:
    """Array (count,) from an argument that is one number for all entries, or has a number for each.

    Raises InputError unless the numbers are finite and at least `least`. Its message names
    `source`, the class or function, and `key`, the argument.
    """
    found = np.full(count, np.nan)
    with contextlib.suppress(TypeError, ValueError):
        found[:] = given
    if not (np.isfinite(found) & (found >= least)).all():
        bound = "" if least == -math.inf else f" of {least:g} or more"
        expected = f"expected a number{bound}, or {count} of them"
        raise InputError(source, key, f"found {given!r:.60}, {expected}")
    return found


def check_constants(source: str, key: str, constants: Mapping[str, Any]) -> None:
    """Raises InputError unless the constants of a law, by their names, are finite numbers of 0 or
    more. Its message names `source`, the function, `key`, the argument, and the constant."""
    for name, value in constants.items():
        if not (isinstance(value, numbers.Real) and 0.0 <= float(value) < math.inf):
            problem = f"found {value!r:.60}, expected a number of 0 or more"
            raise InputError(source, f"{key}.{name}", problem)


def check_parameters(source: str, system: LeafSystem, context: Context) -> None:
    """Raises InputError unless a context is of this system, and the system has parameters. Its
    message names `source`, the method."""
    check_type(source, "context", context, Context)
    try:
        system.ValidateContext(context)
    except RuntimeError as error:
        problem = f"is of another system; see {type(system).__name__}.GetMyMutableContextFromRoot()"
        raise InputError(source, "context", problem) from error
    if not context.num_numeric_parameter_groups():
        raise InputError(source, "context", "has no constants; add the system with parameters=True")


def check_host(source: str, builder: DiagramBuilder, plant: MultibodyPlant, *, name: str) -> None:
    """Raises InputError unless a system called `name` can be attached to a plant of the builder.

    The builder must not have built its diagram, the name must be free, and the plant must be
    finalized and have a mass matrix that can be inverted. The message names `source`, the function.
    """
    check_type(source, "builder", builder, DiagramBuilder)
    check_type(source, "name", name, str)
    if builder.already_built():
        raise InputError(source, "builder", "has built its diagram already")
    check_part(source, "plant", builder, plant, MultibodyPlant)
    if not plant.is_finalized():
        raise InputError(source, "plant", "is not finalized; call plant.Finalize() first")
    for taken in (name, f"{name}_actuators", f"{name}_geometry", f"forces_of_{name}"):
        if not name or builder.HasSubsystemNamed(taken):
            raise InputError(source, "name", f"found '{name}', which is empty or taken")
    try:
        np.linalg.cholesky(plant.CalcMassMatrix(plant.CreateDefaultContext()))
    except np.linalg.LinAlgError as error:
        light = ", ".join(one.name() for one in _bodies(plant) if not one.default_mass() > 0.0)
        problem = "has a body that moves without mass or moments of inertia"
        raise InputError(source, "plant", f"{problem}: {light}".removesuffix(": ")) from error


def check_part(
    source: str, key: str, builder: DiagramBuilder, system: System, kind: type[System]
) -> None:
    """Raises InputError unless a system has the class `kind` and was added to the builder. Its
    message names `source`, the function, and `key`, the argument."""
    check_type(source, key, system, kind)
    if not any(part is system for part in builder.GetSystems()):
        raise InputError(source, key, "is no system of the builder; add it first")


def check_frame(source: str, key: str, plant: MultibodyPlant, frame: Frame) -> None:
    """Raises InputError unless a frame is in the plant, at a finite position. Its message names
    `source`, the function, and `key`, the argument."""
    check_type(source, key, frame, Frame)
    if frame.GetParentPlant() is not plant:
        raise InputError(source, key, f"found frame '{frame.name()}' of another plant")
    if not np.isfinite(frame.GetFixedPoseInBodyFrame().translation()).all():
        raise InputError(source, key, f"found frame '{frame.name()}' at a place that is not finite")


def Attach(builder: DiagramBuilder, plant: MultibodyPlant, system: System) -> None:
    """Connects a system that exerts forces to a plant: its input port `state` (13*n,) and its
    output port `generalized_force` (6*n,), for the plant's n bodies other than the world.

    Its force is added to the forces of all systems that were connected to the plant before. The
    plant must be finalized.
    """
    name, source = system.get_name(), system.GetOutputPort("generalized_force")
    count = plant.num_bodies() - 1
    has_free_bodies = all(
        body.is_floating_base_body()
        and body.has_quaternion_dofs()
        and body.floating_positions_start() == 7 * number
        for number, body in enumerate(_bodies(plant))
    )
    adder: System
    if has_free_bodies:  # in the order of the state
        state = plant.get_state_output_port()
        port, adder = plant.get_applied_generalized_force_input_port(), Adder(2, source.size())
    else:
        bodies = f"bodies_of_{plant.get_name()}"
        if not builder.HasSubsystemNamed(bodies):
            states = builder.AddNamedSystem(bodies, BodyStates_[float](count))
            builder.Connect(plant.get_body_poses_output_port(), states.get_input_port(0))
            velocities = plant.get_body_spatial_velocities_output_port()
            builder.Connect(velocities, states.get_input_port(1))
        state = builder.GetSubsystemByName(bodies).get_output_port()
        forces = builder.AddNamedSystem(f"forces_of_{name}", BodyForces_[float](count))
        builder.Connect(source, forces.get_input_port())
        source, port = forces.get_output_port(), plant.get_applied_spatial_force_input_port()
        adder = ExternallyAppliedSpatialForceMultiplexer(2)
    builder.Connect(state, system.GetInputPort("state"))

    earlier = builder.connection_map().get((port.get_system(), port.get_index()))
    if earlier is not None:
        before = earlier[0].get_output_port(earlier[1])
        builder.Disconnect(before, port)
        is_first = not builder.HasSubsystemNamed("forces")
        builder.AddNamedSystem("forces" if is_first else f"forces_with_{name}", adder)
        builder.Connect(before, adder.get_input_port(0))
        builder.Connect(source, adder.get_input_port(1))
        source = adder.get_output_port()
    builder.Connect(source, port)


def _bodies(plant: MultibodyPlant) -> list[RigidBody]:
    return [plant.get_body(BodyIndex(i)) for i in range(1, plant.num_bodies())]
