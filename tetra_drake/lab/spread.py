"""Spread of a gait: ranges of its metrics if the start moves by less than any robot can be placed.

spreads.jsonl    ranges of the metrics of a run's best gait, one line per gait
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tetra_drake.engines.engine import engine_of
from tetra_drake.engines.simulate import simulate_many
from tetra_drake.errors import check_whole
from tetra_drake.evolution.entries import SPREADS, SpreadLine
from tetra_drake.evolution.run import load_run
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import Command
from tetra_drake.robot.gait_file import GivenGait, given_gait
from tetra_drake.scenario.disturbances import Draw, disturbed
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.metrics import METRICS

MOVES = np.geomspace(1e-9, 1e-7, 30)
"""Sizes (m) of the moves: each body starts moved by at most this length along each axis."""

WORTH = 20
"""A spread on an engine without lanes is simulated only after this many times as many simulations
in the search, so that it costs less than 5 % of them."""


def spread(
    scenario: GivenScenario,
    gait: GivenGait | Command,
    *,
    seed: int = 0,
    workers: int | None = None,
) -> dict[str, list[float]]:
    """Ranges of the metrics of a gait for 31 starts that differ by at most 1e-7 m.

        >>> low, high = td.spread("quick", "gait.json")["distance"]

    A range is wide if the motion is chaotic: then a distance of four digits tells nothing about a
    real robot, nor about another simulator. The starts are the scenario's own, and 30 where each
    body is moved at random, by 1 nm to 1e-7 m. The disturbances of a scenario are left out. The
    compiled engine stands in for the Drake diagram.

    Args:
        scenario: a scenario, its name or file, or a run.
        gait: a gait, its file, or a run (its best gait); or a command for actuators.
        seed: seed of the moves.
        workers: number of threads, see simulate_many().

    Returns:
        The least and the greatest value of each metric, by name, in SI units; without metrics that
        are not finite.

    Raises:
        Diverged, StepBudgetExceeded: if a simulation fails.
        InputError: if an argument does not fit the scenario.
    """
    check_whole("spread", "seed", seed, least=0)
    scenario = given_scenario(scenario)
    driver = gait if isinstance(gait, Command) else given_gait(gait, scenario)
    if not engine_of(scenario).has_threads:
        scenario = scenario.on_engine("compiled")
    shape = (len(MOVES), scenario.robot.body_count, 3)
    moves = MOVES[:, np.newaxis, np.newaxis] * np.random.default_rng(seed).uniform(-1, 1, shape)
    moves[..., 2] = np.abs(moves[..., 2])  # not into the ground
    draws = [Draw({}), *(Draw({}, moves=each) for each in moves)]
    starts = [disturbed(scenario, draw) for draw in draws]
    metrics = []
    for outcome in simulate_many(starts, [driver] * len(starts), workers=workers):
        if not isinstance(outcome, SimulationResult):
            raise outcome
        metrics.append(outcome.metrics)
    values = {name: np.array([getattr(each, name) for each in metrics]) for name in METRICS}
    finite = {name: numbers for name, numbers in values.items() if np.isfinite(numbers).all()}
    return {name: [float(x.min()), float(x.max())] for name, x in finite.items()}


def record_spread(directory: Path, *, workers: int | None = None) -> None:
    """Simulates the spread of a run's best gait (see spread()) and records it in the run's folder.

    Nothing is done if it is recorded already, if no gait has a fitness, or if it would cost more
    than 5 % of a search without lanes. Neither with disturbances, as the metrics are then means.
    `workers` is the number of threads.
    """
    run = load_run(directory)
    scenario = run.scenario
    is_cheap = engine_of(scenario).lanes > 1 or len(run.evaluations) >= WORTH * len(MOVES)
    if run.best().empty or scenario.disturbances or not is_cheap:
        return
    file, best = run.file(SPREADS), run.fittest()
    file.repair()
    if run.spread_of(best):
        return
    trial, index = int(best["trial"]), int(best["index"])
    ranges = spread(scenario, run.gait(trial, index), workers=workers)
    file.append([SpreadLine(trial=trial, index=index, spread=ranges)])
