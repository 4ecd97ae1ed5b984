"""sweep(): gaits simulated on a grid of scenarios."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tetra_drake.engines.interface import Outcome
from tetra_drake.engines.simulate import simulate_many
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.robot.gait import GivenGait, given_gait
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.metrics import METRICS
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.section import flattened

if TYPE_CHECKING:
    import xarray


def sweep(
    scenario: GivenScenario,
    gaits: GivenGait | Iterable[GivenGait],
    changes: Mapping[str, Any],
    *,
    workers: int | None = None,
) -> xarray.Dataset:
    """Fitness and metrics of gaits on a scenario with every combination of changed values.

        >>> scenario, run = td.load_scenario("quick"), td.load_run("runs/demo")
        >>> stiffness = {"robot.cables.outer_stiffness": ["25 N/m", "35 N/m", "45 N/m"]}
        >>> metrics = td.sweep(scenario, run.gaits(), stiffness)
        >>> dict(metrics.distance.sizes)
        {'outer_stiffness': 3, 'gait': 1}
        >>> mean = metrics.distance.mean("gait").sel(outer_stiffness=35)

    `changes` are values, or lists of values, by scenario keys; the same rules hold as in
    with_changes(), so quantities have units. Each key is a dimension, named by its last part where
    that is unique; its coordinate is in SI. The dimension `gait` has the names of the gaits. A
    simulation that fails is NaN. All are simulated at once by simulate_many(), on so many
    `workers`.

    Raises InputError, naming the key, for what cannot be used.
    """
    import xarray

    base = given_scenario(scenario)
    given = gaits if isinstance(gaits, Iterable) and not isinstance(gaits, str) else [gaits]
    walkers = [given_gait(gait, base) for gait in given]
    if not walkers:
        raise InputError("sweep", "gaits", "found none, expected one at least")
    changes = {key: _values(key, values) for key, values in changes.items()}
    combinations = list(itertools.product(*changes.values()))
    scenarios = [base.with_changes(dict(zip(changes, each, strict=True))) for each in combinations]
    outcomes = simulate_many(
        [changed for changed in scenarios for _ in walkers],
        walkers * len(scenarios),
        workers=workers,
    )
    labels = {}
    for place, (key, values) in enumerate(changes.items()):
        along = [each[place] for each in combinations]
        firsts = [scenarios[along.index(value)] for value in values]
        labels[_dimension(key, changes)] = _labels(key, values, firsts)
    labels["gait"] = [gait.name for gait in walkers], {}
    shape = [len(values) for values, _ in labels.values()]
    rows = [_numbers(outcome) for outcome in outcomes]
    variables = {}
    for name, unit in {"fitness": "", **METRICS}.items():
        numbers = np.reshape([row[name] for row in rows], shape)
        variables[name] = list(labels), numbers, {"units": unit or "1"}
    coordinates = {name: (name, *given) for name, given in labels.items()}
    return xarray.Dataset(variables, coordinates, {"scenario": base.name})


def _values(key: str, given: Any) -> list[Any]:
    """The values of a key, of which a single one may be given."""
    is_single = isinstance(given, (str, Mapping)) or not isinstance(given, Iterable)
    values = [given] if is_single else list(given)
    if not values:
        raise InputError("sweep", key, "found no value, expected one at least")
    return values


def _dimension(key: str, changes: Iterable[str]) -> str:
    """The last part of a key, or all of it if the dataset has another use for the last part."""
    name = key.rpartition(".")[2]
    others = [other.rpartition(".")[2] for other in changes if other != key]
    return key if name in ("gait", "fitness", *METRICS, *others) else name


def _labels(
    key: str, values: Iterable[Any], scenarios: Sequence[Scenario]
) -> tuple[list[Any], dict[str, str]]:
    """The SI numbers at a key of scenarios, and their unit; where they are no numbers, the values
    as given."""
    numbers = [flattened(changed.model_dump()).get(key) for changed in scenarios]
    if not all(isinstance(number, int | float) for number in numbers):
        return [str(value) for value in values], {}
    return numbers, {"units": getattr(numbers[0], "unit", "1")}


def _numbers(outcome: Outcome) -> dict[str, float]:
    """Fitness and metrics of a simulation; NaN if it failed."""
    if isinstance(outcome, SimulationFailure):
        return dict.fromkeys(("fitness", *METRICS), math.nan)
    return {"fitness": outcome.fitness, **vars(outcome.metrics)}
