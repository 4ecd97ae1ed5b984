"""What the tests of figures of a trajectory start from."""

from __future__ import annotations

import pytest
import xarray
from helpers.made_up_walk import make_walk


@pytest.fixture(scope="session")
def walk() -> xarray.Dataset:
    """Of five tetrahedra."""
    return make_walk()


@pytest.fixture(scope="session", params=[2, 3, 8])
def other_walk(request: pytest.FixtureRequest) -> xarray.Dataset:
    """Of another number of tetrahedra."""
    return make_walk(bodies=request.param)
