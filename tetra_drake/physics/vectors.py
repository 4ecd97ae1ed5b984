"""Vectors of three components in kernels: tuples of numbers or of lanes."""

from __future__ import annotations

from tetra_drake.simd.compiling import inlined
from tetra_drake.simd.lanes import Real, Table

Vector = tuple[Real, Real, Real]


@inlined
def vector_at(table: Table, row: int, column: int) -> Vector:
    """The vector in a row of a table, in three columns of which `column` is the first."""
    return table[row, column], table[row, column + 1], table[row, column + 2]


@inlined
def put_vector(vector: Vector, row: int, column: int, table: Table) -> None:
    """Writes a vector where vector_at() reads it."""
    table[row, column] = vector[0]
    table[row, column + 1] = vector[1]
    table[row, column + 2] = vector[2]


@inlined
def add_vector(vector: Vector, row: int, column: int, table: Table) -> None:
    """Adds a vector to that in a table."""
    table[row, column] += vector[0]
    table[row, column + 1] += vector[1]
    table[row, column + 2] += vector[2]


@inlined
def subtract_vector(vector: Vector, row: int, column: int, table: Table) -> None:
    """Subtracts a vector from that in a table."""
    table[row, column] -= vector[0]
    table[row, column + 1] -= vector[1]
    table[row, column + 2] -= vector[2]


@inlined
def difference(a: Vector, b: Vector) -> Vector:
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def scaled(factor: Real, a: Vector) -> Vector:
    """The product of a number and a vector."""
    return factor * a[0], factor * a[1], factor * a[2]


@inlined
def dot(a: Vector, b: Vector) -> Real:
    """The scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a: Vector, b: Vector) -> Vector:
    """The vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
