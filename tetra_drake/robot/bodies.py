"""Rigid bodies: inertia of struts and nodes, poses of struts, bodies in a MultibodyPlant."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia, UnitInertia

from tetra_drake.robot.structure import Structure


def strut_pose(p_BA: np.ndarray, p_BC: np.ndarray) -> RigidTransform:
    """X_BS of the frame of a strut from A to C: its origin in the middle, its z axis along it."""
    return RigidTransform(RotationMatrix.MakeFromOneVector(p_BC - p_BA, 2), (p_BA + p_BC) / 2)


def strut_inertia(
    p_BA: np.ndarray, p_BC: np.ndarray, *, radius: float, density: float
) -> SpatialInertia:
    """M_SBo_B of a strut from A to C, a solid cylinder."""
    X_BS = strut_pose(p_BA, p_BC)
    M_SSo_S = SpatialInertia.SolidCylinderWithDensity(
        density=density,
        radius=radius,
        length=float(np.linalg.norm(p_BC - p_BA)),
        unit_vector=[0.0, 0.0, 1.0],
    )
    return M_SSo_S.ReExpress(X_BS.rotation()).Shift(-X_BS.translation())


def node_inertia(p_BN: np.ndarray, *, radius: float, density: float) -> SpatialInertia:
    """M_NBo_B of the sphere at a node."""
    return SpatialInertia.SolidSphereWithDensity(density, radius).Shift(-p_BN)


def AddBodies(plant: MultibodyPlant, structure: Structure) -> list[RigidBody]:
    """Adds the free bodies of a structure to a plant that is not finalized yet."""
    return [
        plant.AddRigidBody(name, SpatialInertia(mass, np.zeros(3), UnitInertia(*unit)))
        for name, mass, unit in zip(
            structure.bodies, structure.mass, structure.unit_inertia, strict=True
        )
    ]
