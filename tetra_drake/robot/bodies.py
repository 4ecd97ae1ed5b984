"""Rigid bodies: inertia of struts and nodes, poses of struts, bodies in a MultibodyPlant."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia, UnitInertia

from tetra_drake.scenario.blueprint import Blueprint

if TYPE_CHECKING:
    from tetra_drake.robot.structure import Structure

ROUNDING = 1e-12
"""Share of a body's size, or of its moments, below which a distance, or a product, is rounding. Its
last bits would break a robot's symmetry, and explicit schemes would amplify that."""


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


def body_inertias(blueprint: Blueprint) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Masses (bodies,), centres of mass in the frames F (bodies, 3), and unit inertias (bodies, 6)
    as in Structure, of struts, and of spheres and point masses at nodes."""
    nodes = blueprint.p_FN
    totals = [SpatialInertia.Zero() for _ in blueprint.bodies]
    for (a, b), radius, density in zip(
        blueprint.struts, blueprint.strut_radius, blueprint.strut_density, strict=True
    ):
        body = blueprint.carriers[a]
        totals[body] += strut_inertia(nodes[a], nodes[b], radius=radius, density=density)
    for node, (body, p_FN) in enumerate(zip(blueprint.carriers, nodes, strict=True)):
        radius, mass = blueprint.node_radius[node], blueprint.node_mass[node]
        if radius > 0.0:
            density = blueprint.node_density[node]
            totals[body] += node_inertia(p_FN, radius=radius, density=density)
        if mass > 0.0:
            totals[body] += SpatialInertia(mass, p_FN, UnitInertia.PointMass(p_FN))
    empty = np.array([total.get_mass() for total in totals])
    mass = empty + blueprint.payload  # which adds no inertia about the centre of mass
    centres, units = zip(*map(_central, totals), strict=True)
    return mass, np.array(centres), (empty / mass)[:, np.newaxis] * np.array(units)


def _central(M_BFo_F: SpatialInertia) -> tuple[np.ndarray, np.ndarray]:
    """The centre of mass (3,), and the unit inertia (6,) about it; rounding counts as 0."""
    centre, unit = M_BFo_F.get_com(), M_BFo_F.get_unit_inertia()
    size = np.sqrt(unit.get_moments().max())
    centre = np.where(np.abs(centre) > ROUNDING * size, centre, 0.0)
    if centre.any():
        unit = M_BFo_F.Shift(centre).get_unit_inertia()
    moments, products = unit.get_moments(), unit.get_products()
    products = np.where(np.abs(products) > ROUNDING * moments.max(), products, 0.0)
    return centre, np.concatenate([moments, products])


def AddBodies(plant: MultibodyPlant, structure: Structure) -> list[RigidBody]:
    """Adds the free bodies of a structure to a plant that is not finalized yet."""
    return [
        plant.AddRigidBody(name, SpatialInertia(mass, np.zeros(3), UnitInertia(*unit)))
        for name, mass, unit in zip(
            structure.bodies, structure.mass, structure.unit_inertia, strict=True
        )
    ]
