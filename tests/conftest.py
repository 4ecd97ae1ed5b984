"""What several test modules start from."""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from helpers.analytic import BOWL, record_run, small_scenario
from helpers.widths import WIDEST

from tetra_drake.engines.compiled import lane_pool, lane_stepper
from tetra_drake.errors import InputError
from tetra_drake.robot.robot import Robot, make_structure
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

Refused = Callable[..., contextlib.AbstractContextManager[None]]


ORDER = (
    *("engines/compiled/test_many.py", "engines", "systems", "diagrams", "robot", "scenario"),
    *("figures", "physics", "simd", "optimizers"),
    *(f"evolution/test_{name}" for name in ("run", "trials", "evaluators", "kill", "cluster")),
    *("analysis", "evolution", ""),
)
"""The folders of tests, those first that compile most; what walks in lanes is later in the second
half, when the first test has compiled for it."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Orders the tests so that one of two worker processes compiles for both: the other one begins
    in the middle, with tests that compile little."""

    def rank(item: pytest.Item) -> int:
        path = item.path.relative_to(Path(__file__).parent).as_posix()
        return next(i for i, start in enumerate(ORDER) if path.startswith(start))

    items.sort(key=rank)


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    """The thesis scenario."""
    return load_scenario("thesis")


@pytest.fixture
def structure(scenario: Scenario) -> Structure:
    """That of the thesis's robot."""
    return make_structure(scenario)


@pytest.fixture
def robot(scenario: Scenario) -> Robot:
    """The thesis's robot on its ground."""
    return Robot.of(scenario)


@pytest.fixture(autouse=True, scope="session")
def few_widths() -> Iterator[None]:
    """One lane or as many as fit this processor, as each width is compiled for half a minute or
    more; the numbers are the same with any."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (lane_pool, lane_stepper):
            patch.setattr(module, "lanes_for", lambda walks: 1 if walks <= 1 else WIDEST)
        yield


@pytest.fixture
def one_lane(monkeypatch) -> None:
    """One lane for any number of robots, as a structure in which bodies are coupled otherwise than
    in the row has kernels of its own."""
    for module in (lane_pool, lane_stepper):
        monkeypatch.setattr(module, "lanes_for", lambda walks: 1)


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
