"""Surface of the ground, z = h(x, y), and its tangent frame at a node.

The surface is a uniform biquadratic B-spline. Its control points are a regular grid of heights. The
gradient is continuous, a plane is exact, and no point is higher than the highest control point. An
edge is rounded over one cell. Beyond the grid the surface continues with the height at the border.

A *frame* is a row of the table `frames`. It has the distance of a node from the surface, positive
above it, and the axes of the tangent plane: normal n, t1 (the world's x axis projected into the
plane), and t2 = n x t1. On flat ground the axes are the world's, and `frames` is not used.
"""

from __future__ import annotations

from typing import NamedTuple

from tetra_drake.kernels.compiling import compiled, inlined
from tetra_drake.kernels.lanes import (
    Real,
    Table,
    any_lane,
    floor,
    gather,
    inverse_sqrt,
    maximum,
    minimum,
    select,
)
from tetra_drake.laws.kinematics import P_WN
from tetra_drake.laws.vectors import Vector, put_vector

GAP, N_X, N_Y, N_Z, T1_X, T1_Y, T1_Z, T2_Y, T2_Z, FRAME_COLUMNS = range(10)
"""Columns of the table `frames` (contacts, 9), and their number: distance (m), n, t1, and t2
without its x, which is 0."""


class SurfaceGrid(NamedTuple):
    """Grid of a surface's control points; SI units."""

    corner_x: Real
    """Coordinate x of the first control point."""
    corner_y: Real
    """Coordinate y of the first control point."""
    per_cell_x: Real
    per_cell_y: Real
    last_row: Real
    """Largest coordinate along x, in cells, that has three rows of control points around it."""
    last_column: Real
    """Largest coordinate along y, in cells, that has three columns of control points around it."""
    columns: Real
    """Number of control points per row."""
    first: Real
    """Index of the first control point in the heights."""
    top: Real
    """Height of the highest control point."""
    reach: Real
    """Largest radius of a foot."""


@inlined
def surface(x: Real, y: Real, grid: SurfaceGrid, heights: Table) -> tuple[Real, Real, Real]:
    """Height (m) of the surface at x and y (m), and its gradient.

    `heights` (points,) are the heights of the control points, row by row.
    """
    cells_x = (x - grid.corner_x) * grid.per_cell_x
    cells_y = (y - grid.corner_y) * grid.per_cell_y
    # With this order of minimum and maximum, NaN becomes a bound, so no index leaves the grid.
    s = maximum(minimum(cells_x, grid.last_row), 0.5)
    t = maximum(minimum(cells_y, grid.last_column), 0.5)
    row, column = floor(s + 0.5), floor(t + 0.5)
    a, b = s - row, t - column
    index = grid.first + (row - 1.0) * grid.columns + (column - 1.0)
    h_0, b_0 = _across_row(heights, index, b)
    h_1, b_1 = _across_row(heights, index + grid.columns, b)
    h_2, b_2 = _across_row(heights, index + 2.0 * grid.columns, b)
    height, by_a = _spline(h_0, h_1, h_2, a)
    by_b, _ = _spline(b_0, b_1, b_2, a)
    h_x = select(s == cells_x, by_a * grid.per_cell_x, 0.0)
    h_y = select(t == cells_y, by_b * grid.per_cell_y, 0.0)
    return height, h_x, h_y


@inlined
def _across_row(heights: Table, index: Real, b: Real) -> tuple[Real, Real]:
    before, here = gather(heights, index, 0), gather(heights, index, 1)
    return _spline(before, here, gather(heights, index, 2), b)


@inlined
def _spline(before: Real, here: Real, after: Real, part: Real) -> tuple[Real, Real]:
    """Value and derivative of a quadratic B-spline. `part` (-1/2 to 1/2) is the distance from the
    control point `here`, in cells."""
    less, more, rise, next_rise = 0.5 - part, 0.5 + part, here - before, after - here
    # Each sum has one product, so there is only one way to round a product and a sum together.
    value = here - 0.5 * less * less * rise + 0.5 * more * more * next_rise
    return value, rise + more * (next_rise - rise)


@compiled
def find_frames(
    nodes: Table, contacts: Table, grid: SurfaceGrid, heights: Table, frames: Table
) -> None:
    """Writes the `frames` at the nodes with the indices `contacts` (contacts,).

    A node out of reach of the highest control point gets the frame of level ground at that height.
    """
    for i in range(contacts.size):
        node = contacts[i]
        z = nodes[node, P_WN + 2]
        near = z <= grid.top + grid.reach
        height, h_x, h_y = grid.top, 0.0 * z, 0.0 * z
        c = n_z = 0.0 * z + 1.0
        if any_lane(near):
            z_at, slope_x, slope_y = surface(
                nodes[node, P_WN], nodes[node, P_WN + 1], grid, heights
            )
            height = select(near, z_at, height)
            h_x, h_y = select(near, slope_x, h_x), select(near, slope_y, h_y)
            c = inverse_sqrt(1.0 + h_y * h_y)
            n_z = inverse_sqrt(1.0 + h_x * h_x + h_y * h_y)
        frames[i, GAP] = (z - height) * n_z  # exact on a plane
        put_vector((-h_x * n_z, -h_y * n_z, n_z), i, N_X, frames)
        frames[i, T1_X] = (1.0 + h_y * h_y) * c * n_z
        frames[i, T1_Y] = -h_x * h_y * c * n_z
        frames[i, T1_Z] = h_x * c * n_z
        frames[i, T2_Y] = c
        frames[i, T2_Z] = h_y * c


@inlined
def to_frame(vector: Vector, frames: Table, i: int, flat: bool) -> Vector:
    """Components of a vector of the world frame along t1, t2 and n of a frame."""
    if flat:
        return vector
    x, y, z = vector
    return (
        x * frames[i, T1_X] + y * frames[i, T1_Y] + z * frames[i, T1_Z],
        y * frames[i, T2_Y] + z * frames[i, T2_Z],
        x * frames[i, N_X] + y * frames[i, N_Y] + z * frames[i, N_Z],
    )


@inlined
def to_world(t_1: Real, t_2: Real, n: Real, frames: Table, i: int, flat: bool) -> Vector:
    """Converts components along t1, t2 and n of a frame to a vector in the world frame."""
    if flat:
        return t_1, t_2, n
    return (
        t_1 * frames[i, T1_X] + n * frames[i, N_X],
        t_1 * frames[i, T1_Y] + t_2 * frames[i, T2_Y] + n * frames[i, N_Y],
        t_1 * frames[i, T1_Z] + t_2 * frames[i, T2_Z] + n * frames[i, N_Z],
    )
