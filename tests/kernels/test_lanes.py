"""Functions of lanes, lane by lane and bit for bit as of plain numbers, and what is refused.

That operators and all that kernels use are right in every lane is tested in
engines/lanes/test_many.py."""

import itertools
import math

import numba
import numpy as np
import pytest
from numba.core.errors import TypingError

from tetra_drake.kernels.lanes import (
    FieldArray,
    any_lane,
    floor,
    gather,
    lane_table,
    maximum,
    minimum,
    not_,
    select,
)

# As `compiled`, without a cache. Where a sum here has a product in it, the product is exact: it is
# the same whether the two are rounded together or not.
jit = numba.njit(error_model="numpy", fastmath={"contract"})

# Both zeros, the least denormals, the least normal number, ordinary ones, the largest, infinities.
SPECIAL = [0.0, -0.0, 5e-324, 2.0**-1022, 1.0, -3.7, np.finfo(float).max, math.inf, -math.inf]
SPECIAL += [math.nan]


@pytest.fixture(params=[4, 8])
def width(request: pytest.FixtureRequest) -> int:
    """Number of lanes."""
    return request.param


def operands() -> tuple[np.ndarray, np.ndarray]:
    """All pairs of special numbers and as many of ordinary ones, in an order that mixes them."""
    rng = np.random.default_rng(0)
    special = np.array(list(itertools.product(SPECIAL, SPECIAL)))
    ordinary = rng.normal(size=special.shape) * 10.0 ** rng.integers(-5, 6, special.shape)
    x, y = rng.permutation(np.concatenate([special, ordinary])).T
    return x, y


def in_lanes(numbers: np.ndarray, width: int) -> FieldArray:
    """A table of one dimension with these numbers, `width` of them side by side."""
    table = lane_table((len(numbers) // width,), width)
    table.array[:] = numbers.reshape(-1, width)
    return table


def functions(x, y):
    """What both numbers and lanes can be given to."""
    picked = (select(x < y, x, y), select(x != y, y, -x), select((x >= y) | (y > 0.0), x, 2.0))
    constant = (select(x < y, 1.0, -0.0), select(x < y, 1, y))
    smaller = (minimum(x, y), minimum(x, 0.0), minimum(0.0, x), minimum(1, x))
    larger = (maximum(x, y), maximum(x, 0.0), maximum(0.0, x), maximum(x, 1))
    both, one = (x <= y) & (y == y), (x < y) ^ (x == -3.7)
    return picked + constant + smaller + larger + (select(both, x, y), select(one, x, y), floor(x))


def test_lanes_are_picked_and_rounded_as_plain_numbers_are(width):
    in_kernel, (x, y) = jit(functions), operands()

    @jit
    def kernel(x, y, results):
        for n in range(x.size):
            for k, result in enumerate(in_kernel(x[n], y[n])):
                results[k, n] = result

    rows = np.array([functions(*pair) for pair in zip(x, y, strict=True)], float).T
    results = lane_table((len(rows), len(x) // width), width)
    kernel(in_lanes(x, width), in_lanes(y, width), results)
    found, is_number = results.array.reshape(rows.shape), ~np.isnan(rows)
    np.testing.assert_array_equal(found, rows)
    np.testing.assert_array_equal(np.signbit(found[is_number]), np.signbit(rows[is_number]))


def test_functions_of_plain_numbers_are_as_documented():
    for better, numbers in ((minimum, (-3.0, 2.0)), (maximum, (2.0, -3.0))):
        assert better(*numbers) == better(*numbers[::-1]) == numbers[0]
        assert better(math.nan, 1.0) == 1.0 and math.isnan(better(1.0, math.nan)), "the second"
        assert [math.copysign(1.0, better(zero, -zero)) for zero in (0.0, -0.0)] == [-1.0, 1.0]
    assert (select(True, 1.0, 2.0), select(False, 1.0, 2.0), floor(-3.7)) == (1.0, 2.0, -4.0)
    assert (not_(True), not_(False), any_lane(True), any_lane(False)) == (False, True, True, False)
    assert gather(np.arange(100.0) ** 2, 7.0, 1) == 64.0


def branch_on_a_mask(line, plane):
    if line[0] > 0.0:
        line[0] = 0.0


REFUSED = [branch_on_a_mask]
REFUSED += [lambda line, plane: plane[1] > 0.0]  # one index too few
REFUSED += [lambda line, plane: (line[0] > 0.0) + 1.0]
REFUSED += [lambda line, plane: select(0.0 < line[0] < 1.0, 1.0, 0.0)]
REFUSED += [lambda line, plane: line[0] + plane[0, 0]]  # of other widths


@pytest.mark.parametrize("kernel", REFUSED)
def test_numba_refuses(kernel):
    with pytest.raises(TypingError):
        jit(kernel)(lane_table((3,), 4), lane_table((3, 4), 8))
