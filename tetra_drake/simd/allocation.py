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
from typing import Annotated, Any, TypeVar, get_origin, get_type_hints

import numpy as np

Record = TypeVar("Record", bound=tuple)


def allocate(kind: type[Record], sizes: Mapping[str, int], **given: object) -> Record:
    """A NamedTuple of new tables.

    Args:
        kind: class of the NamedTuple. The annotation of a table has a length per dimension: a
            number, the name of a size, or a product. With `int`, the table has integers. With a
            float, all numbers have this value; otherwise they are 0. A field without annotation is
            a NamedTuple of tables.
        sizes: sizes by name.
        given: values of fields that are not allocated.
    """
    fields: dict[str, Any] = {}
    for name, hint in _hints(kind).items():
        if name in given:
            fields[name] = given[name]
        elif get_origin(hint) is Annotated:
            marks = hint.__metadata__
            shape = [_length(mark, sizes) for mark in marks if isinstance(mark, (int, str))]
            start = next((mark for mark in marks if isinstance(mark, float)), 0.0)
            fields[name] = np.full(shape, start, dtype=np.int64 if int in marks else np.float64)
        else:
            fields[name] = allocate(hint, sizes)
    return kind(**fields)


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)


def _length(length: int | str, sizes: Mapping[str, int]) -> int:
    if isinstance(length, int):
        return length
    factors = (factor.strip() for factor in length.split("*"))
    return math.prod(int(factor) if factor.isdigit() else sizes[factor] for factor in factors)
