"""Symmetric positive definite block-tridiagonal systems with 6 x 6 blocks, a block a body.

A system is kept as `rows`, (bodies, 6, 12): row r of body i holds, from the diagonal on, its
own block (columns 0 to 5) and its coupling to the next body (columns 6 to 11).
"""

from __future__ import annotations

from tetra_drake.simd.compiling import inlined
from tetra_drake.simd.lanes import Table

BLOCK, ROW = 6, 12


@inlined
def factorise(rows: Table) -> None:
    """Turns `rows` into its factors in place: L D Lᵀ with 1 / D on the diagonal."""
    bodies = rows.shape[0]
    for i in range(bodies):
        width = ROW if i < bodies - 1 else BLOCK
        for r in range(BLOCK):
            inverse = 1.0 / rows[i, r, r]
            rows[i, r, r] = inverse
            for t in range(r + 1, BLOCK):
                factor = rows[i, r, t] * inverse
                for c in range(t, width):
                    rows[i, t, c] -= factor * rows[i, r, c]
            for t in range(BLOCK, width):
                factor = rows[i, r, t] * inverse
                for c in range(t, width):
                    rows[i + 1, t - BLOCK, c - BLOCK] -= factor * rows[i, r, c]


@inlined
def solve(rows: Table, x: Table) -> None:
    """Solves with the factors; `x`, (6 bodies,), holds the right-hand side, then the solution.

    The numbers of a body are in variables: in a loop over x, each would wait for the memory.
    """
    bodies = rows.shape[0]
    for i in range(bodies):
        f = BLOCK * i
        x_0, x_1, x_2, x_3, x_4, x_5 = x[f], x[f + 1], x[f + 2], x[f + 3], x[f + 4], x[f + 5]
        x_0 = x_0 * rows[i, 0, 0]
        x_1 = (x_1 - rows[i, 0, 1] * x_0) * rows[i, 1, 1]
        x_2 = (x_2 - rows[i, 0, 2] * x_0 - rows[i, 1, 2] * x_1) * rows[i, 2, 2]
        x_3 -= rows[i, 0, 3] * x_0 + rows[i, 1, 3] * x_1 + rows[i, 2, 3] * x_2
        x_4 -= rows[i, 0, 4] * x_0 + rows[i, 1, 4] * x_1 + rows[i, 2, 4] * x_2
        x_5 -= rows[i, 0, 5] * x_0 + rows[i, 1, 5] * x_1 + rows[i, 2, 5] * x_2
        x_3 = x_3 * rows[i, 3, 3]
        x_4 = (x_4 - rows[i, 3, 4] * x_3) * rows[i, 4, 4]
        x_5 = (x_5 - rows[i, 3, 5] * x_3 - rows[i, 4, 5] * x_4) * rows[i, 5, 5]
        x[f], x[f + 1], x[f + 2], x[f + 3], x[f + 4], x[f + 5] = x_0, x_1, x_2, x_3, x_4, x_5
        for c in range(BLOCK, ROW if i < bodies - 1 else BLOCK):
            before = rows[i, 0, c] * x_0 + rows[i, 1, c] * x_1 + rows[i, 2, c] * x_2
            x[f + c] -= before + (rows[i, 3, c] * x_3 + rows[i, 4, c] * x_4 + rows[i, 5, c] * x_5)
    for i in range(bodies - 1, -1, -1):
        f = BLOCK * i
        for r in range(BLOCK if i < bodies - 1 else 0):
            after = rows[i, r, BLOCK] * x[f + BLOCK]
            for c in range(BLOCK + 1, ROW):
                after += rows[i, r, c] * x[f + c]
            x[f + r] -= rows[i, r, r] * after
        x_0, x_1, x_2, x_3, x_4, x_5 = x[f], x[f + 1], x[f + 2], x[f + 3], x[f + 4], x[f + 5]
        x_4 -= rows[i, 4, 4] * (rows[i, 4, 5] * x_5)
        x_3 -= rows[i, 3, 3] * (rows[i, 3, 5] * x_5 + rows[i, 3, 4] * x_4)
        x_2 -= rows[i, 2, 2] * (rows[i, 2, 5] * x_5 + rows[i, 2, 4] * x_4 + rows[i, 2, 3] * x_3)
        after = rows[i, 1, 5] * x_5 + rows[i, 1, 4] * x_4 + rows[i, 1, 3] * x_3
        x_1 -= rows[i, 1, 1] * (after + rows[i, 1, 2] * x_2)
        after = rows[i, 0, 5] * x_5 + rows[i, 0, 4] * x_4 + rows[i, 0, 3] * x_3
        x_0 -= rows[i, 0, 0] * (after + rows[i, 0, 2] * x_2 + rows[i, 0, 1] * x_1)
        x[f], x[f + 1], x[f + 2], x[f + 3], x[f + 4], x[f + 5] = x_0, x_1, x_2, x_3, x_4, x_5
