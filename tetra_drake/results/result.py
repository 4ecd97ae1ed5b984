"""SimulationResult, which every engine returns, and result.json, made from it."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.files import json_number, write_whole
from tetra_drake.machine import versions
from tetra_drake.physics.tally import Tally
from tetra_drake.results.metrics import (
    compute_fitness,
    compute_metrics,
)
from tetra_drake.results.path import PERIOD, CentrePath, follow
from tetra_drake.results.trajectory import sample_times
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.structure import Structure, node_positions
from tetra_drake.scenario.metric_units import Metrics
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.settings import SimulationSection
from tetra_drake.scenario.units import INCH

if TYPE_CHECKING:
    import xarray

SCHEMA = 1


@dataclass(frozen=True)
class IntegratorWork:
    """What the integrator was asked for and what that took."""

    scheme: str
    accuracy: float
    """Drake's target accuracy, the compiled engine's tolerance (m/s), or MuJoCo's step (s)."""
    steps: int
    derivative_evaluations: int
    jacobian_evaluations: int = 0
    """Derivative evaluations that went into Jacobian columns, among those above."""


@dataclass(frozen=True)
class SimulationResult:
    """What simulate() returns."""

    metrics: Metrics
    fitness: float
    duration: float
    """Simulated time in s."""
    wall_time: float
    """Time from the start of the integration to its end, in s; building is not in it."""
    integrator: IntegratorWork
    engine: str
    """That of the scenario."""
    path: CentrePath = field(repr=False, compare=False)
    """Of the robot's centre from start to end, in steps of results.path.PERIOD."""
    trajectory: xarray.Dataset | None = field(default=None, repr=False)
    """See results.trajectory.assemble_dataset; None unless asked for."""


def result_times(simulation: SimulationSection) -> np.ndarray:
    """The times (s), ascending, at which make_result() needs the states of a simulation."""
    return np.unique([*_ends(simulation), *_path_times(simulation)])


def _ends(simulation: SimulationSection) -> tuple[float, float, float]:
    return 0.0, simulation.steady_from, simulation.duration


def _path_times(simulation: SimulationSection) -> np.ndarray:
    return sample_times(simulation.duration, PERIOD)


def make_result(
    scenario: Scenario,
    structure: Structure,
    *,
    times: np.ndarray,
    states: np.ndarray,
    signals: np.ndarray,
    totals: Tally,
    mass: float,
    wall_time: float,
    integrator: IntegratorWork,
    trajectory: xarray.Dataset | None,
) -> SimulationResult:
    """The result of a simulation on the scenario's engine.

    `times` (k,) in s, ascending, are those of result_times(), and maybe more; `states` (k, 13 n)
    are [q; v] of the bodies and `signals` (k, m) those of the oscillators, in N, then; `totals` are
    of the whole simulation; `mass` of a tetrahedron in kg, `wall_time` in s.
    """
    simulation, bodies = scenario.simulation, len(structure.bodies)
    ends = np.searchsorted(times, _ends(simulation))
    start, steady, end = (node_positions(structure, states[i]) for i in ends)
    instants = _path_times(simulation)
    rows = np.searchsorted(times, instants)
    poses = states[rows, : 7 * bodies].reshape(-1, bodies, 7)
    path = follow(instants, poses)
    metrics = compute_metrics(
        structure,
        start=start,
        steady=steady,
        end=end,
        path=path,
        steady_from=simulation.steady_from,
        totals=totals,
        signals=signals[rows[instants >= simulation.steady_from]],
        weight=bodies * mass * scenario.robot.gravity,
    )
    return SimulationResult(
        metrics=metrics,
        fitness=compute_fitness(metrics, scenario.objective),
        duration=simulation.duration,
        wall_time=wall_time,
        integrator=integrator,
        engine=scenario.engine_name,
        path=path,
        trajectory=trajectory,
    )


def save_result(path: str | Path, scenario: Scenario, gait: Gait, result: SimulationResult) -> None:
    """Writes result.json: metrics in SI, lengths in inches beside them, times in s, and the path of
    the centre as columns."""
    way, radius = result.path, result.metrics.path_radius
    content = {
        "schema": SCHEMA,
        "scenario": scenario.name,
        "metrics": result.metrics.to_json(),
        **result.metrics.in_inches(),
        "path_radius_in": json_number(radius / INCH),
        "fitness": result.fitness,
        "duration_s": result.duration,
        "wall_time_s": result.wall_time,
        "real_time_factor": result.duration / result.wall_time,
        "engine": result.engine,
        "integrator": dataclasses.asdict(result.integrator),
        "versions": versions(result.engine),
        "gait": gait.to_json(scenario),
        "path": {
            "time_s": way.times.tolist(),
            "x_m": way.centre[:, 0].tolist(),
            "y_m": way.centre[:, 1].tolist(),
            "heading_rad": way.heading.tolist(),
        },
    }
    write_whole(path, json.dumps(content, indent=1, allow_nan=False) + "\n")
