"""Block-sparse linear systems: symmetric, positive definite, with 6 x 6 blocks per pair of bodies.

Bodies are eliminated in their order. A schedule is made once from the pairs of coupled bodies. A
system is stored as `rows` (bodies, 6, width). Row r of body i has the body's own block (columns 0
to 5, from the diagonal on), then one block for each later body coupled to i, directly or by
fill-in. In a row of tetrahedra each body is only coupled to the next one, and the system is
block-tridiagonal.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np

from tetra_drake.simd.compiling import inlined
from tetra_drake.simd.lanes import Real, Table

BLOCK = 6


class Schedule(NamedTuple):
    """Positions of the blocks of a system, for elimination and fill-in."""

    count: Table
    """Number of later bodies coupled to each body (bodies,)."""
    later: Table
    """Indices of the later bodies coupled to each body (bodies, most), ascending."""
    column: Table
    """Target of fill-in (bodies, most, most): column[i, a, b] is the first column of the block
    between later[i, a] and later[i, b], in the rows of later[i, a]; a < b."""

    @classmethod
    def of(cls, bodies: int, pairs: Iterable[tuple[int, int]]) -> Self:
        """The schedule for a number of bodies and the coupled pairs among them."""
        coupled: list[set[int]] = [set() for _ in range(bodies)]
        for pair in pairs:
            coupled[min(pair)].add(max(pair))
        for body in range(bodies):
            # Eliminating a body couples all of its later bodies with each other.
            for first, second in itertools.combinations(sorted(coupled[body]), 2):
                coupled[first].add(second)
        later = [sorted(others) for others in coupled]
        count = np.array([len(others) for others in later])
        most = max(1, count.max())
        schedule = cls(
            count=count,
            later=np.zeros((bodies, most), dtype=np.int64),
            column=np.zeros((bodies, most, most), dtype=np.int64),
        )
        for body, others in enumerate(later):
            schedule.later[body, : len(others)] = others
            for a, b in itertools.combinations(range(len(others)), 2):
                position = later[others[a]].index(others[b])
                schedule.column[body, a, b] = BLOCK * (1 + position)
        return schedule

    @property
    def width(self) -> int:
        """Number of columns of `rows`."""
        return BLOCK * (1 + self.later.shape[1])

    @property
    def blocks(self) -> set[tuple[int, int]]:
        """Pairs of different bodies with a block in the rows, including fill-in."""
        return {
            (body, int(other))
            for body, count in enumerate(self.count)
            for other in self.later[body, :count]
        }

    def column_of(self, first: int, second: int) -> int:
        """First column of the block between two bodies, in the rows of body `first`."""
        others = self.later[first, : self.count[first]].tolist()
        return BLOCK * (1 + others.index(second))


@inlined
def factorise(rows: Table, schedule: Schedule) -> None:
    """Factorises `rows` in place: L D Lᵀ with 1 / D on the diagonal.

    A number stays in a variable while all products of a body are subtracted. A loop over the pivots
    would read and write it once per pivot.
    """
    for i in range(rows.shape[0]):
        factorise_block(rows, i)
        for a in range(schedule.count[i]):
            reduce_block(rows, i, BLOCK * (1 + a))
        for a in range(schedule.count[i]):
            eliminate(rows, schedule, i, a)


@inlined
def factorise_block(rows: Table, i: int) -> None:
    """Factorises the block of body i on the diagonal."""
    for r in range(BLOCK):
        inverse = 1.0 / rows[i, r, r]
        rows[i, r, r] = inverse
        for t in range(r + 1, BLOCK):
            factor = rows[i, r, t] * inverse
            for c in range(t, BLOCK):
                rows[i, t, c] -= factor * rows[i, r, c]


@inlined
def reduce_block(rows: Table, i: int, first: int) -> None:
    """Applies the factors of body i's diagonal block to its block that begins at column `first`."""
    f_01, _, _, _, _, _ = factors(rows, i, 1)
    f_02, f_12, _, _, _, _ = factors(rows, i, 2)
    f_03, f_13, f_23, _, _, _ = factors(rows, i, 3)
    f_04, f_14, f_24, f_34, _, _ = factors(rows, i, 4)
    f_05, f_15, f_25, f_35, f_45, _ = factors(rows, i, 5)
    for c in range(first, first + BLOCK):
        x_0 = rows[i, 0, c]
        x_1 = rows[i, 1, c] - f_01 * x_0
        x_2 = rows[i, 2, c] - f_02 * x_0 - f_12 * x_1
        x_3 = rows[i, 3, c] - f_03 * x_0 - f_13 * x_1 - f_23 * x_2
        x_4 = rows[i, 4, c] - f_04 * x_0 - f_14 * x_1 - f_24 * x_2 - f_34 * x_3
        x_5 = rows[i, 5, c] - f_05 * x_0 - f_15 * x_1 - f_25 * x_2 - f_35 * x_3 - f_45 * x_4
        rows[i, 1, c], rows[i, 2, c], rows[i, 3, c] = x_1, x_2, x_3
        rows[i, 4, c], rows[i, 5, c] = x_4, x_5


@inlined
def eliminate(rows: Table, schedule: Schedule, i: int, a: int) -> None:
    """Eliminates body i from the rows of the a-th later body coupled to it."""
    j, first = schedule.later[i, a], BLOCK * (1 + a)
    for t in range(BLOCK):
        column = factors(rows, i, first + t)
        for c in range(t, BLOCK):
            rows[j, t, c] = reduced(rows[j, t, c], column, rows, i, first + c)
        for b in range(a + 1, schedule.count[i]):
            target, source = schedule.column[i, a, b], BLOCK * (1 + b)
            for c in range(BLOCK):
                x = rows[j, t, target + c]
                rows[j, t, target + c] = reduced(x, column, rows, i, source + c)


@inlined
def factors(rows: Table, i: int, c: int) -> tuple[Real, ...]:
    """Column c of the rows of body i, each number divided by the pivot of its row."""
    return (
        rows[i, 0, c] * rows[i, 0, 0],
        rows[i, 1, c] * rows[i, 1, 1],
        rows[i, 2, c] * rows[i, 2, 2],
        rows[i, 3, c] * rows[i, 3, 3],
        rows[i, 4, c] * rows[i, 4, 4],
        rows[i, 5, c] * rows[i, 5, 5],
    )


@inlined
def reduced(x: Real, column: tuple[Real, ...], rows: Table, i: int, c: int) -> Real:
    """x minus the product of a column of factors and column c of the rows of body i."""
    x = x - column[0] * rows[i, 0, c] - column[1] * rows[i, 1, c] - column[2] * rows[i, 2, c]
    return x - column[3] * rows[i, 3, c] - column[4] * rows[i, 4, c] - column[5] * rows[i, 5, c]


@inlined
def solve(rows: Table, schedule: Schedule, x: Table) -> None:
    """Solves a factorised system. `x` (6 bodies,) is the right-hand side, then the solution.

    The numbers of a body are in variables. In a loop over x, each operation would wait for memory.
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
        for a in range(schedule.count[i]):
            g, k = BLOCK * schedule.later[i, a], BLOCK * (1 + a)
            for c in range(BLOCK):
                before = rows[i, 0, k + c] * x_0 + rows[i, 1, k + c] * x_1
                before += rows[i, 2, k + c] * x_2
                after = rows[i, 3, k + c] * x_3 + rows[i, 4, k + c] * x_4
                after += rows[i, 5, k + c] * x_5
                x[g + c] -= before + after
    for i in range(bodies - 1, -1, -1):
        f = BLOCK * i
        for a in range(schedule.count[i]):
            g, k = BLOCK * schedule.later[i, a], BLOCK * (1 + a)
            for r in range(BLOCK):
                after = rows[i, r, k] * x[g]
                for c in range(1, BLOCK):
                    after += rows[i, r, k + c] * x[g + c]
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
