"""Robot prepared for a lane of the compiled engine: constants, state at t = 0, sample times."""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass

import numpy as np

from tetra_drake.engines.lanes.dynamics import Solver
from tetra_drake.engines.lanes.loop import Constants, LaneState
from tetra_drake.engines.lanes.tables import shared
from tetra_drake.kernels.allocation import allocate
from tetra_drake.laws.actuator import DRIVE, Limits
from tetra_drake.laws.forces import sizes_of
from tetra_drake.laws.oscillator import make_neurons
from tetra_drake.results.result import motion_times
from tetra_drake.robot.driven import MARK_DECIMALS, DrivenRobot
from tetra_drake.robot.network import initial_neurons
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.speed_limit import speed_limit
from tetra_drake.scenario.engine_kinds import Compiled

_SPARE_MARKS = 4
"""Number of marks that a robot may have more than the first one in the same lanes."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A driven robot, prepared for a lane. Its arrays have no lanes yet."""

    driven: DrivenRobot
    record: bool
    times: np.ndarray
    """Times (s) of the samples; see motion_times()."""
    turns: np.ndarray
    """Turns of the steering; see Robot.turns()."""
    constants: Constants
    """Constants of all laws, without the heights of the ground."""
    start: LaneState
    """State at t = 0, with scratch memory."""

    @classmethod
    def of(cls, driven: DrivenRobot, *, record: bool) -> Prepared:
        """Prepares a robot. Raises InputError if gait or steering do not fit the scenario."""
        turns, solver = driven.turns, Solver.of(driven.robot.model)
        return cls(
            driven=driven,
            record=record,
            times=motion_times(driven.robot.scenario.simulation, record=record),
            turns=turns,
            constants=_constants(driven, solver),
            start=_start(driven, turns, solver),
        )

    def like(self, driven: DrivenRobot) -> Prepared:
        """As Prepared.of(driven), in less time if it is the same robot with another gait, or with
        other first signals."""
        if not self._is_alike(driven):
            return Prepared.of(driven, record=self.record)
        turns, drives = driven.turns, self.start.drives.copy()
        drives[:, DRIVE] = driven.robot.starting_drives()
        return dataclasses.replace(
            self,
            driven=driven,
            turns=turns,
            constants=self.constants._replace(network=driven.network, gains=driven.gains),
            start=self.start._replace(
                signals=driven.robot.first_signals,
                drives=drives,
                tonic=driven.robot.tonic_input(turns)[0],
            ),
        )

    def _is_alike(self, driven: DrivenRobot) -> bool:
        """True if a robot differs from this one by its gait, or by its first signals alone."""
        robot, own = driven.robot, self.robot
        return (
            type(driven) is type(self.driven)
            and len(driven.samples) == len(self.driven.samples) <= 1
            and robot.model is own.model
            and robot.structure is own.structure
            and robot.scenario is own.scenario
        )

    def fits(self, other: Prepared) -> bool:
        """True if both can share lanes."""
        return self._is_alike(other.driven) or other.kind == self.kind

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.driven.robot

    @functools.cached_property
    def kind(self) -> object:
        """What all robots in the same lanes must share. The kernel has one range of inhibiting
        neurons for all lanes; see LaneThread."""
        none = np.zeros(0)
        network = self.constants.network._replace(first=none, beyond=none)
        return self.driven.is_live, shared(self.constants._replace(network=network))

    @property
    def recent_signals(self) -> int:
        """Rows of the ring buffer of signals: at least two steps' worth, or a whole command; a
        power of two."""
        scenario = self.robot.scenario
        within = scenario.settings_of(Compiled).max_step / scenario.cpg.listing_step
        least = max(2.0 * within + 32.0, len(self.driven.samples))
        return 1 << math.ceil(math.log2(least))

    @property
    def log_sizes(self) -> dict[str, int]:
        """Sizes of the Log for this robot. There is space for a few more marks."""
        return sizes_in_lanes(self.robot, self.constants.solver) | {
            "marks": len(self.driven.marks) + 1 + _SPARE_MARKS,
            "times": len(self.times) + 1,
            "samples": len(self.times),
            "recent": self.recent_signals,
            "turns": len(self.turns),
        }


def _constants(driven: DrivenRobot, solver: Solver) -> Constants:
    robot, model = driven.robot, driven.robot.model
    scenario = robot.scenario
    cpg, engine = scenario.cpg, scenario.settings_of(Compiled)
    # Heun's method is stable for an actuator up to its time constant (NaN if it has none).
    max_step = np.fmin(engine.max_step, Limits(*model.actuator.limits).time_constant)
    ground = model.ground._replace(heights=None)  # lanes have different numbers of heights
    return Constants(
        robot=model._replace(ground=ground),
        solver=solver,
        network=driven.network,
        senses=driven.senses,
        sides=np.repeat(robot.structure.sides, 2).astype(float),
        external_input=np.array([cpg.external_input]),
        gains=driven.gains,
        gain=np.array([cpg.gain]),
        period=np.array([cpg.listing_step]),
        samples=np.array([driven.sample_count], dtype=float),
        start_up=np.array([driven.start_up]).round(MARK_DECIMALS),  # as its mark
        tolerance=np.array([engine.tolerance]),
        max_step=np.array([max_step]),
        look_ahead=np.array([engine.look_ahead]),
        max_evaluations=np.array([scenario.simulation.max_evaluations], dtype=float),
        max_speed=np.array([speed_limit(driven)]),
    )


def _start(driven: DrivenRobot, turns: np.ndarray, solver: Solver) -> LaneState:
    robot, signals = driven.robot, driven.robot.structure.signals
    start = allocate(LaneState, sizes_in_lanes(robot, solver))
    start.tally.begins[0] = round(driven.steady_start, MARK_DECIMALS)
    start.step.state[:] = robot.structure.initial_state
    start.modes[:] = robot.starting_modes
    start.signals[:] = robot.first_signals
    start.drives[:, DRIVE] = robot.starting_drives()
    start.neurons[:] = make_neurons(initial_neurons(robot.scenario.cpg, signals))
    start.tonic[:] = robot.tonic_input(turns)[0]
    return start


def sizes_in_lanes(robot: Robot, solver: Solver) -> dict[str, int]:
    """Sizes of a robot's tables in lanes, for allocate()."""
    blocks = len(solver.schedule.later)
    return sizes_of(robot.model) | {"signals": robot.structure.signals, "blocks": blocks}
