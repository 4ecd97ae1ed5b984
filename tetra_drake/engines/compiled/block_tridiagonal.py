"""Symmetric positive definite block-tridiagonal systems with 6 x 6 blocks, a block a body.

A system is kept as `rows`, (bodies, 6, 12): row r of body i holds, from the diagonal on, its
own block (columns 0 to 5) and its coupling to the next body (columns 6 to 11).
"""

from __future__ import annotations

import numpy as np

from tetra_drake.physics.compiling import compiled

Array = np.ndarray

BLOCK, ROW = 6, 12


@compiled
def add_outer_product(factor: float, vector: Array, first: int, size: int, rows: Array) -> None:
    """Adds factor * vector vectorᵀ; `vector`, (ROW,), of which `size` are used (BLOCK or ROW),
    begins at body `first`."""
    own = rows[first]
    for r in range(BLOCK):
        scaled = factor * vector[r]
        for c in range(r, size):
            own[r, c] += scaled * vector[c]
    if size == ROW:
        following = rows[first + 1]
        for r in range(BLOCK):
            scaled = factor * vector[BLOCK + r]
            for c in range(r, BLOCK):
                following[r, c] += scaled * vector[BLOCK + c]


@compiled
def factorise(rows: Array) -> None:
    """Turns `rows` into its factors in place: L D Lᵀ with 1 / D on the diagonal."""
    bodies = rows.shape[0]
    for i in range(bodies):
        width = ROW if i < bodies - 1 else BLOCK
        own = rows[i]
        for r in range(BLOCK):
            inverse = 1.0 / own[r, r]
            own[r, r] = inverse
            for t in range(r + 1, BLOCK):
                factor = own[r, t] * inverse
                for c in range(t, width):
                    own[t, c] -= factor * own[r, c]
            if width == ROW:
                following = rows[i + 1]
                for t in range(BLOCK):
                    factor = own[r, BLOCK + t] * inverse
                    for c in range(t, BLOCK):
                        following[t, c] -= factor * own[r, BLOCK + c]


@compiled
def solve(rows: Array, x: Array) -> None:
    """Solves with the factors; `x`, (6 bodies,), holds the right-hand side, then the solution."""
    bodies = rows.shape[0]
    for i in range(bodies):
        width = ROW if i < bodies - 1 else BLOCK
        for r in range(BLOCK):
            x_r = x[BLOCK * i + r] * rows[i, r, r]
            for c in range(r + 1, width):
                x[BLOCK * i + c] -= rows[i, r, c] * x_r
            x[BLOCK * i + r] = x_r
    for i in range(bodies - 1, -1, -1):
        width = ROW if i < bodies - 1 else BLOCK
        for r in range(BLOCK - 1, -1, -1):
            total = 0.0
            for c in range(r + 1, width):
                total += rows[i, r, c] * x[BLOCK * i + c]
            x[BLOCK * i + r] -= rows[i, r, r] * total
