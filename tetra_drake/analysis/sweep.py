"""sweep(): gaits simulated on a grid of scenarios."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tetra_drake.engines.interface import Outcome
from tetra_drake.engines.simulate import simulate_many
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.robot.gait import Gait, given_gait
from tetra_drake.scenario.load import given_scenario
from tetra_drake.scenario.metric_units import METRICS
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.sections import flattened, tree_of

if TYPE_CHECKING:
    import xarray


def sweep(
    scenario: Scenario | str | Path,
    gaits: Gait | str | Path | Iterable[Gait | str | Path],
    changes: Mapping[str, Sequence[Any]],
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

    `changes` are lists of values by scenario keys; the same rules hold as in with_changes(), so
    quantities have units. Each key is a dimension, named by its last part where that is unique; its
    coordinate is in SI. The dimension `gait` has the names of the gaits. A simulation that fails is
    NaN. All are simulated at once by simulate_many(), on so many `workers`.

    Raises InputError, naming the key, for what cannot be used.
    """
    import xarray

    base = given_scenario(scenario)
    given = [gaits] if isinstance(gaits, (Gait, str, Path)) else gaits
    walkers = [given_gait(gait, base) for gait in given]
    if not walkers:
        raise InputError("sweep", "gaits", "found none, expected one at least")
    for key, values in changes.items():
        if isinstance(values, str) or not len(values):
            raise InputError("sweep", key, f"found {values!r}, expected a list of values")
    combinations = list(itertools.product(*changes.values()))
    scenarios = [base.with_changes(dict(zip(changes, each, strict=True))) for each in combinations]
    outcomes = simulate_many(
        [changed for changed in scenarios for _ in walkers],
        walkers * len(scenarios),
        workers=workers,
    )
    coordinates = {}
    for place, (key, values) in enumerate(changes.items()):
        along = [each[place] for each in combinations]
        firsts = [scenarios[along.index(value)] for value in values]
        name = _dimension(key, changes)
        coordinates[name] = _coordinate(name, key, values, firsts)
    coordinates["gait"] = ("gait", [gait.name for gait in walkers], {})
    shape = [len(labels) for _, labels, _ in coordinates.values()]
    variables = {}
    for name, unit in {"fitness": "", **METRICS}.items():
        numbers = np.array([_number(outcome, name) for outcome in outcomes]).reshape(shape)
        variables[name] = (list(coordinates), numbers, {"units": unit or "1"})
    return xarray.Dataset(variables, coordinates, {"scenario": base.name})


def _dimension(key: str, changes: Mapping[str, Any]) -> str:
    """The last part of a key, or all of it if the dataset has another use for the last part."""
    name = key.rpartition(".")[2]
    others = [other.rpartition(".")[2] for other in changes if other != key]
    return key if name in ("gait", "fitness", *METRICS, *others) else name


def _coordinate(
    name: str, key: str, values: Sequence[Any], scenarios: Sequence[Scenario]
) -> tuple[str, list[Any], dict[str, str]]:
    """Dimension, labels and attributes of a coordinate: SI numbers of the scenarios with these
    values, or the values as given where they are no numbers."""
    numbers = [flattened(changed.model_dump()).get(key) for changed in scenarios]
    if not all(isinstance(number, int | float) for number in numbers):
        return name, [value if isinstance(value, str) else str(value) for value in values], {}
    units = flattened(tree_of(scenarios[0], show=lambda _, unit: unit, sparse=False))
    unit = units[key]
    return name, numbers, {"units": unit if isinstance(unit, str) else "1"}


def _number(outcome: Outcome, name: str) -> float:
    """Fitness or a metric of a simulation; NaN if it failed."""
    if isinstance(outcome, SimulationFailure):
        return math.nan
    return outcome.fitness if name == "fitness" else float(getattr(outcome.metrics, name))
