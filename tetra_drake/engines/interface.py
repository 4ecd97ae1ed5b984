"""The interface of all engines, and the engine that a scenario names."""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Protocol

from tetra_drake.engines import ENGINES
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait, seeded_gait
from tetra_drake.robot.robot import Robot, SteeringSignal
from tetra_drake.scenario.scenario import Scenario

if TYPE_CHECKING:
    import xarray

    from tetra_drake.engines.compiled.lane_pool import LanePool

_BRIEF = 0.01
"""Duration (s) of a simulation that only compiles."""

Outcome = SimulationResult | SimulationFailure
"""The result of a simulation, or the Diverged or StepBudgetExceeded that ended it."""


class Viewer(Protocol):
    """Someone who watches a simulation as it runs."""

    def wants(self, time: float) -> bool:
        """True if the viewer wants the state at this time (s)."""

    def show(self, frame: xarray.Dataset) -> None:
        """Takes one sample of a trajectory (see results.trajectory.make_dataset)."""


class Engine:
    """An engine: simulate() for one gait; the rest is the same on all engines that do not differ.

    A simulation ends with TimeBudgetExceeded when the time of engines.time_limit is up.
    """

    can_be_watched: ClassVar[bool] = False
    """True if a viewer sees the robot while it is simulated."""

    lane_pool: type[LanePool] | None = None
    """The class of a pool that simulates gaits side by side in lanes, if the engine can."""

    def check(self, scenario: Scenario) -> None:
        """Raises InputError if the engine cannot simulate the scenario."""

    def prepare(self, scenario: Scenario) -> None:
        """Compiles the kernels for simulations of one gait at a time: simulates a moment."""
        brief = max(_BRIEF, scenario.cpg.listing_step)
        if brief < scenario.simulation.duration:
            times = {"duration": brief, "steady_from": 0.0, "sample_period": 0.1 * brief}
            changes = {f"simulation.{key}": f"{time!r} s" for key, time in times.items()}
            scenario = scenario.with_changes(changes)
        with contextlib.suppress(SimulationFailure):  # recorded, which takes samples within steps
            self.simulate(Robot.of(scenario), seeded_gait(scenario), record=True)

    def simulate(
        self,
        robot: Robot,
        gait: Gait,
        *,
        record: bool = False,
        viewer: Viewer | None = None,
        steering: SteeringSignal | None = None,
    ) -> SimulationResult:
        """Simulates a gait; raises as engines.simulate.simulate() does.

        A viewer is given only if the engine can be watched.
        """
        raise NotImplementedError

    def simulate_many(
        self, walks: Sequence[tuple[Scenario, Gait]], *, record: bool, threads: int
    ) -> list[Outcome]:
        """Simulates gaits, each on its scenario, on up to so many threads: one after another."""
        return [self.outcome(*walk, record=record) for walk in walks]

    def outcome(self, scenario: Scenario, gait: Gait, *, record: bool) -> Outcome:
        """Outcome of the simulation of one gait."""
        try:
            return self.simulate(Robot.of(scenario), gait, record=record)
        except SimulationFailure as failure:
            return failure


def engine_of(scenario: Scenario) -> Engine:
    """The engine that the scenario names; its module is imported here."""
    engine: Engine = importlib.import_module(ENGINES[scenario.engine_name]).ENGINE
    return engine


def check_can_be_watched(scenario: Scenario) -> None:
    """Raises InputError if the scenario's engine shows nothing until it has ended."""
    if not engine_of(scenario).can_be_watched:
        engine = scenario.engine_name
        problem = f"found '{engine}', expected 'drake', which alone can be watched as it simulates"
        raise InputError(f"scenario {scenario.name}", "engine", problem)
