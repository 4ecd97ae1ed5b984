"""Allocation of tables. The annotations of a NamedTuple define their shapes.

class Motion(NamedTuple):
    state: Annotated[Table, "13 * bodies"]
    rows: Annotated[Table, "bodies", 6, "width"]
    passed: Annotated[Table, "bodies", int]
    least: Annotated[Table, 1, math.inf]

motion = allocate(Motion, {"bodies": 5, "width": 12})
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar, get_origin, get_type_hints

import numpy as np

NamedTupleT = TypeVar("NamedTupleT", bound=tuple)


def allocate(kind: type[NamedTupleT], sizes: Mapping[str, int]) -> NamedTupleT:
    """A NamedTuple of new tables.

    Args:
        kind: class of the NamedTuple. The annotation of a table has a length per dimension: a
            number, the name of a size, or a product. With `int`, the table has integers. With a
            float, all numbers have this value; otherwise they are 0. A field without annotation is
            a NamedTuple of tables.
        sizes: sizes by name.
    """
    fields = [
        field.filled(sizes) if isinstance(field, _Table) else allocate(field, sizes)
        for field in _fields(kind)
    ]
    return kind(*fields)


def write_tables(to: NamedTupleT, source: NamedTupleT) -> None:
    """Writes the numbers of a NamedTuple of tables to another one of the same sizes."""
    for ours, theirs in zip(to, source, strict=True):
        if isinstance(ours, tuple):
            write_tables(ours, theirs)
        else:
            ours[...] = theirs


@dataclass(frozen=True)
class _Table:
    """Table that an annotation defines."""

    shape: tuple[tuple[int | str, ...], ...]
    """Factors of each length: numbers, and names of sizes."""
    start: float
    """Value of all numbers."""
    kind: type
    """Type of the numbers."""

    def filled(self, sizes: Mapping[str, int]) -> np.ndarray:
        """A new table, for sizes by name."""
        shape = [
            math.prod(sizes[factor] if isinstance(factor, str) else factor for factor in length)
            for length in self.shape
        ]
        return np.full(shape, self.start, dtype=self.kind)


@functools.cache
def _fields(kind: type) -> list[Any]:
    """The fields of a NamedTuple: tables, and classes of further NamedTuples."""
    return [_table(hint) for hint in get_type_hints(kind, include_extras=True).values()]


def _table(hint: Any) -> Any:
    if get_origin(hint) is not Annotated:
        return hint
    marks = hint.__metadata__
    lengths = tuple(_factors(mark) for mark in marks if isinstance(mark, (int, str)))
    start = next((mark for mark in marks if isinstance(mark, float)), 0.0)
    return _Table(lengths, start, np.int64 if int in marks else np.float64)


def _factors(length: int | str) -> tuple[int | str, ...]:
    if isinstance(length, int):
        return (length,)
    factors = (factor.strip() for factor in length.split("*"))
    return tuple(int(factor) if factor.isdigit() else factor for factor in factors)
