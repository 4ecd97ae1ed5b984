"""Tables in lanes: the numbers of NamedTuples in one table, with a column per lane."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from tetra_drake.kernels.lanes import FieldArray, lane_table


def numbers_of(values: Any) -> np.ndarray:
    """The real numbers of NamedTuples of arrays, in a row."""
    return np.concatenate([np.zeros(0), *(array.ravel() for array in _arrays(values))])


def shared(values: Any) -> Any:
    """Everything of NamedTuples of arrays that lanes share: indices, truths, and the shapes of the
    tables of real numbers."""
    if isinstance(values, tuple):
        return tuple(shared(value) for value in values)
    if not isinstance(values, np.ndarray):
        return values
    return (values.shape, None if _is_real(values) else values.tobytes())


def views(values: Any, numbers: np.ndarray) -> Any:
    """NamedTuples like `values`, with views of `numbers` (numbers, ...) in place of the arrays of
    real numbers. Other values stay as they are."""
    first = 0

    def view(value: Any) -> Any:
        nonlocal first
        if isinstance(value, tuple):
            return type(value)(*map(view, value))
        if not _is_real(value):
            return value
        rows = numbers[first : first + value.size]
        first += value.size
        return rows.reshape(*value.shape, *numbers.shape[1:])

    return view(values)


def numbered(values: Any) -> Any:
    """NamedTuples like `values`, with the index of each number in numbers_of() in its place."""
    return views(values, np.arange(numbers_of(values).size, dtype=float))


def in_lanes(values: Any, width: int) -> tuple[Any, np.ndarray]:
    """Tables in lanes for NamedTuples of arrays, and their memory (numbers, lanes). All lanes have
    the numbers of `values`. They share the arrays of indices."""
    numbers = numbers_of(values)
    memory = lane_table(numbers.shape, width).array
    memory[:] = numbers[:, np.newaxis]
    return _fields(views(values, memory), width), memory


def _fields(values: Any, width: int) -> Any:
    if isinstance(values, tuple):
        return type(values)(*(_fields(value, width) for value in values))
    if not isinstance(values, np.ndarray):
        return values
    return FieldArray(values, width) if _is_real(values) else FieldArray(values.copy())


def _arrays(values: Any) -> Iterator[np.ndarray]:
    if isinstance(values, tuple):
        for value in values:
            yield from _arrays(value)
    elif _is_real(values):
        yield values


def _is_real(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype == np.float64
