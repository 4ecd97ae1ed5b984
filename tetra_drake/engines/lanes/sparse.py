"""Block-sparse linear systems: symmetric, positive definite, with 6 x 6 blocks per pair of bodies.

Bodies are eliminated in their order. A schedule is made once from the pairs of coupled bodies. A
system is stored as `blocks` (blocks, 6, 6). Block i is body i's own block; its upper half is used.
Then, in compressed rows, each body has a block for each later body coupled to it, directly or by
fill-in. In a row of tetrahedra each body is only coupled to the next one, and the system is
block-tridiagonal.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Real, Table

BLOCK = 6


class Schedule(NamedTuple):
    """Positions of the 6 x 6 blocks of a sparse symmetric matrix in the table `blocks` (blocks, 6,
    6), in the order of elimination. Block i of the first ones is body i's own."""

    first: Table
    """Index of the first block of each body with a later body (bodies + 1,); the last number is the
    number of blocks."""
    later: Table
    """Index of the later body of each block (blocks,); of the body itself for its own block."""
    target: Table
    """Block from which a product of two blocks of a row is subtracted (products,). The products of
    blocks a < b of a row are in the order of a, then of b."""

    @classmethod
    def of(cls, bodies: int, pairs: Iterable[tuple[int, int]]) -> Self:
        """The schedule for a number of bodies, `bodies`, and the pairs of bodies that are coupled,
        by their indices."""
        coupled: list[set[int]] = [set() for _ in range(bodies)]
        for pair in pairs:
            coupled[min(pair)].add(max(pair))
        for body in range(bodies):
            # Eliminating a body couples all of its later bodies with each other.
            for a, b in itertools.combinations(sorted(coupled[body]), 2):
                coupled[a].add(b)
        rows = [sorted(others) for others in coupled]
        first = bodies + np.cumsum([0, *map(len, rows)])
        target = [
            first[a] + rows[a].index(b) for row in rows for a, b in itertools.combinations(row, 2)
        ]
        later = [*range(bodies), *itertools.chain(*rows)]
        return cls(first, np.array(later), np.array(target, dtype=np.int64))

    @property
    def blocks(self) -> dict[tuple[int, int], int]:
        """Index of the block of each pair of bodies (earlier, later) that is coupled, directly or
        by fill-in, the blocks that only the elimination fills."""
        bodies = len(self.first) - 1
        rows = np.repeat(np.arange(bodies), np.diff(self.first)).tolist()
        pairs = zip(rows, self.later[bodies:].tolist(), strict=True)
        return {pair: bodies + k for k, pair in enumerate(pairs)}


@inlined
def factorise(blocks: Table, schedule: Schedule) -> None:
    """Factorises the matrix `blocks` (blocks, 6, 6) in place: L D Lᵀ, with 1 / D in place of D, and
    D Lᵀ above the diagonal.

    A number stays in a variable while all products of a body are subtracted. A loop over the pivots
    would read and write it once per pivot.
    """
    product = 0
    for i in range(schedule.first.size - 1):
        for r in range(BLOCK):  # the body's own block
            inverse = 1.0 / blocks[i, r, r]
            blocks[i, r, r] = inverse
            for t in range(r + 1, BLOCK):
                factor = blocks[i, r, t] * inverse
                for c in range(t, BLOCK):
                    blocks[i, t, c] -= factor * blocks[i, r, c]
        end = schedule.first[i + 1]
        for a in range(schedule.first[i], end):
            reduce_block(blocks, i, a)
        for a in range(schedule.first[i], end):
            eliminate(blocks, schedule, i, a, product)
            product += end - a - 1


@inlined
def reduce_block(blocks: Table, i: int, a: int) -> None:
    """Applies the factors of body i's own block to block number `a`, in place. Block `a` couples
    body i to a later body. This is the first part of the elimination of body i in factorise()."""
    f_01, _, _, _, _, _ = factors(blocks, i, i, 1)
    f_02, f_12, _, _, _, _ = factors(blocks, i, i, 2)
    f_03, f_13, f_23, _, _, _ = factors(blocks, i, i, 3)
    f_04, f_14, f_24, f_34, _, _ = factors(blocks, i, i, 4)
    f_05, f_15, f_25, f_35, f_45, _ = factors(blocks, i, i, 5)
    for c in range(BLOCK):
        x_0 = blocks[a, 0, c]
        x_1 = blocks[a, 1, c] - f_01 * x_0
        x_2 = blocks[a, 2, c] - f_02 * x_0 - f_12 * x_1
        x_3 = blocks[a, 3, c] - f_03 * x_0 - f_13 * x_1 - f_23 * x_2
        x_4 = blocks[a, 4, c] - f_04 * x_0 - f_14 * x_1 - f_24 * x_2 - f_34 * x_3
        x_5 = blocks[a, 5, c] - f_05 * x_0 - f_15 * x_1 - f_25 * x_2 - f_35 * x_3 - f_45 * x_4
        blocks[a, 1, c], blocks[a, 2, c], blocks[a, 3, c] = x_1, x_2, x_3
        blocks[a, 4, c], blocks[a, 5, c] = x_4, x_5


@inlined
def eliminate(blocks: Table, schedule: Schedule, i: int, a: int, product: int) -> None:
    """Eliminates body i from the rows of the later body that block number `a` couples it to; part
    of factorise(). Changes `blocks` in place. `product` is the index in `schedule.target` of the
    first product of block `a` with a later block of body i."""
    j = schedule.later[a]
    for t in range(BLOCK):
        column = factors(blocks, i, a, t)
        for c in range(t, BLOCK):
            blocks[j, t, c] = reduced(blocks[j, t, c], column, blocks, a, c)
        for b in range(a + 1, schedule.first[i + 1]):
            target = schedule.target[product + b - a - 1]
            for c in range(BLOCK):
                blocks[target, t, c] = reduced(blocks[target, t, c], column, blocks, b, c)


@inlined
def factors(blocks: Table, i: int, k: int, c: int) -> tuple[Real, ...]:
    """Column c (6 numbers) of block number k, which is in the row of body i, each number divided by
    the pivot of its row. The inverse pivots are on the diagonal of block i."""
    return (
        blocks[k, 0, c] * blocks[i, 0, 0],
        blocks[k, 1, c] * blocks[i, 1, 1],
        blocks[k, 2, c] * blocks[i, 2, 2],
        blocks[k, 3, c] * blocks[i, 3, 3],
        blocks[k, 4, c] * blocks[i, 4, 4],
        blocks[k, 5, c] * blocks[i, 5, 5],
    )


@inlined
def reduced(x: Real, column: tuple[Real, ...], blocks: Table, k: int, c: int) -> Real:
    """x minus the scalar product of `column`, six numbers of factors(), and column c of block
    number k."""
    x = x - column[0] * blocks[k, 0, c] - column[1] * blocks[k, 1, c] - column[2] * blocks[k, 2, c]
    return (
        x - column[3] * blocks[k, 3, c] - column[4] * blocks[k, 4, c] - column[5] * blocks[k, 5, c]
    )


@inlined
def solve(blocks: Table, schedule: Schedule, x: Table) -> None:
    """Solves a system that factorise() has factorised. `x` (6*bodies,) is the right-hand side, and
    is overwritten by the solution.

    The numbers of a body are in variables. In a loop over x, each operation would wait for memory.
    """
    bodies = schedule.first.size - 1
    for i in range(bodies):
        f = BLOCK * i
        x_0, x_1, x_2, x_3, x_4, x_5 = x[f], x[f + 1], x[f + 2], x[f + 3], x[f + 4], x[f + 5]
        x_0 = x_0 * blocks[i, 0, 0]
        x_1 = (x_1 - blocks[i, 0, 1] * x_0) * blocks[i, 1, 1]
        x_2 = (x_2 - blocks[i, 0, 2] * x_0 - blocks[i, 1, 2] * x_1) * blocks[i, 2, 2]
        x_3 -= blocks[i, 0, 3] * x_0 + blocks[i, 1, 3] * x_1 + blocks[i, 2, 3] * x_2
        x_4 -= blocks[i, 0, 4] * x_0 + blocks[i, 1, 4] * x_1 + blocks[i, 2, 4] * x_2
        x_5 -= blocks[i, 0, 5] * x_0 + blocks[i, 1, 5] * x_1 + blocks[i, 2, 5] * x_2
        x_3 = x_3 * blocks[i, 3, 3]
        x_4 = (x_4 - blocks[i, 3, 4] * x_3) * blocks[i, 4, 4]
        x_5 = (x_5 - blocks[i, 3, 5] * x_3 - blocks[i, 4, 5] * x_4) * blocks[i, 5, 5]
        x[f], x[f + 1], x[f + 2], x[f + 3], x[f + 4], x[f + 5] = x_0, x_1, x_2, x_3, x_4, x_5
        for k in range(schedule.first[i], schedule.first[i + 1]):
            g = BLOCK * schedule.later[k]
            for c in range(BLOCK):
                before = blocks[k, 0, c] * x_0 + blocks[k, 1, c] * x_1
                before += blocks[k, 2, c] * x_2
                after = blocks[k, 3, c] * x_3 + blocks[k, 4, c] * x_4
                after += blocks[k, 5, c] * x_5
                x[g + c] -= before + after
    for i in range(bodies - 1, -1, -1):
        f = BLOCK * i
        for k in range(schedule.first[i], schedule.first[i + 1]):
            g = BLOCK * schedule.later[k]
            for r in range(BLOCK):
                after = blocks[k, r, 0] * x[g]
                for c in range(1, BLOCK):
                    after += blocks[k, r, c] * x[g + c]
                x[f + r] -= blocks[i, r, r] * after
        x_0, x_1, x_2, x_3, x_4, x_5 = x[f], x[f + 1], x[f + 2], x[f + 3], x[f + 4], x[f + 5]
        x_4 -= blocks[i, 4, 4] * (blocks[i, 4, 5] * x_5)
        x_3 -= blocks[i, 3, 3] * (blocks[i, 3, 5] * x_5 + blocks[i, 3, 4] * x_4)
        after = blocks[i, 2, 5] * x_5 + blocks[i, 2, 4] * x_4 + blocks[i, 2, 3] * x_3
        x_2 -= blocks[i, 2, 2] * after
        after = blocks[i, 1, 5] * x_5 + blocks[i, 1, 4] * x_4 + blocks[i, 1, 3] * x_3
        x_1 -= blocks[i, 1, 1] * (after + blocks[i, 1, 2] * x_2)
        after = blocks[i, 0, 5] * x_5 + blocks[i, 0, 4] * x_4 + blocks[i, 0, 3] * x_3
        x_0 -= blocks[i, 0, 0] * (after + blocks[i, 0, 2] * x_2 + blocks[i, 0, 1] * x_1)
        x[f], x[f + 1], x[f + 2], x[f + 3], x[f + 4], x[f + 5] = x_0, x_1, x_2, x_3, x_4, x_5
