"""What several tests of evolution start from."""

from collections.abc import Iterator

import numpy as np
import pytest
from helpers.analytic import tasks_of

from tests.engines.conftest import engine as engine
from tetra_drake.evolution import evaluators
from tetra_drake.evolution.evaluators import LentExecutor, WorkerProcesses
from tetra_drake.robot.parameter_space import ParameterSpace


@pytest.fixture(scope="session")
def one_process() -> Iterator[LentExecutor]:
    """A worker process, which starts once for all tests and is replaced after 50 tasks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluators, "TASKS_PER_WORKER", 50)
        executor = WorkerProcesses(1)
    yield LentExecutor(executor)
    executor.shutdown()


@pytest.fixture
def tasks(scenario):
    """Fifteen random gaits."""
    generator, space = np.random.default_rng(2), ParameterSpace.of(scenario)
    return tasks_of(space.random(generator) for _ in range(15))
