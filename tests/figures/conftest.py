"""Fixtures of the tests of figures."""

from __future__ import annotations

import pytest
import xarray
from helpers.made_up_walk import make_walk


@pytest.fixture(scope="session")
def walk() -> xarray.Dataset:
    """A walk of five tetrahedra."""
    return make_walk()
