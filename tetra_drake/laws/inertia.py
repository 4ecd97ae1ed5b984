"""Inertia of bodies whose moments of inertia differ between axes (bodies that are not isotropic).

An *inertia* is a row of a table (bodies, 6): moments and products xx, yy, zz, xy, xz, yz of a body
about its centre of mass. Angular momentum is inertia times angular velocity.
"""

from __future__ import annotations

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Table
from tetra_drake.laws.kinematics import rotation
from tetra_drake.laws.vectors import Vector3, dot

XX, YY, ZZ, XY, XZ, YZ, INERTIA_COLUMNS = range(7)
"""Columns of an inertia, and their number."""


@inlined
def turn_inertia(state: Table, inertia_B: Table, inertia_W: Table) -> None:
    """Writes the inertia of the bodies along the world's axes to `inertia_W`, from `inertia_B`
    along their own axes, both (bodies, 6), for a state [q; v] (13*bodies,)."""
    for body in range(inertia_B.shape[0]):
        x, y, z = rotation(state, body)
        # R I, row by row, then (R I) Rᵀ.
        i_x = times_inertia(inertia_B, body, x)
        i_y = times_inertia(inertia_B, body, y)
        i_z = times_inertia(inertia_B, body, z)
        inertia_W[body, XX] = dot(i_x, x)
        inertia_W[body, YY] = dot(i_y, y)
        inertia_W[body, ZZ] = dot(i_z, z)
        inertia_W[body, XY] = dot(i_x, y)
        inertia_W[body, XZ] = dot(i_x, z)
        inertia_W[body, YZ] = dot(i_y, z)


@inlined
def times_inertia(inertia: Table, body: int, a: Vector3) -> Vector3:
    """Inertia of a body times a vector, both in the same frame. `inertia` (bodies, 6) has the
    inertias of all bodies."""
    xx, yy, zz = inertia[body, XX], inertia[body, YY], inertia[body, ZZ]
    xy, xz, yz = inertia[body, XY], inertia[body, XZ], inertia[body, YZ]
    return dot((xx, xy, xz), a), dot((xy, yy, yz), a), dot((xz, yz, zz), a)


@inlined
def over_inertia(inertia: Table, body: int, a: Vector3) -> Vector3:
    """Inverse of a body's inertia times a vector, both in the same frame. For a torque, it is the
    angular acceleration. `inertia` (bodies, 6) has the inertias of all bodies."""
    xx, yy, zz = inertia[body, XX], inertia[body, YY], inertia[body, ZZ]
    xy, xz, yz = inertia[body, XY], inertia[body, XZ], inertia[body, YZ]
    # The inverse of a 3 x 3 matrix, by its cofactors.
    c_xx, c_yy, c_zz = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    c_xy, c_xz, c_yz = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - yz * xx
    per_determinant = 1.0 / dot((xx, xy, xz), (c_xx, c_xy, c_xz))
    return (
        per_determinant * dot((c_xx, c_xy, c_xz), a),
        per_determinant * dot((c_xy, c_yy, c_yz), a),
        per_determinant * dot((c_xz, c_yz, c_zz), a),
    )
