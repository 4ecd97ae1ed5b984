"""simulate() and simulate_many(): gaits on scenarios, by the engine that a scenario names."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from pathlib import Path

from tetra_drake.engines.viewer import Viewer, check_can_be_watched
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.machine import available_cores
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait, seeded_gait
from tetra_drake.robot.robot import Robot, SteeringSignal, constant_steering
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario

_BRIEF = 0.01
"""Duration (s) of a simulation that only compiles."""


def simulate(
    *,
    scenario: Scenario | str | Path,
    gait: Gait,
    record: bool = False,
    viewer: Viewer | None = None,
    steering: SteeringSignal | float | None = None,
) -> SimulationResult:
    """Simulates the scenario's robot walking by a gait for the scenario's duration, on the
    engine that the scenario names.

    `scenario` may be the name of a shipped one or a file. `steering`, the turn from -1 to 1, or a
    function of the time in s that gives it, acts in place of the gait's turn.

    Pure: the same scenario and gait give the same numbers, bit for bit, wall time aside,
    whether or not a trajectory is recorded and whoever watches.

    Raises Diverged or StepBudgetExceeded, which say when and why, and InputError if the gait or
    the steering does not fit the scenario, or if its engine cannot be watched.
    """
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    if steering is not None and not callable(steering):
        steering = constant_steering(steering)
    robot = Robot.of(scenario)
    if scenario.engine_name == "drake":
        from tetra_drake.engines.drake import simulate_drake

        return simulate_drake(robot, gait, record=record, viewer=viewer, steering=steering)
    if viewer is not None:
        check_can_be_watched(scenario)
    if scenario.engine_name == "compiled":
        from tetra_drake.engines.compiled.engine import simulate_compiled as run
    else:
        from tetra_drake.engines.mujoco import simulate_mujoco as run
    return run(robot, gait, record=record, steering=steering)


def simulate_many(
    *,
    scenario: Scenario | str | Path | Sequence[Scenario],
    gaits: Sequence[Gait],
    record: bool = False,
    workers: int | None = None,
) -> list[SimulationResult | SimulationFailure]:
    """Simulates many gaits, on one scenario or each on its own, as simulate() does; the results
    in the order of the gaits, for one that fails its Diverged or StepBudgetExceeded.

    On the compiled engine, `workers` threads (one per core by default) simulate several gaits side
    by side in the registers of each core: the same numbers, bit for bit, several times as fast.
    Scenarios may differ; those with the same number of tetrahedra, `cables.slack` and kind of
    signals share a core.

    On the engine `mujoco`, MuJoCo's rollout simulates the gaits of one scenario on `workers`
    threads. Otherwise, as on the diagram, one gait is simulated after another.

    Raises InputError if there is not one scenario or as many as gaits, or if a gait does not fit.
    """
    if isinstance(scenario, (str, Path)):
        scenario = load_scenario(scenario)
    scenarios = [scenario] * len(gaits) if isinstance(scenario, Scenario) else list(scenario)
    if len(scenarios) != len(gaits):
        problem = f"found {len(scenarios)}, expected one, or one for each of {len(gaits)} gaits"
        raise InputError("simulate_many", "scenario", problem)
    threads = available_cores() if workers is None else workers
    if threads < 1:
        raise InputError("simulate_many", "workers", f"found {workers}, expected at least 1")
    if all(each.engine_name == "compiled" for each in scenarios):
        from tetra_drake.engines.compiled.lane_pool import simulate_in_lanes

        pairs = list(zip(scenarios, gaits, strict=True))
        return simulate_in_lanes(pairs, record=record, threads=threads)
    if isinstance(scenario, Scenario) and scenario.engine_name == "mujoco":
        from tetra_drake.engines.mujoco import simulate_in_rollouts

        robot = Robot.of(scenario)
        return simulate_in_rollouts(robot, gaits, record=record, threads=threads)
    found: list[SimulationResult | SimulationFailure] = []
    for own, gait in zip(scenarios, gaits, strict=True):
        try:
            found.append(simulate(scenario=own, gait=gait, record=record))
        except SimulationFailure as failure:
            found.append(failure)
    return found


def check_scenario(scenario: Scenario) -> None:
    """Raises InputError if the scenario's engine cannot simulate it, say, as the robot would start
    in the ground."""
    Robot.of(scenario)
    if scenario.engine_name == "mujoco":
        from tetra_drake.engines.mujoco import check_mujoco

        check_mujoco(scenario)


def prepare(scenario: Scenario, *, many: bool = False) -> None:
    """Compiles the scenario's engine, so that no simulation, nor one of many gaits, has to wait for
    that. The kernels of `drake` and `mujoco` are compiled as a moment is simulated."""
    if scenario.engine_name == "compiled":
        from tetra_drake.engines.compiled.lane_engine import LaneEngine, PreparedGait, lanes_for

        prepared = PreparedGait.of(Robot.of(scenario), seeded_gait(scenario), record=False)
        for width in {1, lanes_for(math.inf) if many else 1}:
            LaneEngine(prepared, width=width)
        return
    brief = max(_BRIEF, scenario.cpg.listing_step)
    if brief < scenario.simulation.duration:
        times = {"duration": brief, "steady_from": 0.0, "sample_period": 0.1 * brief}
        scenario = scenario.with_changes({f"simulation.{k}": f"{t!r} s" for k, t in times.items()})
    with contextlib.suppress(SimulationFailure):  # recorded, which takes samples within steps
        simulate(scenario=scenario, gait=seeded_gait(scenario), record=True)
