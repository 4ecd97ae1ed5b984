"""Arguments that are packed once for all calls of a kernel."""

from typing import NamedTuple

import numpy as np
import pytest

from tetra_drake.kernels.compiling import compiled, machine_code
from tetra_drake.kernels.lanes import Table
from tetra_drake.kernels.packed import Packed, unpacked


class Inner(NamedTuple):
    count: int
    weights: Table
    flips: bool


class Outer(NamedTuple):
    flag: bool
    inner: Inner
    matrix: Table
    indices: Table


@compiled
def gather_sums(parts: Packed[tuple[Outer, Table]], x: Table) -> float:
    """Writes to the second part, and returns, a sum in which each value of the first counts."""
    outer, sums = unpacked(parts)
    inner, total = outer.inner, 0.0
    for i in range(outer.matrix.shape[0]):
        sums[i] = 0.0
        for j in range(outer.matrix.shape[1]):
            sums[i] += outer.matrix[i, j] * inner.weights[j]
        sums[i] *= -1.0 if inner.flips else 1.0
        total += x[0] * sums[outer.indices[i]] if outer.flag else 0.0
    return total + inner.count


def parts_of(*, flag: bool = True, flips: bool = False, rows: int = 2) -> tuple[Outer, Table]:
    matrix = np.arange(3.0 * rows).reshape(rows, 3)
    inner = Inner(7, np.array([1.0, 10.0, 100.0]), flips)
    return Outer(flag, inner, matrix, np.arange(rows)), np.zeros(rows)


@pytest.mark.parametrize(("flag", "flips"), [(True, False), (True, True), (False, False)])
def test_a_kernel_gets_all_that_is_packed(flag, flips):
    parts, x = parts_of(flag=flag, flips=flips), np.array([0.5])
    sign, total = (-1.0 if flips else 1.0), (0.5 * (210.0 + 543.0) if flag else 0.0)
    for call in (gather_sums, machine_code(gather_sums, Packed(parts), x), gather_sums.py_func):
        assert call(Packed(parts), x) == sign * total + 7
    assert parts[1].tolist() == [sign * 210.0, sign * 543.0]
    assert gather_sums(parts, x) == gather_sums.py_func(parts, x) == sign * total + 7


def test_robots_of_any_size_share_machine_code():
    x = np.array([1.0])
    codes = {machine_code(gather_sums, Packed(parts_of(rows=rows)), x) for rows in (1, 2, 5)}
    assert len(codes) == 1


@pytest.mark.parametrize(
    "array", [np.zeros((2, 4))[:, ::2], np.zeros(2, dtype=np.float32)], ids=["strides", "single"]
)
def test_an_array_that_kernels_would_misread_is_refused(array):
    with pytest.raises(ValueError, match="no field"):
        Packed((array,))
