"""Interface of all engines; lookup of a scenario's engine."""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, ClassVar

from tetra_drake.engines.gait_simulation import Driver, GaitSimulation
from tetra_drake.engines.stepper import Stepper
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.scenario import Scenario

if TYPE_CHECKING:
    from tetra_drake.engines.compiled.lane_pool import LanePool

_BRIEF = 0.01
"""Duration (s) of a simulation whose only purpose is to compile the kernels."""

Outcome = SimulationResult | SimulationFailure
"""Result of a simulation, or its failure: Diverged or StepBudgetExceeded."""


class Engine:
    """Base class of engines. A subclass must implement simulate() and stepper(); the other methods
    have defaults.

    simulate() must call time_limit.check_time() often, which raises TimeBudgetExceeded.
    """

    can_be_watched: ClassVar[bool] = False
    """True if simulate() accepts a viewer."""
    lane_pool: type[LanePool] | None = None
    """Pool class for simulating gaits side by side in lanes; None if the engine has no lanes."""

    def check(self, scenario: Scenario) -> None:
        """Raises InputError if the engine cannot simulate the scenario."""

    def prepare(self, scenario: Scenario) -> None:
        """Compiles the kernels that simulate() needs, by a very short simulation."""
        brief = max(_BRIEF, scenario.cpg.listing_step)
        if brief < scenario.simulation.duration:
            times = {"duration": brief, "steady_from": 0.0, "sample_period": 0.1 * brief}
            changes = {f"simulation.{key}": f"{time!r} s" for key, time in times.items()}
            scenario = scenario.with_changes(changes)
        with contextlib.suppress(SimulationFailure):  # recording needs kernels, too
            self.simulate(GaitSimulation(Robot.of(scenario), seeded_gait(scenario), record=True))

    def simulate(self, simulation: GaitSimulation) -> SimulationResult:
        """Simulates a gait. Raises the same errors as engines.simulate.simulate()."""
        raise NotImplementedError

    def stepper(self, first: GaitSimulation, *, count: int, threads: int) -> Stepper:
        """A stepper for `count` robots like the first one."""
        raise NotImplementedError

    def simulate_many(
        self, simulations: Sequence[tuple[Scenario, Driver]], *, record: bool, threads: int
    ) -> list[Outcome]:
        """Simulates many gaits or commands, each on its scenario. This default simulates one after
        another."""
        return [self.outcome(*simulation, record=record) for simulation in simulations]

    def outcome(self, scenario: Scenario, driver: Driver, *, record: bool) -> Outcome:
        """Simulates one gait or command. Returns its result or its failure."""
        return outcome_of(lambda: self.simulate(GaitSimulation.of(scenario, driver, record=record)))


def outcome_of(simulate: Callable[[], SimulationResult]) -> Outcome:
    """The result of a simulation, or its failure."""
    try:
        return simulate()
    except SimulationFailure as failure:
        return failure


def engine_of(scenario: Scenario) -> Engine:
    """The engine of a scenario. The engine's module is imported on demand."""
    engine: Engine = importlib.import_module(scenario.engine.module).ENGINE
    return engine


def check_can_be_watched(scenario: Scenario) -> None:
    """Raises InputError if the scenario's engine does not support a viewer."""
    if not engine_of(scenario).can_be_watched:
        engine = scenario.engine_name
        problem = f"found '{engine}', expected 'drake': no other engine can be watched"
        raise InputError(f"scenario {scenario.name}", "engine", problem)
