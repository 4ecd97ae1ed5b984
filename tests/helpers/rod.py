"""A rod on a hinge, which two tendons hold."""

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, RevoluteJoint, SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from tetra_drake.laws.cable import CableLaw
from tetra_drake.systems import AddFrame, Cable

MASS, LENGTH, GRAVITY = 0.5, 0.4, 9.81  # of a uniform rod on a hinge at the origin
LAW = CableLaw(stiffness=60.0, damping=8.0, free_length=0.0)
LEFT, RIGHT = np.array([-0.2, 0.0, 0.5]), np.array([0.6, 0.0, 0.3])  # anchors of two tendons

Arm = tuple[DiagramBuilder, MultibodyPlant, Frame, list[Cable]]


def rod_with_tendons(**constants: object) -> Arm:
    """A rod along x that turns about y, its free end, and two tendons to it from the world, by a
    law with other constants."""
    arm = unfinished_rod(**constants)
    arm[1].Finalize()
    return arm


def unfinished_rod(**constants: object) -> Arm:
    """The same in a plant that is not finalized."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(time_step=0.0))
    inertia = SpatialInertia.ThinRodWithMassAboutEnd(MASS, LENGTH, [1.0, 0.0, 0.0])
    rod = plant.AddRigidBody("rod", inertia)
    hinge = RevoluteJoint("hinge", plant.world_frame(), rod.body_frame(), [0.0, -1.0, 0.0])
    plant.AddJoint(hinge)
    tip = AddFrame(plant, "tip", rod.body_frame(), [LENGTH, 0.0, 0.0])
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -GRAVITY])
    places, law = {"left": LEFT, "right": RIGHT}, LAW._replace(**constants)
    anchors = [AddFrame(plant, name, plant.world_frame(), place) for name, place in places.items()]
    cables = [Cable(anchor.name(), anchor, tip, law) for anchor in anchors]
    return builder, plant, tip, cables
