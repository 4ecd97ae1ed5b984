"""Display of cables in a SceneGraph."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.geometry import (
    Cylinder,
    FrameId,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    MakePhongIllustrationProperties,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort

from tetra_drake.robot.structure import PASSIVE_COLOUR

PIECES, SHARE = 4, 0.4
"""Number of the pieces of a shown cable, and their length as a share of the cable's at the start:
the pieces cover any length from SHARE to PIECES * SHARE times this."""
SLENDERNESS = 100.0
"""Length of the shortest cable divided by the shown radius of all."""


class CableGeometry(LeafSystem):
    """Poses of the pieces of cables in a SceneGraph. The system has no state.

    | port          | shape       | unit | meaning                                      |
    |---------------|-------------|------|----------------------------------------------|
    | ends          | (6 cables,) | m    | positions of the two ends, by cable          |
    | geometry_pose |             | SI   | FramePoseVector of all pieces, for the scene |

    A shape in a SceneGraph keeps its length. So a cable consists of pieces that slide along each
    other as a telescope's do.
    """

    def __init__(self, *, lengths: np.ndarray, frames: list[list[FrameId]]) -> None:
        """`lengths` (cables,) in m and `frames` are of the pieces of each cable."""
        super().__init__()
        self._lengths, self._frames = lengths, frames
        self._ends = self.DeclareVectorInputPort("ends", 6 * len(frames))
        self.DeclareAbstractOutputPort(
            "geometry_pose",
            lambda: AbstractValue.Make(FramePoseVector()),
            self._calc_poses,
            {self._ends.ticket()},
        )

    def _calc_poses(self, context: Context, output: AbstractValue) -> None:
        poses, ends = output.get_mutable_value(), self._ends.Eval(context).reshape(-1, 2, 3)
        for (p_WA, p_WB), length, frames in zip(ends, self._lengths, self._frames, strict=True):
            distance = np.linalg.norm(p_WB - p_WA)
            along = (p_WB - p_WA) / distance
            R_WC = RotationMatrix.MakeFromOneVector(along, 2)
            places = np.linspace(length / 2, distance - length / 2, PIECES)
            for frame, place in zip(frames, places, strict=True):
                poses.set_value(frame, RigidTransform(R_WC, p_WA + place * along))


def AddCableGeometry(
    builder: DiagramBuilder,
    scene_graph: SceneGraph,
    ends: OutputPort,
    *,
    lengths: Mapping[str, float],
) -> CableGeometry:
    """Shows cables in a SceneGraph. `ends` is a port of CableNetwork, `lengths` has the length (m)
    of each cable by its name at the start."""
    source = scene_graph.RegisterSource(ends.get_system().get_name())
    properties = MakePhongIllustrationProperties(PASSIVE_COLOUR)
    radius = min(lengths.values()) / SLENDERNESS
    frames: list[list[FrameId]] = []
    for name, length in lengths.items():
        frames.append([])
        for piece in range(PIECES):
            frame = scene_graph.RegisterFrame(source, GeometryFrame(f"{name} {piece}"))
            shape = Cylinder(radius, SHARE * length)
            shown = GeometryInstance(RigidTransform(), shape, f"{name} {piece}")
            shown.set_illustration_properties(properties)
            scene_graph.RegisterGeometry(source, frame, shown)
            frames[-1].append(frame)
    pieces = CableGeometry(lengths=SHARE * np.array(list(lengths.values())), frames=frames)
    geometry = builder.AddNamedSystem(f"{ends.get_system().get_name()}_geometry", pieces)
    builder.Connect(ends, geometry.get_input_port())
    builder.Connect(geometry.get_output_port(), scene_graph.get_source_pose_port(source))
    return pieces
