"""Fixtures of several test modules."""

import contextlib
import os
import random
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from helpers.analytic import BOWL, record_run, small_scenario

from tetra_drake.engines.preparation import prepare
from tetra_drake.errors import InputError
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

Refused = Callable[..., contextlib.AbstractContextManager[None]]


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compiles all kernels before worker processes start, as each would compile them. With `-n 0`
    a test compiles what it calls.

    Python keeps the bytecode of what it imports, whatever the environment says: a hundred processes
    of tests would compile it again, for seconds each.
    """
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False
    option = session.config.option
    if getattr(option, "numprocesses", 0) and not option.collectonly:
        prepare()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Shuffles the tests by the seed in the variable ORDER, if there is one."""
    if seed := os.environ.get("ORDER"):
        random.Random(seed).shuffle(items)


@pytest.fixture(scope="session")
def prepared() -> None:
    """All kernels are compiled, for tests of what compiles nothing more."""
    prepare()


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    """The thesis scenario."""
    return load_scenario("thesis")


@pytest.fixture
def structure(scenario: Scenario) -> Structure:
    """Structure of the thesis's robot."""
    return Robot.of(scenario).structure


@pytest.fixture
def robot(scenario: Scenario) -> Robot:
    """The thesis's robot on its ground."""
    return Robot.of(scenario)


@pytest.fixture
def run_small(tmp_path):
    """run_small(name, ...): a small run in threads; its directory."""

    def run(name="run", *, seed=5, workers=2, evaluate=BOWL, resume=False, changes=None, **options):
        directory = tmp_path / name
        scenario = None if resume else small_scenario(**options).with_changes(changes or {})
        record_run(directory, scenario, seed=seed, evaluate=evaluate, workers=workers)
        return directory

    return run


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of the reference data; its README says what they are."""
    return Path(__file__).parent / "data"


@pytest.fixture(scope="session")
def refused() -> Refused:
    """refused(source, key, fact, ...): a block that must end with an InputError whose message is
    one line, names source and key, and contains the facts."""

    @contextlib.contextmanager
    def block(source: object, key: str, *facts: str) -> Iterator[None]:
        with pytest.raises(InputError) as caught:
            yield
        error = caught.value
        assert (error.source, error.key) == (str(source), key)
        source = str(source).replace("\0", r"\x00")
        assert str(error).startswith(f"{source}: {key}: " if key else f"{source}: ")
        assert all(fact in str(error) for fact in facts), str(error)
        assert len(str(error).splitlines()) == 1

    return block
