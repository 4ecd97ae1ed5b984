"""Base class of the engines, and the choice of a scenario's engine."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Sequence
from typing import ClassVar

from tetra_drake.engines.batch import Batch, LoneRobot, SerialBatch, Viewer
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.on_demand import loaded
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import driven_robot
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.world import World

_BRIEF = 0.01
"""Duration (s) of a simulation whose only purpose is to compile the kernels."""


class Engine:
    """Base class of engines, which simulate robots. Subclasses implement alone() or start()."""

    can_be_watched: ClassVar[bool] = False
    """True if start() accepts a viewer."""
    lanes: ClassVar[int] = 1
    """Number of robots that one thread simulates side by side."""
    has_threads: ClassVar[bool] = True
    """True if the engine is faster with several threads, each with its own batch."""

    def check(self, scenario: World) -> None:
        """Raises InputError if the engine cannot simulate the scenario."""

    def prepare(self, scenario: Scenario) -> None:
        """Compiles the kernels that the scenario's simulations need, by a very short simulation."""
        brief = max(_BRIEF, scenario.cpg.listing_step)
        if brief < scenario.simulation.duration:
            times = {"duration": brief, "steady_from": 0.0, "sample_period": 0.1 * brief}
            changes = {f"simulation.{key}": f"{time!r} s" for key, time in times.items()}
            scenario = scenario.with_sections(events=[]).with_changes(changes)
        with contextlib.suppress(SimulationFailure):  # recording needs kernels, too
            self.simulate(driven_robot(scenario, seeded_gait(scenario)), record=True)

    def start(
        self,
        robots: Sequence[DrivenRobot],
        *,
        places: int | None = None,
        record: bool = False,
        viewer: Viewer | None = None,
        threads: int = 1,
    ) -> Batch:
        """Starts a batch: puts robots at their start, side by side.

        Args:
            robots: at least one robot; all have the same structure and kinds of laws.
            places: number of robots that the batch can hold; by default the number of `robots`.
                Places without a robot are idle until Batch.begin().
            record: records the trajectories, for the results.
            viewer: observer that shows the robots, if the engine can be watched.
            threads: number of threads that share the robots, if the engine supports threads.

        Raises:
            InputError: if the engine cannot simulate a robot.
            SimulationFailure: if a robot fails before its first step.
        """
        start = functools.partial(self.alone, record=record, viewer=viewer)
        return SerialBatch(start, robots, places or len(robots))

    def alone(self, robot: DrivenRobot, *, record: bool, viewer: Viewer | None) -> LoneRobot:
        """Puts a single robot at its start, for a SerialBatch, which simulates one robot after
        another. Raises the errors of start()."""
        raise NotImplementedError

    def simulate(
        self, robot: DrivenRobot, *, record: bool = False, viewer: Viewer | None = None
    ) -> SimulationResult:
        """Simulates a robot to the end of its simulation. Raises Diverged or StepBudgetExceeded if
        it fails, and InputError if the engine cannot simulate it."""
        batch = self.start([robot], record=record, viewer=viewer)
        batch.advance()
        return batch.result(0)


def engine_of(scenario: World) -> Engine:
    """Engine that the scenario's setting `engine` names. Its module is imported on demand."""
    engine: Engine = loaded(f"{scenario.engine.module}:ENGINE")
    return engine


def check_can_be_watched(scenario: World) -> None:
    """Raises InputError if the scenario's engine does not support a viewer."""
    if not engine_of(scenario).can_be_watched:
        engine = scenario.engine_name
        problem = f"found '{engine}', expected 'drake': no other engine can be watched"
        raise InputError(f"scenario {scenario.name}", "engine", problem)
