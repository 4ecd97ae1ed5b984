"""Lanes, masks and fields in kernels, lane by lane and bit for bit against NumPy."""

import itertools
import math
from collections.abc import Callable
from decimal import Decimal

import numba
import numpy as np
import pytest
from helpers.widths import WIDTHS
from numba.core.errors import TypingError
from numba.extending import register_jitable

from tetra_drake.simd.lanes import (
    FieldArray,
    any_lane,
    floor,
    gather,
    inverse_sqrt,
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
SPECIAL = [0.0, -0.0, 5e-324, -5e-324, 2.0**-1022, 1.0, -1.0, 0.1, -3.7, 1e150, -1e150]
SPECIAL += [np.finfo(float).max, -np.finfo(float).max, math.inf, -math.inf, math.nan]

RANGE = (1e-37, 1e38)  # in which inverse_sqrt keeps its promise


@pytest.fixture(params=[1, *WIDTHS])
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


def assert_same(found: np.ndarray, expected: np.ndarray, message: str = "") -> None:
    """Equal numbers, signs of zeros included; any NaN equals any other."""
    np.testing.assert_array_equal(found, expected, message)
    is_number = ~np.isnan(expected)
    signs = [np.signbit(values)[is_number] for values in (found, expected)]
    np.testing.assert_array_equal(*signs, f"signs, {message}")


def check(
    function: Callable[..., tuple],
    width: int,
    *scalars: float,
    expected: Callable[..., tuple] | None = None,
    gives_masks: bool = False,
) -> None:
    """Asserts that function(x, y, *scalars), a tuple of numbers or of truth values, compiled for
    lanes gives what `expected`, or else the function itself, gives for NumPy arrays."""
    in_kernel = jit(function)
    as_number = jit((lambda truth: select(truth, 1.0, 0.0)) if gives_masks else (lambda x: x))

    @jit
    def kernel(x, y, results, *scalars):
        for n in range(x.size):
            for k, result in enumerate(in_kernel(x[n], y[n], *scalars)):
                results[k, n] = as_number(result)

    x, y = operands()
    with np.errstate(all="ignore"):
        rows = (expected or function)(x, y, *scalars)
    results = lane_table((len(rows), len(x) // width), width)
    kernel(in_lanes(x, width), in_lanes(y, width), results, *scalars)
    for k, row in enumerate(rows):
        assert_same(results.array[k].ravel(), row.astype(float), f"result {k}")


# Operators.


@register_jitable
def arithmetic(x, y):
    added, subtracted, multiplied, divided = 1.0 * x, 1.0 * x, 1.0 * x, 1.0 * x  # copies
    added += y
    subtracted -= y
    multiplied *= y
    divided /= y
    return x + y, x - y, x * y, x / y, added, subtracted, multiplied, divided


@register_jitable
def comparisons(x, y):
    return x < y, x <= y, x > y, x >= y, x == y, x != y


@pytest.mark.parametrize("scalar", [-3.7, 3])
def test_arithmetic_and_comparisons_are_those_of_doubles(width, scalar):
    def arithmetic_of_all(x, y, a):
        of_two = (*arithmetic(x, y), *arithmetic(x, a), *arithmetic(a, x))
        return (*of_two, -x, abs(x))

    def comparisons_of_all(x, y, a):
        return *comparisons(x, y), *comparisons(x, a), *comparisons(a, x)

    check(arithmetic_of_all, width, scalar)
    check(comparisons_of_all, width, scalar, gives_masks=True)
    check(lambda x, y: (math.sqrt(x),), width, expected=lambda x, y: (np.sqrt(x),))


def test_masks_combine_lane_by_lane(width):
    def logic(x, y, yes, no):
        p, q = x < y, x > 0.0
        both, either, one, scalar_first = x < y, x < y, x < y, yes
        both &= q
        either |= q
        one ^= q
        scalar_first &= p
        masks = (p & q, p | q, p ^ q, both, either, one, scalar_first)
        return (*masks, p & yes, p & no, yes & p, p | no, yes | p, p ^ yes, no ^ p, p & True)

    check(logic, width, True, False, gives_masks=True)


# Functions.


def functions(x, y):
    """What both numbers and lanes can be given to."""
    picked = (select(x < y, x, y), select(x != y, y, -x), select((x >= y) | (y > 0.0), x, 2.0))
    constant = (select(x < y, 1.0, -0.0), select(x < y, 1, y), select(x < y, 1, 0))
    smaller = (minimum(x, y), minimum(y, x), minimum(x, 0.0), minimum(0.0, x), minimum(1, x))
    larger = (maximum(x, y), maximum(y, x), maximum(x, 0.0), maximum(0.0, x), maximum(x, 1))
    return picked + constant + smaller + larger + (floor(x),)


def functions_in_numpy(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, ...]:
    """The same, as they are documented."""

    def the_better(better, x, y):
        # The second where either is NaN or both are equal: of zeros, the sign tells which.
        x, y = np.broadcast_arrays(x, y)
        nan_or_equal = np.isnan(x) | np.isnan(y) | (x == y)
        return np.where(nan_or_equal, y, better(x, y))

    less, positive = x < y, y > 0.0
    picked = (np.where(less, x, y), np.where(x != y, y, -x), np.where((x >= y) | positive, x, 2.0))
    constant = (np.where(less, 1.0, -0.0), np.where(less, 1.0, y), np.where(less, 1.0, 0.0))
    smaller = [(x, y), (y, x), (x, 0.0), (0.0, x), (1.0, x)]
    larger = [(x, y), (y, x), (x, 0.0), (0.0, x), (x, 1.0)]
    return (
        *picked,
        *constant,
        *(the_better(np.minimum, *pair) for pair in smaller),
        *(the_better(np.maximum, *pair) for pair in larger),
        np.floor(x),
    )


def test_functions_of_lanes(width):
    check(functions, width, expected=functions_in_numpy)


def test_functions_of_plain_numbers_are_the_same_in_python():
    x, y = operands()  # kernels give the same for one lane (above)
    found = [functions(*pair) for pair in zip(x, y, strict=True)]
    for k, expected in enumerate(functions_in_numpy(x, y)):
        assert_same(np.array([row[k] for row in found], float), expected, f"result {k}")


def test_not_is_the_opposite_in_every_lane(width):
    def opposite(x, y):
        return (not_(x > 0.0),)

    check(opposite, width, expected=lambda x, y: (~(x > 0.0),), gives_masks=True)
    assert (not_(True), not_(False)) == (False, True)


def error_in_last_place(x: float, found: float) -> float:
    """The error of an inverse square root; the exact one is taken to 28 digits."""
    exact = 1 / Decimal(x).sqrt()
    return float(abs(Decimal(found) - exact) / Decimal(math.ulp(float(exact))))


def test_inverse_square_root_is_within_two_units_in_the_last_place(width):
    @jit
    def invert_roots(x, results):
        for n in range(x.size):
            results[n] = inverse_sqrt(x[n])

    spread = np.geomspace(*RANGE, 376)  # five in a decade
    near_two_powers = np.linspace(0.9, 4.1, 392)  # all mantissas, of even and odd exponents
    x = np.clip(np.concatenate([spread, near_two_powers]), *RANGE)
    results = in_lanes(np.zeros_like(x), width)
    invert_roots(in_lanes(x, width), results)
    in_python = [inverse_sqrt(float(number)) for number in x]
    for found in (results.array.ravel(), in_python):
        assert max(map(error_in_last_place, x, found)) < 2.0


def test_gather_takes_for_each_lane_the_number_at_its_own_index(width):
    numbers = np.arange(100.0) ** 2
    indices = np.random.default_rng(0).integers(2, 97, 16).astype(float)
    found = lane_table((16 // width,), width)

    @jit
    def kernel(numbers, indices, found):
        for i in range(found.size):
            found[i] = gather(numbers, indices[i], -2) + gather(numbers, indices[i], 3)

    kernel(FieldArray(numbers), in_lanes(indices, width), found)
    assert_same(found.array.ravel(), (indices - 2) ** 2 + (indices + 3) ** 2)
    assert gather(numbers, 7.0, 1) == 64.0, "in plain Python"


def test_any_lane_is_true_where_one_is(width):
    @jit
    def count_rows(x, counts):
        for n in range(x.size):
            if any_lane(x[n] > 0.0):
                counts[n] += 1

    # Row n has the binary digits of n in its lanes: all patterns; only that of 0 has no lane set.
    patterns = np.array(list(itertools.product([0.0, 1.0], repeat=width)))
    counts = np.zeros(2**width, np.int64)
    count_rows(in_lanes(patterns.ravel(), width), FieldArray(counts))
    np.testing.assert_array_equal(counts, [0] + [1] * (2**width - 1))
    assert (any_lane(True), any_lane(False)) == (True, False)


# Variables.


def test_a_variable_that_was_a_scalar_becomes_lanes(width):
    @jit
    def fold(x, results):
        total, product, positive, seen = 0, 1.0, False, True
        for n in range(x.size):
            total += x[n]
            product = product * x[n]
            positive = positive | (x[n] > 2.0)
            if n == 1:
                last, seen = x[n], x[n] > 1.0
            else:
                last, seen = 5.0, n > 1
        results[0], results[1], results[2] = total, product, last
        results[3] = select(positive, 1.0, 0.0)
        results[4] = select(seen, 1.0, 0.0)

    numbers = np.array([[1.0], [-2.0]]) + np.arange(width)  # -2 in lane 0, -1 in lane 1 ...
    results = lane_table((5,), width)
    fold(in_lanes(numbers.ravel(), width), results)
    last = numbers[1]
    positive, seen = (numbers > 2.0).any(axis=0), last > 1.0
    expected = [numbers.sum(axis=0), numbers.prod(axis=0), last, positive, seen]
    assert_same(results.array, np.array(expected, float))


# Fields.


@pytest.mark.parametrize("any_size", [False, True])
def test_fields_of_one_two_and_three_dimensions(width, any_size):
    @jit
    def fill(line, plane, cube):
        """With numbers that tell the place, each read back from where it was put."""
        for i in range(line.shape[0]):
            line[i] += i
            for j in range(plane.shape[1]):
                plane[i, j] = line[i] + 10 * j
                for k in range(cube.shape[2]):
                    cube[i, j, k] = plane[i, j]
                    cube[i, j, k] += 100 * k

    i, j, k, lane = np.ogrid[:2, :3, :4, :width]
    line, plane, cube = (lane_table((2, 3, 4)[:n], width, any_size=any_size) for n in (1, 2, 3))
    line.array[:] = 1000.0 * np.arange(width)
    fill(line, plane, cube)
    assert_same(line.array, (1000.0 * lane + i)[:, 0, 0])
    assert_same(plane.array, (1000.0 * lane + i + 10 * j)[:, :, 0])
    assert_same(cube.array, 1000.0 * lane + i + 10 * j + 100 * k)


@pytest.mark.parametrize(("any_size", "compilations"), [(False, 2), (True, 1)])
def test_a_kernel_is_compiled_once_for_all_lengths_that_the_type_does_not_know(
    any_size, compilations
):
    @jit
    def last(plane):
        return plane[plane.shape[0] - 1, plane.shape[1] - 1]

    for shape in [(2, 3), (5, 3), (2, 4)]:  # the first length is never in the type
        table = lane_table(shape, 1, any_size=any_size)
        table.array[-1, -1] = math.prod(shape)
        assert last(table) == math.prod(shape)
    assert len(last.signatures) == compilations


def test_a_field_of_integers_counts_exactly_and_gives_indices(width):
    @jit
    def pick(places, counts, x, results):
        for n in range(places.size):
            results[n] = x[places[n]]
            counts[places[n], 1] += 1

    counts = np.full((3, 2), 2**53)  # the next integer is not a double
    x, results = in_lanes(np.arange(3.0 * width), width), lane_table((4,), width)
    places = np.array([2, 0, 2, 1])
    pick(FieldArray(places), FieldArray(counts), x, results)
    np.testing.assert_array_equal(counts - 2**53, [[0, 1], [0, 1], [0, 2]])
    assert_same(results.array, x.array[places])


@pytest.mark.parametrize("shape", [(3,), (2, 3, 5)])
def test_a_lane_table_is_zeros_that_begin_where_a_register_may_load_them(width, shape):
    tables = [lane_table(shape, width) for _ in range(9)]  # in different places
    for table in tables:
        assert table.address == table.array.ctypes.data
        assert table.address % 64 == 0  # bytes: eight doubles
        assert table.array.flags.c_contiguous
        assert_same(table.array, np.zeros((*shape, width)))


@jit
def swap(x):
    x[0], x[1] = x[1], x[0]


@pytest.mark.parametrize("first", [0, 3])
def test_lanes_may_begin_at_any_double(width, first):
    memory = lane_table((3,), 8).array.ravel()  # begins where a register does
    numbers = memory[first : first + 2 * width].reshape(2, width)
    numbers[:] = np.arange(2.0 * width).reshape(2, width)
    swap(FieldArray(numbers, width))
    assert_same(numbers, np.arange(2.0 * width).reshape(2, width)[::-1])
    assert memory.sum() == numbers.sum(), "the doubles beside them stay zero"


# What numba refuses.


def one_index_too_few(line, plane):
    return plane[1] > 0.0


def mask_plus_number(line, plane):
    (line[0] > 0.0) + 1.0


def branch_on_a_mask(line, plane):
    if line[0] > 0.0:
        line[0] = 0.0


def python_and_of_masks(line, plane):
    line[0] = select(line[0] > 0.0 and line[1] > 0.0, 1.0, 0.0)


def chained_comparison(line, plane):
    line[0] = select(0.0 < line[0] < 1.0, 1.0, 0.0)


@pytest.mark.parametrize(
    "kernel",
    [
        one_index_too_few,
        mask_plus_number,
        branch_on_a_mask,
        python_and_of_masks,
        chained_comparison,
    ],
)
def test_numba_refuses(kernel):
    with pytest.raises(TypingError):
        jit(kernel)(lane_table((3,), 4), lane_table((3, 4), 4))


def test_numba_refuses_lanes_of_two_widths():
    @jit
    def add(x, y):
        x[0] += y[0]

    with pytest.raises(TypingError):
        add(lane_table((1,), 4), lane_table((1,), 8))


@pytest.mark.parametrize(
    ("array", "width"),
    [
        (np.zeros((3, 4), np.float32), 4),
        (np.zeros((3, 4), bool), None),
        (np.zeros((4, 3)).T, None),
        (np.zeros((3, 8))[:, ::2], 4),
        (np.zeros((3, 4)), 8),
        (np.zeros((3, 4), np.int64), 4),
    ],
)
def test_arrays_that_kernels_would_read_wrongly_are_refused(array, width):
    with pytest.raises(ValueError):
        FieldArray(array, width)
