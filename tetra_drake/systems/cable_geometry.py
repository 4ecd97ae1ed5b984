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
from pydrake.systems.framework import Context, LeafSystem

from tetra_drake.robot.structure import PASSIVE_COLOUR

PIECES, SHARE = 4, 0.4
"""Number of cylinders that show a cable, and their length divided by the cable's length at the
start. They cover any length from SHARE to PIECES * SHARE times the length at the start."""
SLENDERNESS = 100.0
"""Length of the shortest cable divided by the radius with which all cables are shown."""


class CableGeometry(LeafSystem):
    """Poses of the cylinders that show cables in a SceneGraph. The system has no state.

    | port          | shape       | unit | meaning                                      |
    |---------------|-------------|------|----------------------------------------------|
    | ends          | (6*pieces,) | m    | per piece: position of start, then of end    |
    | geometry_pose |             | SI   | FramePoseVector of all cylinders             |

    A shape in a SceneGraph keeps its length. So each straight piece of a cable is shown by PIECES
    cylinders, which slide along each other like the tubes of a telescope.
    """

    def __init__(self, scene_graph: SceneGraph, name: str, *, lengths: Mapping[str, float]) -> None:
        """Registers the cylinders in a scene, with a source called `name`. `lengths` has the length
        (m) of each straight piece of a cable at the start, by its name."""
        super().__init__()
        self.source = scene_graph.RegisterSource(name)
        """Identifier of the source of the cylinders in the scene."""
        self._pieces: list[tuple[float, list[FrameId]]] = []
        """Length (m) and frames of the cylinders of each cable."""
        properties = MakePhongIllustrationProperties(PASSIVE_COLOUR)
        radius = min(lengths.values()) / SLENDERNESS
        for cable, length in lengths.items():
            frames = []
            for piece in (f"{cable} {i}" for i in range(PIECES)):
                frame = scene_graph.RegisterFrame(self.source, GeometryFrame(piece))
                shown = GeometryInstance(RigidTransform(), Cylinder(radius, SHARE * length), piece)
                shown.set_illustration_properties(properties)
                scene_graph.RegisterGeometry(self.source, frame, shown)
                frames.append(frame)
            self._pieces.append((SHARE * length, frames))
        self._ends = self.DeclareVectorInputPort("ends", 6 * len(lengths))
        self.DeclareAbstractOutputPort(
            "geometry_pose",
            lambda: AbstractValue.Make(FramePoseVector()),
            self._calc_poses,
            {self._ends.ticket()},
        )

    def _calc_poses(self, context: Context, output: AbstractValue) -> None:
        poses, ends = output.get_mutable_value(), self._ends.Eval(context).reshape(-1, 2, 3)
        for (p_WA, p_WB), (length, frames) in zip(ends, self._pieces, strict=True):
            distance = np.linalg.norm(p_WB - p_WA)
            along = (p_WB - p_WA) / distance
            R_WC = RotationMatrix.MakeFromOneVector(along, 2)
            places = np.linspace(length / 2, distance - length / 2, PIECES)
            for frame, place in zip(frames, places, strict=True):
                poses.set_value(frame, RigidTransform(R_WC, p_WA + place * along))
