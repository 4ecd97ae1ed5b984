"""Rigid bodies: inertia of struts and nodes, poses of struts."""

from __future__ import annotations

import itertools
import math
from typing import TypeAlias

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import SpatialInertia, UnitInertia

from tetra_drake.scenario.blueprint import Blueprint, GivenInertia

ROUNDING = 1e-12
"""Threshold for rounding errors: smaller coordinates (relative to the size of a body) and products
of inertia (relative to its moments) become 0. Otherwise rounding errors would break the symmetry of
a robot, and explicit integrators would amplify them."""


POINT_RADIUS = 0.01
"""Radius (m) of a ball whose rotational inertia is used for a point mass without struts. Nothing
turns such a body, and its rotation moves nothing."""


def strut_pose(p_BA: np.ndarray, p_BC: np.ndarray) -> RigidTransform:
    """Pose X_BS of a strut in frame B, from its ends A and C at p_BA and p_BC (3,) in m. The origin
    of S is in the middle of the strut; its z axis points from A to C."""
    return RigidTransform(RotationMatrix.MakeFromOneVector(p_BC - p_BA, 2), (p_BA + p_BC) / 2)


def body_inertias(blueprint: Blueprint) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Inertia of the bodies of a blueprint.

    Returns masses (bodies,) in kg, centres of mass (bodies, 3) in m in the blueprint's body frames
    F, and unit inertias (bodies, 6) in m²: xx, yy, zz, xy, xz, yz about the centre of mass, divided
    by the mass.
    """
    made: dict[tuple[bytes, ...], Inertia] = {}  # equal bodies share one
    inertias = []
    node_a = blueprint.struts[:, 0]
    for body, (first, end) in enumerate(itertools.pairwise(blueprint.first_node.tolist())):
        nodes, struts = slice(first, end), (first <= node_a) & (node_a < end)
        parts = (
            blueprint.p_FN[nodes],
            blueprint.struts[struts] - first,
            blueprint.strut_radius[struts],
            blueprint.strut_density[struts],
            blueprint.node_radius[nodes],
            blueprint.node_density[nodes],
            blueprint.node_mass[nodes],
        )
        key = tuple(part.tobytes() for part in parts)
        if key not in made:
            made[key] = _body_inertia(*parts)
        given = blueprint.given_inertia.get(body)
        inertias.append(_replaced(made[key], given) if given else made[key])
    masses, centres, units = (np.array(values) for values in zip(*inertias, strict=True))
    mass = masses + blueprint.payload  # a point mass at the centre of mass
    return mass, centres, (masses / mass)[:, np.newaxis] * units


Inertia: TypeAlias = tuple[float, np.ndarray, np.ndarray]
"""Mass, centre of mass (3,), and unit inertia (6,) about it."""


def _replaced(parts: Inertia, given: GivenInertia) -> Inertia:
    """Inertia of a body that follows from its parts, with what is given in its place. The inertia
    about the centre of mass is proportional to the mass unless it is given."""
    mass, centre, unit = parts
    mass = mass if given.mass is None else given.mass
    centre = centre if given.centre is None else given.centre
    return mass, centre, unit if given.inertia is None else given.inertia / mass


def _body_inertia(
    p_FN: np.ndarray,
    struts: np.ndarray,
    strut_radius: np.ndarray,
    strut_density: np.ndarray,
    node_radius: np.ndarray,
    node_density: np.ndarray,
    node_mass: np.ndarray,
) -> Inertia:
    """Inertia of one body: of its struts (solid cylinders), and of spheres and point masses at its
    nodes. Numbers that are rounding errors become 0.

    All arguments are in SI units. `p_FN` (nodes, 3) are the positions of the body's nodes, and
    `struts` (struts, 2) the indices of the two nodes of each strut in it.
    """
    total, along = SpatialInertia.Zero(), [0.0, 0.0, 1.0]
    for (a, b), radius, density in zip(struts, strut_radius, strut_density, strict=True):
        if density > 0.0:
            X_FS, length = strut_pose(p_FN[a], p_FN[b]), math.dist(p_FN[a], p_FN[b])
            M_SSo_S = SpatialInertia.SolidCylinderWithDensity(density, radius, length, along)
            total += M_SSo_S.ReExpress(X_FS.rotation()).Shift(-X_FS.translation())
    for p, radius, density, mass in zip(p_FN, node_radius, node_density, node_mass, strict=True):
        if radius > 0.0 and density > 0.0:
            total += SpatialInertia.SolidSphereWithDensity(density, radius).Shift(-p)
        if mass > 0.0 and len(struts):
            total += SpatialInertia(mass, p, UnitInertia.PointMass(p))
        elif mass > 0.0:
            total += SpatialInertia.SolidSphereWithMass(mass, radius or POINT_RADIUS).Shift(-p)

    centre, unit = total.get_com(), total.get_unit_inertia()
    size = np.sqrt(unit.get_moments().max())
    centre = np.where(np.abs(centre) > ROUNDING * size, centre, 0.0)
    if centre.any():
        unit = total.Shift(centre).get_unit_inertia()
    moments, products = unit.get_moments(), unit.get_products()
    products = np.where(np.abs(products) > ROUNDING * moments.max(), products, 0.0)
    return total.get_mass(), centre, np.concatenate([moments, products])
