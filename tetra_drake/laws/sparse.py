"""Block-sparse linear systems: symmetric, positive definite, with 6 x 6 blocks per pair of bodies.

Bodies are eliminated one after the other, which couples the bodies next to them (fill-in). A
schedule is made once from the pairs of coupled bodies. A system is stored as `blocks` (blocks, 6,
6). Block i is body i's own block; its upper half is used. Then, in compressed rows, each body has a
block for each later body coupled to it, directly or by fill-in. *Later* means: eliminated later. In
a row of tetrahedra each body is only coupled to the next one, and the system is block-tridiagonal.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Real, Table

BLOCK = 6


class Schedule(NamedTuple):
    """Positions of the 6 x 6 blocks of a sparse symmetric matrix in the table `blocks` (blocks, 6,
    6), in the order of elimination. Block i of the first ones is body i's own."""

    order: Table
    """Body at each position of the elimination (bodies,)."""
    first: Table
    """Index of the first block with a later body, for the body at each position (bodies + 1,); the
    last number is the number of blocks."""
    later: Table
    """Index of the later body of each block (blocks,); of the body itself for its own block."""
    target: Table
    """Block from which a product of two blocks of a row is subtracted (products,). The products of
    blocks a < b of a row are in the order of a, then of b."""

    @classmethod
    def of(cls, bodies: int, pairs: Iterable[tuple[int, int]]) -> Self:
        """The schedule for a number of bodies and the coupled pairs among them. The bodies are
        eliminated in their order, or in the order of minimum degree if it needs fewer products."""
        pairs = [*pairs]
        by_index = cls.in_order(np.arange(bodies), pairs)
        if not by_index.target.size:
            return by_index
        by_degree = cls.in_order(minimum_degree_order(bodies, pairs), pairs)
        return min(by_index, by_degree, key=lambda schedule: schedule.target.size)

    @classmethod
    def in_order(cls, order: Table, pairs: Iterable[tuple[int, int]]) -> Self:
        """The schedule for bodies that are eliminated in a given order (bodies,), with the coupled
        pairs among them."""
        bodies, position = len(order), np.argsort(order)
        coupled: list[set[int]] = [set() for _ in range(bodies)]  # positions of later bodies
        for a, b in position[np.reshape([*pairs], (-1, 2)).astype(int)].tolist():
            coupled[min(a, b)].add(max(a, b))
        for others in coupled:
            # Eliminating a body couples all of its later bodies with each other.
            for a, b in itertools.combinations(sorted(others), 2):
                coupled[a].add(b)
        rows = [sorted(others) for others in coupled]
        first = bodies + np.cumsum([0, *map(len, rows)])
        target = [
            first[a] + rows[a].index(b) for row in rows for a, b in itertools.combinations(row, 2)
        ]
        later = [*range(bodies), *(int(order[other]) for row in rows for other in row)]
        return cls(order, first, np.array(later), np.array(target, dtype=np.int64))

    @property
    def blocks(self) -> dict[tuple[int, int], int]:
        """Index of the block of each coupled pair of bodies, directly or by fill-in. The first body
        of a pair is eliminated before the second."""
        bodies = len(self.order)
        rows = np.repeat(self.order, np.diff(self.first)).tolist()
        pairs = zip(rows, self.later[bodies:].tolist(), strict=True)
        return {pair: bodies + k for k, pair in enumerate(pairs)}

    @property
    def work(self) -> float:
        """Work of a factorisation, as for a full matrix whose size cubed is this number."""
        lengths = BLOCK * (1 + np.diff(self.first)[:, np.newaxis]) - np.arange(BLOCK)
        return 3.0 * float((lengths**2).sum())


def minimum_degree_order(bodies: int, pairs: Iterable[tuple[int, int]]) -> np.ndarray:
    """Order of elimination (bodies,) with little fill-in: the next body is mostly one with the
    fewest neighbours. SuperLU computes it for a matrix with an entry for each of the `pairs`."""
    a, b = np.transpose([*pairs])
    own = np.arange(bodies)
    entries = np.repeat([2.0 * bodies, 1.0], [bodies, 2 * len(a)])
    indices = np.concatenate([own, a, b]), np.concatenate([own, b, a])
    matrix = csc_array((entries, indices), shape=(bodies, bodies))
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    return np.argsort(factors.perm_c)


@inlined
def factorise(blocks: Table, schedule: Schedule) -> None:
    """Factorises the matrix `blocks` (blocks, 6, 6) in place: L D Lᵀ, with 1 / D in place of D, and
    D Lᵀ above the diagonal.

    A number stays in a variable while all products of a body are subtracted. A loop over the pivots
    would read and write it once per pivot.
    """
    product = 0
    for position in range(schedule.order.size):
        i = schedule.order[position]
        for r in range(BLOCK):  # the body's own block
            inverse = 1.0 / blocks[i, r, r]
            blocks[i, r, r] = inverse
            for t in range(r + 1, BLOCK):
                factor = blocks[i, r, t] * inverse
                for c in range(t, BLOCK):
                    blocks[i, t, c] -= factor * blocks[i, r, c]
        end = schedule.first[position + 1]
        for a in range(schedule.first[position], end):
            reduce_block(blocks, i, a)
        for a in range(schedule.first[position], end):
            eliminate(blocks, schedule, i, a, end, product)
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
def eliminate(blocks: Table, schedule: Schedule, i: int, a: int, end: int, product: int) -> None:
    """Eliminates body i from the rows of the later body that block `a` couples it to; part of
    factorise(). The body's blocks end before `end`. `product` is the index in `schedule.target` of
    the first product of block `a`."""
    j = schedule.later[a]
    for t in range(BLOCK):
        column = factors(blocks, i, a, t)
        for c in range(t, BLOCK):
            blocks[j, t, c] = reduced(blocks[j, t, c], column, blocks, a, c)
    if a + 1 == end:
        return
    for t in range(0, BLOCK, 3):  # three rows at a time, which share the numbers of block b
        first, second = factors(blocks, i, a, t), factors(blocks, i, a, t + 1)
        third = factors(blocks, i, a, t + 2)
        for b in range(a + 1, end):
            k = schedule.target[product + b - a - 1]
            for c in range(BLOCK):
                x = reduced(blocks[k, t, c], first, blocks, b, c)
                y = reduced(blocks[k, t + 1, c], second, blocks, b, c)
                z = reduced(blocks[k, t + 2, c], third, blocks, b, c)
                blocks[k, t, c], blocks[k, t + 1, c], blocks[k, t + 2, c] = x, y, z


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
    bodies = schedule.order.size
    for position in range(bodies):
        i = schedule.order[position]
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
        for k in range(schedule.first[position], schedule.first[position + 1]):
            g = BLOCK * schedule.later[k]
            for c in range(BLOCK):
                before = blocks[k, 0, c] * x_0 + blocks[k, 1, c] * x_1
                before += blocks[k, 2, c] * x_2
                after = blocks[k, 3, c] * x_3 + blocks[k, 4, c] * x_4
                after += blocks[k, 5, c] * x_5
                x[g + c] -= before + after
    for position in range(bodies - 1, -1, -1):
        i = schedule.order[position]
        f = BLOCK * i
        for k in range(schedule.first[position], schedule.first[position + 1]):
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
