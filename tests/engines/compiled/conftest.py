"""What the tests of the compiled engine start from."""

from __future__ import annotations

import pytest

from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario


@pytest.fixture
def compiled_scenario() -> Scenario:
    """The thesis scenario on the compiled engine."""
    return load_scenario("thesis").with_changes({"simulation.engine": "compiled"})
