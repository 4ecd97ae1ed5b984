"""The linear solver, against numpy on the same matrix written out."""

import itertools

import numpy as np
import pytest
from helpers.kernels import written_out

from tetra_drake.laws.sparse import BLOCK, Schedule, factorise, solve

GRAPHS = {
    "one body": (1, []),
    "row": (5, [(0, 1), (1, 2), (2, 3), (3, 4)]),
    "ring": (6, [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0)]),
    "all coupled": (3, [(0, 1), (0, 2), (1, 2)]),
    "six-bar": (6, [(a, b) for a, b in itertools.combinations(range(6), 2) if a // 2 != b // 2]),
    "two rows apart": (4, [(0, 2), (1, 3)]),
    "star": (5, [(0, 1), (0, 2), (0, 3), (0, 4)]),
    "lattice": (12, [(i, i + 1) for i in range(11) if i % 4 < 3] + [(i, i + 4) for i in range(8)]),
}


@pytest.mark.parametrize("graph", GRAPHS)
def test_solves_what_it_was_made_of(graph):
    bodies, pairs = GRAPHS[graph]
    random, schedule = np.random.default_rng(bodies), Schedule.of(bodies, pairs)
    blocks = random.normal(size=(len(schedule.later), BLOCK, BLOCK))
    blocks[:bodies] += 20.0 * bodies * np.eye(BLOCK)  # positive definite
    rows, columns = np.tril_indices(BLOCK, -1)
    blocks[:bodies, rows, columns] = np.nan  # which nothing may read
    matrix, right_side = written_out(blocks, schedule), random.normal(size=BLOCK * bodies)
    x = right_side.copy()
    factorise(blocks, schedule)
    solve(blocks, schedule, x)
    np.testing.assert_allclose(x, np.linalg.solve(matrix, right_side), rtol=1e-9, atol=1e-12)


def test_a_large_lattice_fills_little_in():
    side = 20
    right = [(i, i + 1) for i in range(side**2) if (i + 1) % side]
    pairs = right + [(i, i + side) for i in range(side**2 - side)]
    assert len(Schedule.of(side**2, pairs).blocks) < 0.5 * side**3
    assert len(Schedule.in_order(np.arange(side**2), pairs).blocks) > 0.9 * side**3
