"""Tables whose shapes stand in annotations."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
import pytest

from tetra_drake.simd.allocation import allocate
from tetra_drake.simd.lanes import Table

COLUMNS = 4


class Part(NamedTuple):
    counts: Annotated[Table, "bodies", int]
    least: Annotated[Table, 1, math.inf]


class Whole(NamedTuple):
    state: Annotated[Table, "13 * bodies"]
    rows: Annotated[Table, "bodies", COLUMNS, "2 * cables"]
    part: Part
    other: Part


SIZES = {"bodies": 3, "cables": 5}


def test_tables_have_the_shapes_and_kinds_of_their_annotations():
    whole = allocate(Whole, SIZES)
    assert (whole.state.shape, whole.rows.shape) == ((39,), (3, 4, 10))
    assert whole.part.counts.shape == (3,)
    assert (whole.state.dtype, whole.part.counts.dtype) == (np.float64, np.int64)
    assert not whole.state.any() and not whole.rows.any()
    assert whole.part.least.tolist() == [math.inf]
    assert whole.part.counts is not whole.other.counts


def test_a_given_field_is_kept():
    part = Part(np.ones(2, dtype=np.int64), np.ones(1))
    assert allocate(Whole, SIZES, other=part).other is part


def test_a_size_that_is_not_given_is_an_error():
    with pytest.raises(KeyError, match="cables"):
        allocate(Whole, {"bodies": 3})
