"""Conversion of NamedTuples of arrays to tables in lanes, which have a column per robot."""

from __future__ import annotations

from typing import Any

import numpy as np

from tetra_drake.kernels.lanes import FieldArray, lane_table


def numbers_of(values: Any) -> np.ndarray:
    """All numbers of the float64 arrays in nested NamedTuples, in one row (numbers,), field after
    field. Arrays of indices are left out."""
    tables = [np.zeros(0)]

    def collect(value: Any) -> None:
        if isinstance(value, tuple):
            for part in value:
                collect(part)
        elif _is_real(value):
            tables.append(value.ravel())

    collect(values)
    return np.concatenate(tables)


def shared(values: Any) -> Any:
    """Parts of NamedTuples of arrays that must be the same in all lanes, as nested tuples that can
    be compared: indices, Booleans, and the shapes of the tables of float64 numbers."""
    if isinstance(values, tuple):
        return tuple(map(shared, values))
    if not isinstance(values, np.ndarray):
        return values
    return (values.shape, None if _is_real(values) else values.tobytes())


def views(values: Any, numbers: np.ndarray, *, lanes: bool = False) -> Any:
    """NamedTuples like `values` whose arrays of real numbers are views of `numbers`.

    The first axis of `numbers` is in the order of numbers_of(). With `lanes`, its second axis is
    the lanes: all arrays become fields of kernels, and arrays of indices are copied.
    """
    first = 0

    def view(value: Any) -> Any:
        nonlocal first
        if isinstance(value, tuple):
            return getattr(type(value), "_make", tuple)(map(view, value))
        if not _is_real(value):
            is_field = lanes and isinstance(value, np.ndarray)
            return FieldArray(value.copy()) if is_field else value
        rows = numbers[first : first + value.size].reshape(*value.shape, *numbers.shape[1:])
        first += value.size
        return FieldArray(rows, numbers.shape[1]) if lanes else rows

    return view(values)


def numbered(values: Any) -> Any:
    """NamedTuples like `values` with each float64 number replaced by its index in the row of
    numbers_of()."""
    return views(values, np.arange(numbers_of(values).size, dtype=float))


def in_lanes(values: Any, width: int) -> tuple[Any, np.ndarray]:
    """NamedTuples like `values` whose tables have `width` lanes, and the tables' memory (numbers,
    width). At first all lanes have the numbers of `values`. They share the arrays of indices."""
    numbers = numbers_of(values)
    memory = lane_table(numbers.shape, width).array
    memory[:] = numbers[:, np.newaxis]
    return views(values, memory, lanes=True), memory


def _is_real(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype == np.float64
