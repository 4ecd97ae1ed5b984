"""The linear solver, against numpy on the same matrix written out."""

import itertools

import numpy as np
import pytest

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


def random_matrix(bodies: int, pairs: list[tuple[int, int]]) -> np.ndarray:
    """A random positive definite matrix, in which the pairs of bodies are coupled."""
    generator = np.random.default_rng(bodies)
    matrix = 0.1 * np.eye(BLOCK * bodies)
    for body_a, body_b in [*pairs, *((body, body) for body in range(bodies))]:
        for _ in range(6):
            vector = np.zeros((bodies, BLOCK))
            vector[body_a], vector[body_b] = generator.normal(size=(2, BLOCK))
            matrix += generator.uniform(0.1, 2.0) * np.outer(vector, vector)
    return matrix


def blocks_of(matrix: np.ndarray, schedule: Schedule) -> np.ndarray:
    """The matrix as blocks; NaN below the diagonal, which nothing may read."""
    written_out = matrix.reshape(len(matrix) // BLOCK, BLOCK, -1, BLOCK).swapaxes(1, 2)
    blocks = np.empty((len(schedule.later), BLOCK, BLOCK))
    for body in range(len(written_out)):
        blocks[body] = written_out[body, body]
        blocks[body][np.tril_indices(BLOCK, -1)] = np.nan
    for pair, block in schedule.blocks.items():
        blocks[block] = written_out[pair]
    return blocks


@pytest.mark.parametrize("graph", GRAPHS)
def test_solves_what_it_was_made_of(graph):
    bodies, pairs = GRAPHS[graph]
    matrix, schedule = random_matrix(bodies, pairs), Schedule.of(bodies, pairs)
    right_side = np.random.default_rng(1).normal(size=BLOCK * bodies)
    blocks, x = blocks_of(matrix, schedule), right_side.copy()
    factorise(blocks, schedule)
    solve(blocks, schedule, x)
    np.testing.assert_allclose(x, np.linalg.solve(matrix, right_side), rtol=1e-9, atol=1e-12)


def test_a_large_lattice_fills_little_in():
    side = 20
    right = [(i, i + 1) for i in range(side**2) if (i + 1) % side]
    pairs = right + [(i, i + side) for i in range(side**2 - side)]
    assert len(Schedule.of(side**2, pairs).blocks) < 0.5 * side**3
    assert len(Schedule.in_order(np.arange(side**2), pairs).blocks) > 0.9 * side**3
