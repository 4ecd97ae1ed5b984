"""What tests of all engines share."""

import pytest

from tetra_drake.engines.mujoco import INSTALL, installed

NEEDS_MUJOCO = pytest.mark.skipif(not installed(), reason=INSTALL)


@pytest.fixture(params=["!Compiled", "!Drake", pytest.param("!Mujoco", marks=NEEDS_MUJOCO)])
def engine(request: pytest.FixtureRequest) -> str:
    """Each engine, as a scenario names it."""
    return request.param
