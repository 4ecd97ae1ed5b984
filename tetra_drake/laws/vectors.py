"""Vectors of three components in kernels, as tuples of numbers or lanes."""

from __future__ import annotations

import numpy as np

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Real, Table

Vector3 = tuple[Real, Real, Real]

NO_INDICES, NO_NUMBERS, NO_VECTORS = np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 3))
"""Empty tables, of what a robot does not have."""


@inlined
def vector_at(table: Table, row: int, column: int) -> Vector3:
    """Vector in a row of a table, in three columns beginning with `column`."""
    return table[row, column], table[row, column + 1], table[row, column + 2]


@inlined
def put_vector(vector: Vector3, row: int, column: int, table: Table) -> None:
    """Writes a vector to a row of a table, in three columns beginning with `column`."""
    table[row, column] = vector[0]
    table[row, column + 1] = vector[1]
    table[row, column + 2] = vector[2]


@inlined
def add_vector(vector: Vector3, row: int, column: int, table: Table) -> None:
    """Adds a vector to three columns of a table, beginning with `column`."""
    table[row, column] += vector[0]
    table[row, column + 1] += vector[1]
    table[row, column + 2] += vector[2]


@inlined
def sum_of(a: Vector3, b: Vector3) -> Vector3:
    """Sum a + b of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def difference(a: Vector3, b: Vector3) -> Vector3:
    """Difference a - b of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def scaled(factor: Real, a: Vector3) -> Vector3:
    """Product of a number and a vector."""
    return factor * a[0], factor * a[1], factor * a[2]


@inlined
def dot(a: Vector3, b: Vector3) -> Real:
    """Scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a: Vector3, b: Vector3) -> Vector3:
    """Vector product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
