"""Simulation of gaits, commands and controllers on the engine of a scenario."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import TypeAlias, cast

from tetra_drake.engines.engine import Viewer, check_can_be_watched, engine_of
from tetra_drake.engines.queue import SimulationQueue
from tetra_drake.errors import InputError, SimulationFailure, check_type
from tetra_drake.machine import threads_for
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import (
    Command,
    Controller,
    Driver,
    driven_robot,
    robot_of_controller,
)
from tetra_drake.robot.gait import Gait, SteeringSignal
from tetra_drake.robot.gait_file import GivenGait, given_gait
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.scenario import Scenario

Outcome: TypeAlias = SimulationResult | SimulationFailure
"""Result of a simulation, or its failure: Diverged or StepBudgetExceeded."""


def simulate(
    scenario: GivenScenario,
    gait: GivenGait | None = None,
    *,
    command: Command | None = None,
    controller: Controller | None = None,
    control_period: float | None = None,
    record: bool = False,
    viewer: Viewer | None = None,
    steering: SteeringSignal | None = None,
) -> SimulationResult:
    """Simulates a robot that follows a gait, a command for its actuators, or a controller.

        >>> scenario = td.load_scenario("quick")
        >>> result = td.simulate(scenario, td.seeded_gait(scenario, 80), record=True)
        >>> inches, tension = result.metrics.distance_in, result.trajectory.tension

    The same scenario and gait always give the same numbers, bit for bit, except for the wall time.
    Recording and watching do not change them. On each engine, a policy or a controller acts once in
    each control period, and the robot changes at the events of the scenario.

    Args:
        scenario: a scenario, its name or file, or a run.
        gait: a gait, its file, or a run (see load_run()), which means its best gait. Not needed if
            `scenario` is a run.
        command: a command in place of a gait; see load_command().
        controller: a function in place of a gait, from the time (s) and the readings of the robot
            (see robot.readings.Readings) to an action for each driven cable (see Simulation).
        control_period: time (s) between actions of the controller; by default
            `simulation.control_period`.
        record: records the trajectory.
        viewer: observer that shows the robot during the simulation.
        steering: the turn, -1 to 1, in place of the gait's turn; or a function from time (s) to the
            turn. A positive turn gives the left oscillators more input, the right ones less.

    Raises:
        Diverged, StepBudgetExceeded: if the simulation fails; they have the time and the reason.
        InputError: if an argument does not fit the scenario, or the engine has no viewer.
    """
    own_gait = _best_gait_of(scenario)
    scenario = given_scenario(scenario)
    check_type("simulate", "record", record, bool)
    if viewer is not None:
        check_can_be_watched(scenario)
    if controller is not None:
        if gait is not None or command is not None or steering is not None:
            raise InputError("simulate", "controller", "excludes a gait, a command, and steering")
        robot = robot_of_controller(scenario, controller, period=control_period)
        return engine_of(scenario).simulate(robot, record=record, viewer=viewer)
    if command is not None and (gait is not None or steering is not None):
        raise InputError("simulate", "command", "excludes a gait, and steering")
    given = gait if command is None else command
    given = own_gait if given is None else given
    if given is None:
        raise InputError("simulate", "gait", "is needed, or a command, or a controller")
    driver = given if isinstance(given, Command) else given_gait(given, scenario)
    robot = driven_robot(scenario, driver, steering=steering)
    return engine_of(scenario).simulate(robot, record=record, viewer=viewer)


def _best_gait_of(scenario: GivenScenario) -> GivenGait | None:
    """The run or its folder, which means its best gait; None for other scenarios."""
    is_folder = isinstance(scenario, (str, Path)) and os.path.isdir(scenario)
    return cast(GivenGait, scenario) if is_folder or hasattr(scenario, "best_gait") else None


def simulate_many(
    scenario: GivenScenario | Sequence[GivenScenario],
    gaits: Sequence[GivenGait | Command],
    *,
    record: bool = False,
    workers: int | None = None,
) -> list[Outcome]:
    """Simulates many gaits or commands, on one scenario or each on its own scenario.

        >>> scenario = td.load_scenario("quick")
        >>> outcomes = td.simulate_many(scenario, [td.seeded_gait(scenario, i) for i in range(3)])
        >>> [outcome.name for outcome in outcomes]
        ['random gait 0', 'random gait 1', 'random gait 2']

    Returns a result for each gait, in the order of the gaits. For a simulation that fails, the list
    has its Diverged or StepBudgetExceeded. Results and failures have the attributes scenario and
    gait.

    The compiled engine simulates several gaits side by side in the registers of each core. The
    numbers are the same, bit for bit, and it is several times faster. Scenarios with the same
    structure and kinds of laws can share a core. MuJoCo simulates one gait per thread. The Drake
    diagram, or a mixture of engines, simulates one gait after another.

    Args:
        scenario: a scenario for all gaits, or a scenario for each gait.
        gaits: gaits, files or runs; or commands for actuators.
        record: records the trajectories.
        workers: number of threads; one per core by default.

    Raises:
        InputError: if the numbers of scenarios and gaits differ, or a gait does not fit.
    """
    check_type("simulate_many", "gaits", gaits, Sequence)
    check_type("simulate_many", "record", record, bool)
    if isinstance(scenario, Sequence) and not isinstance(scenario, str):
        scenarios = [given_scenario(each) for each in scenario]
    else:
        scenarios = [given_scenario(scenario)] * len(gaits)
    if len(scenarios) != len(gaits):
        problem = f"found {len(scenarios)}, expected one, or one for each of {len(gaits)} gaits"
        raise InputError("simulate_many", "scenario", problem)
    threads = threads_for(workers, source="simulate_many")
    walks: list[tuple[Scenario, Driver]] = [
        (each, gait if isinstance(gait, Command) else given_gait(gait, each))
        for gait, each in zip(gaits, scenarios, strict=True)
    ]
    outcomes: list[Outcome] = []
    with contextlib.closing(simulate_each(walks, record=record, threads=threads)) as found:
        for outcome, (each, driver) in zip(found, walks, strict=True):
            if isinstance(outcome, InputError):
                raise outcome
            if isinstance(outcome, SimulationFailure):
                outcome.scenario, outcome.name = each, driver.name
                outcome.gait = None if isinstance(driver, Command) else driver
            outcomes.append(outcome)
    return outcomes


def simulate_each(
    walks: Sequence[tuple[Scenario, Driver]], *, record: bool = False, threads: int
) -> Generator[Outcome | InputError]:
    """Simulates gaits or commands, each on its scenario, by at most `threads` threads. Yields their
    results in order; in place of a result the failure of a simulation, or why it cannot start."""
    threads = min(threads, max(1, len(walks)))
    if not all(engine_of(scenario).has_threads for scenario, _ in walks):
        threads = 1
    with SimulationQueue(threads, record=record) as queue:
        for future in queue.submit(walks):
            try:
                yield future.result()
            except (InputError, SimulationFailure) as error:
                yield error


def check_scenario(scenario: Scenario, *gaits: Gait) -> None:
    """Raises InputError if gaits cannot be simulated on a scenario: its engine does not support it,
    the robot would start in the ground, or no oscillator drives it. Also if one of `gaits` is for
    another robot."""
    if not scenario.oscillators:
        problem = "found no oscillator, expected at least one that drives cables"
        raise InputError(scenario.name, "robot.actuated", problem)
    robot = Robot.of(scenario)
    for gait in gaits or [seeded_gait(scenario)]:
        driven_robot(scenario, gait, robot=robot).oscillators  # noqa: B018
    engine_of(scenario).check(scenario)
