"""The tetrahedra as Drake bodies: poses of struts, inertia, free bodies in a MultibodyPlant."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia, UnitInertia

from tetra_drake.robot.structure import STRUTS, Structure


def strut_pose(structure: Structure, strut: tuple[int, int]) -> RigidTransform:
    """X_BS of a strut's frame: its origin in the middle, its z axis along the strut."""
    p_BA, p_BC = structure.p_BN[strut[0]], structure.p_BN[strut[1]]
    R_BS = RotationMatrix.MakeFromOneVector(p_BC - p_BA, 2)
    return RigidTransform(R_BS, (p_BA + p_BC) / 2)


def strut_inertia(structure: Structure, strut: tuple[int, int]) -> SpatialInertia:
    """Spatial inertia of one strut, a solid cylinder, about its middle, in the strut's frame."""
    p_AC = structure.p_BN[strut[1]] - structure.p_BN[strut[0]]
    return SpatialInertia.SolidCylinderWithDensity(
        density=structure.density,
        radius=structure.strut_radius,
        length=float(np.linalg.norm(p_AC)),
        unit_vector=[0.0, 0.0, 1.0],
    )


def node_inertia(structure: Structure) -> SpatialInertia:
    """Spatial inertia of the sphere at a node, about its centre."""
    return SpatialInertia.SolidSphereWithDensity(structure.density, structure.node_radius)


def tetrahedron_inertia(structure: Structure) -> SpatialInertia:
    """M_BBo_B: six struts and four spheres about the body's origin."""
    total = SpatialInertia.Zero()
    for strut in STRUTS:
        X_BS = strut_pose(structure, strut)
        M_SSo_B = strut_inertia(structure, strut).ReExpress(X_BS.rotation())
        total += M_SSo_B.Shift(-X_BS.translation())
    for p_BNi in structure.p_BN:
        total += node_inertia(structure).Shift(-p_BNi)
    # The sum is isotropic about Bo but for rounding, whose last bits would break the robot's
    # left-right symmetry and let explicit schemes amplify that up to their accuracy.
    unit = UnitInertia(*np.diag(total.get_unit_inertia().CopyToFullMatrix3()))
    return SpatialInertia(total.get_mass(), np.zeros(3), unit)


def AddTetrahedra(plant: MultibodyPlant, structure: Structure) -> list[RigidBody]:
    """Adds the free bodies T1 ... Tn to a plant that is not finalized yet."""
    inertia = tetrahedron_inertia(structure)
    return [plant.AddRigidBody(name, inertia) for name in structure.bodies]
