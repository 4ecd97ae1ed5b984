"""Drake's own springs in place of cables, to compare with."""

from __future__ import annotations

from collections.abc import Iterable

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import LinearSpringDamper
from pydrake.systems.framework import DiagramBuilder

from tetra_drake.systems import Cable


def with_springs(builder: DiagramBuilder, plant: MultibodyPlant, cables: Iterable[Cable]) -> None:
    """Adds a LinearSpringDamper of Drake in place of each cable, and finalizes the plant."""
    for cable in cables:
        ends: list[object] = []
        for frame in (cable.frame_a, cable.frame_b):
            ends += [frame.body(), frame.GetFixedPoseInBodyFrame().translation()]
        law = [cable.law.free_length, cable.law.stiffness, cable.law.damping]
        plant.AddForceElement(LinearSpringDamper(*ends, *law))
    plant.Finalize()
