"""Parameter sweep: `sweep` simulates gaits on a grid of scenarios."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from tetra_drake.engines.simulate import simulate_many
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.robot.gait_file import GivenGait, given_gait
from tetra_drake.robot.parameter_space import with_body
from tetra_drake.scenario.changes import given_changes
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.metrics import METRICS, UNITS
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.quantities import different_keys, separate
from tetra_drake.settings.section import Section, value_at

if TYPE_CHECKING:
    import xarray


MOST = 1_000_000
"""Largest number of simulations of a sweep."""


def sweep(
    scenario: GivenScenario,
    gaits: GivenGait | Iterable[GivenGait],
    changes: Mapping[str, Any],
    *,
    workers: int | None = None,
) -> xarray.Dataset:
    """Simulates gaits on a scenario with every combination of changed values. Returns their fitness
    and metrics.

        >>> scenario, run = td.load_scenario("quick"), td.load_run("runs/demo")
        >>> stiffness = {"robot.cables.outer_stiffness": ["25 N/m", "35 N/m", "45 N/m"]}
        >>> metrics = td.sweep(scenario, run.gaits(), stiffness)
        >>> dict(metrics.distance.sizes)
        {'outer_stiffness': 3, 'gait': 1}
        >>> mean = metrics.distance.mean("gait").sel(outer_stiffness=35)

    Each key of `changes` is a dimension of the result. Keys that are joined by commas get the same
    value, such as "friction.static, friction.kinetic". The name of the dimension is the last part
    of the key, or the whole key if the last part is not unique. Coordinates are in SI. The
    dimension `gait` has the names of the gaits. A failed simulation is NaN.

    Args:
        scenario: a scenario, its name or file, or a run.
        gaits: a gait, its file or a run, or several of these.
        changes: a value or a list of values by scenario key. Quantities need units, as in
            Scenario.with_changes().
        workers: number of threads, see simulate_many().

    Raises:
        InputError: names the key that cannot be used.
    """
    import xarray

    base = given_scenario(scenario)
    given = gaits if isinstance(gaits, Iterable) and not isinstance(gaits, str) else [gaits]
    walkers = [given_gait(gait, base) for gait in given]
    if not walkers:
        raise InputError("sweep", "gaits", "found none, expected one at least")
    swept = different_keys(given_changes(changes, "sweep"), source="sweep")
    changes = {key: _values(key, values) for key, values in swept.items()}
    count = len(walkers) * math.prod(len(values) for values in changes.values())
    if count > MOST:
        raise InputError("sweep", "changes", f"found {count} simulations, expected at most {MOST}")
    grid = [dict(zip(changes, each, strict=True)) for each in itertools.product(*changes.values())]
    scenarios = [with_joined_changes(base, each) for each in grid]
    bodies = [with_body(base, gait) for gait in walkers]
    walks = [
        (changed if own is base else with_joined_changes(own, each), bare)
        for each, changed in zip(grid, scenarios, strict=True)
        for own, bare in bodies
    ]
    outcomes = simulate_many(
        [changed for changed, _ in walks],
        [bare for _, bare in walks],
        workers=workers,
    )

    labels = {}
    for key, values in changes.items():
        along = [each[key] for each in grid]
        firsts = [scenarios[along.index(value)] for value in values]
        name = key.rpartition(".")[2]
        taken = [other.rpartition(".")[2] for other in changes if other != key]
        dimension = key if name in ("gait", "fitness", *METRICS, *taken) else name
        numbers = [value_at(each.model_dump(), separate(key)[-1]) for each in firsts]
        if all(isinstance(number, int | float) for number in numbers):
            labels[dimension] = numbers, {"units": getattr(numbers[0], "unit", "1")}
        else:
            labels[dimension] = [str(value) for value in values], {}
    labels["gait"] = [gait.name for gait in walkers], {}
    shape = [len(values) for values, _ in labels.values()]
    results = [None if isinstance(each, SimulationFailure) else each for each in outcomes]
    rows = [{"fitness": each.fitness, **vars(each.metrics)} if each else {} for each in results]
    variables = {}
    for name, unit in {"fitness": "", **UNITS}.items():
        found = np.reshape([row.get(name, math.nan) for row in rows], shape)
        variables[name] = list(labels), found, {"units": unit or "1"}

    coordinates = {name: (name, *given) for name, given in labels.items()}
    return xarray.Dataset(variables, coordinates, {"scenario": base.name})


def _values(key: str, given: Any) -> Collection[Any]:
    """The values of a swept key as a collection; a single value becomes a list of one. Raises
    InputError, naming the key, if there is none."""
    if hasattr(given, "tolist"):
        given = given.tolist()
    is_one = isinstance(given, (str, bytes, Mapping, Section)) or not isinstance(given, Collection)
    values = [given] if is_one else given
    if not len(values):
        raise InputError("sweep", key, "found no value, expected one at least")
    return values


def with_joined_changes(scenario: Scenario, by_joined: Mapping[str, Any]) -> Scenario:
    """A copy of the scenario with changed values. `by_joined` has the value for a key, or for
    several keys joined by commas, which all get it. See Scenario.with_changes().

    Raises InputError, naming the key. If a limit makes two keys of a section depend on each other,
    the message advises to join them, such as "friction.static, friction.kinetic".
    """
    changes = {key: value for joined, value in by_joined.items() for key in separate(joined)}
    try:
        return scenario.with_changes(changes)
    except InputError as error:
        problem, refused = error.problem, error.key
        for key, value in changes.items():
            alike = key.rpartition(".")[0] == refused.rpartition(".")[0]
            if refused not in changes and alike:
                with contextlib.suppress(InputError):
                    scenario.with_changes({**changes, refused: value})
                    problem += f"; the joined keys '{key}, {refused}' get the same value"
                    break
        raise InputError(error.source, refused, problem) from error
