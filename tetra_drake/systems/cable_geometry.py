"""Display of cables in a SceneGraph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractValue
from pydrake.common.value import AbstractValue
from pydrake.geometry import (
    Cylinder,
    FrameId,
    FramePoseVector_,
    GeometryFrame,
    GeometryInstance,
    MakePhongIllustrationProperties,
    SceneGraph,
    SourceId,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import (
    Context,
    DiagramBuilder,
    LeafSystem_,
    System,
    SystemScalarConverter,
)
from pydrake.systems.scalar_conversion import TemplateSystem

from tetra_drake.robot.structure import PASSIVE_COLOUR

PIECES, SHARE = 4, 0.4
"""Number of cylinders that show a cable, and their length divided by the cable's length at the
start. They cover any length from SHARE to PIECES * SHARE times the length at the start."""
SLENDERNESS = 100.0
"""Length of the shortest cable divided by the radius with which all cables are shown."""


@TemplateSystem.define("CableGeometry_", T_list=[float, AutoDiffXd])
def CableGeometry_(T: type) -> type:
    """Poses of the cylinders that show cables in a SceneGraph; a class for each type of scalars."""

    class Impl(LeafSystem_[T]):
        """Poses of the cylinders that show cables in a SceneGraph. The system has no state.

        | port          | in, out | shape       | unit | meaning                                   |
        |---------------|---------|-------------|------|-------------------------------------------|
        | ends          | in      | (6*pieces,) | m    | per piece: position of start, then of end |
        | geometry_pose | out     |             | SI   | FramePoseVector of all cylinders, without |
        |               |         |             |      | derivatives                               |

        A shape in a SceneGraph keeps its length. So each straight piece of a cable is shown by
        PIECES cylinders, which slide along each other like the tubes of a telescope.
        """

        def _construct(
            self, cylinders: Sequence[Cylinders], *, converter: SystemScalarConverter
        ) -> None:
            """`cylinders` are of each straight piece, from RegisterCylinders()."""
            LeafSystem_[T].__init__(self, converter)
            self._cylinders = cylinders
            self._ends = self.DeclareVectorInputPort("ends", 6 * len(cylinders))
            self.DeclareAbstractOutputPort(
                "geometry_pose",
                lambda: AbstractValue.Make(FramePoseVector_[T]()),
                self._calc_poses,
                {self._ends.ticket()},
            )

        def _construct_copy(self, other: Any, *, converter: SystemScalarConverter) -> None:
            Impl._construct(self, other._cylinders, converter=converter)

        def _calc_poses(self, context: Context, output: AbstractValue) -> None:
            poses, ends = output.get_mutable_value(), self._ends.Eval(context)
            ends = (ends if T is float else ExtractValue(ends)).reshape(-1, 2, 3)
            for (p_WA, p_WB), (length, frames) in zip(ends, self._cylinders, strict=True):
                distance = np.linalg.norm(p_WB - p_WA)
                along = (p_WB - p_WA) / distance
                R_WC = RotationMatrix.MakeFromOneVector(along, 2)
                places = np.linspace(length / 2, distance - length / 2, PIECES)
                for frame, place in zip(frames, places, strict=True):
                    X_WC = RigidTransform(R_WC, p_WA + place * along)
                    poses.set_value(frame, X_WC if T is float else X_WC.cast[T]())

    return Impl


class Cylinders(NamedTuple):
    """Cylinders that show a straight piece of a cable."""

    length: float
    """Length (m) of each cylinder."""
    frames: list[FrameId]


def AddCableGeometry(
    builder: DiagramBuilder, scene_graph: SceneGraph, cables: System, lengths: Mapping[str, float]
) -> None:
    """Shows the cables of a CableNetwork in a scene. `lengths` has the length (m) of each of its
    `pieces` at the start."""
    source = scene_graph.RegisterSource(cables.get_name())
    cylinders = RegisterCylinders(scene_graph, source, lengths=lengths)
    name = f"{cables.get_name()}_geometry"
    shown = builder.AddNamedSystem(name, CableGeometry_[float](cylinders))
    builder.Connect(cables.GetOutputPort("ends"), shown.get_input_port())
    builder.Connect(shown.get_output_port(), scene_graph.get_source_pose_port(source))


def RegisterCylinders(
    scene_graph: SceneGraph, source: SourceId, *, lengths: Mapping[str, float]
) -> list[Cylinders]:
    """Registers the cylinders that show the straight pieces of cables in a scene. `lengths` has the
    length (m) of each piece at the start, by its name."""
    properties = MakePhongIllustrationProperties(PASSIVE_COLOUR)
    radius, registered = min(lengths.values()) / SLENDERNESS, []
    for cable, length in lengths.items():
        frames = []
        for piece in (f"{cable} {i}" for i in range(PIECES)):
            frame = scene_graph.RegisterFrame(source, GeometryFrame(piece))
            shown = GeometryInstance(RigidTransform(), Cylinder(radius, SHARE * length), piece)
            shown.set_illustration_properties(properties)
            scene_graph.RegisterGeometry(source, frame, shown)
            frames.append(frame)
        registered.append(Cylinders(SHARE * length, frames))
    return registered
