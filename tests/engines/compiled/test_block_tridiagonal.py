"""The linear solver, against numpy on the same matrix written out."""

import numpy as np
import pytest

from tetra_drake.engines.compiled.block_tridiagonal import BLOCK, ROW, factorise, solve


def random_system(bodies: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a random positive definite system, NaN below the diagonal, and the system in full."""
    generator = np.random.default_rng(bodies)
    rows, full = np.zeros((bodies, BLOCK, ROW)), 0.1 * np.eye(BLOCK * bodies)
    for _ in range(20 * bodies):
        body = int(generator.integers(bodies))
        size = ROW if body + 1 < bodies and generator.random() < 0.7 else BLOCK
        vector = np.append(generator.normal(size=size), np.zeros(ROW - size))
        place = slice(BLOCK * body, BLOCK * body + size)
        full[place, place] += generator.uniform(0.1, 2.0) * np.outer(vector[:size], vector[:size])
    wide = np.hstack([full, np.zeros((len(full), BLOCK))])
    for body in range(bodies):
        first = BLOCK * body
        block = wide[first : first + BLOCK, first : first + ROW]
        rows[body] = np.where(np.arange(ROW) >= np.arange(BLOCK)[:, None], block, np.nan)
    return rows, full


@pytest.mark.parametrize("bodies", [1, 2, 5, 8])
def test_solves_what_it_was_made_of(bodies):
    rows, full = random_system(bodies)
    right_side = np.random.default_rng(1).normal(size=BLOCK * bodies)
    x = right_side.copy()
    factorise(rows)
    solve(rows, x)
    np.testing.assert_allclose(x, np.linalg.solve(full, right_side), rtol=1e-9, atol=1e-12)
