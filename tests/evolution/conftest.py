"""What several tests of evolution start from."""

import numpy as np
import pytest
from helpers.analytic import tasks_of

from tetra_drake.robot.gait import ParameterSpace


@pytest.fixture
def tasks(scenario):
    """Fifteen random gaits."""
    generator, space = np.random.default_rng(2), ParameterSpace.of(scenario)
    return tasks_of(space.random(generator) for _ in range(15))
