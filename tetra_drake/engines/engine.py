"""Base class of the engines, and the choice of a scenario's engine."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, ClassVar, Protocol

from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import driven_robot
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.world import World
from tetra_drake.settings.plugins import part_of

if TYPE_CHECKING:
    import xarray

SAME_TIME = 1e-9
"""Largest difference (s) of two times that are the same except for rounding."""
_BRIEF = 0.01
"""Duration (s) of a simulation whose only purpose is to compile the kernels."""


class Viewer(Protocol):
    """Display of a simulation while it runs."""

    def wants(self, time: float) -> bool:
        """True if the viewer wants to show the robot at this simulated time (s). The engine asks
        after each step, and calls show() if it is True."""

    def show(self, frame: xarray.Dataset) -> None:
        """Shows the robot. `frame` is a trajectory with a single sample; see
        results.trajectory.make_dataset."""


class Engine:
    """Base class of engines, which simulate robots from start to end. Subclasses implement
    simulate()."""

    lanes: ClassVar[int] = 1
    """Number of robots that one thread simulates side by side: more than one on the compiled
    engine, in a LaneBatch."""
    has_threads: ClassVar[bool] = True
    """True if the engine is faster with several threads, each with its own robots."""

    def check(self, scenario: World) -> None:
        """Raises InputError if the engine cannot simulate the scenario."""

    def prepare(self, scenario: Scenario) -> None:
        """Compiles the kernels that the scenario's simulations need, by a very short simulation."""
        brief = max(_BRIEF, scenario.cpg.listing_step)
        times = {"duration": brief, "steady_from": 0.0, "sample_period": 0.1 * brief}
        changes = {f"simulation.{key}": f"{time!r} s" for key, time in times.items()}
        scenario = scenario.undisturbed().with_changes(changes)
        with contextlib.suppress(SimulationFailure):  # recording needs kernels, too
            self.simulate(driven_robot(scenario, seeded_gait(scenario)), record=True)

    def simulate(
        self, robot: DrivenRobot, *, record: bool = False, viewer: Viewer | None = None
    ) -> SimulationResult:
        """Simulates a robot from its start to the end of its simulation.

        The robot follows what drives it, and changes at the times of its scenario's events. Calls
        time_limit.check_time() often, which raises TimeBudgetExceeded.

        Args:
            robot: the robot with its gait, command, policy or controller.
            record: records the trajectory, for the result.
            viewer: observer that shows the robot on the engine `drake`. The others ignore it.

        Raises:
            InputError: if the engine cannot simulate the robot.
            Diverged, StepBudgetExceeded: if the simulation fails.
        """
        raise NotImplementedError


def engine_of(scenario: World) -> Engine:
    """Engine that the scenario's setting `engine` names. Its module is imported on demand."""
    engine: Engine = part_of(scenario.engine, "ENGINE")
    return engine


def check_engine(scenario: World, name: str, reason: str) -> None:
    """Raises InputError unless the scenario's engine has this name. The message gives a reason."""
    if scenario.engine_name != name:
        problem = f"found '{scenario.engine_name}', expected '{name}': {reason}"
        raise InputError(f"scenario {scenario.name}", "engine", problem)


def check_can_be_watched(scenario: World) -> None:
    """Raises InputError if the scenario's engine does not support a viewer."""
    check_engine(scenario, "drake", "no other engine can be watched")
