"""Gait prepared for a lane of the compiled engine: constants, state at t = 0, sample times."""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass

import numpy as np

from tetra_drake.engines.gait_simulation import MARK_DECIMALS, GaitSimulation
from tetra_drake.engines.lanes.dynamics import Solver
from tetra_drake.engines.lanes.loop import Constants, LaneState
from tetra_drake.engines.lanes.tables import shared
from tetra_drake.kernels.allocation import allocate
from tetra_drake.laws.actuator import DRIVE, Limits
from tetra_drake.laws.forces import sizes_of
from tetra_drake.laws.oscillator import make_neurons
from tetra_drake.results.metrics import steady_start
from tetra_drake.results.result import motion_times
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot, initial_neurons
from tetra_drake.robot.signals import sample_count
from tetra_drake.robot.speed_limit import speed_limit
from tetra_drake.scenario.engine_kinds import Compiled

_SPARE_MARKS = 4
"""Number of marks that a gait may have more than the first gait on the same engine."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A gait on a scenario, prepared for a lane. Its arrays have no lanes yet."""

    robot: Robot
    gait: Gait
    record: bool
    times: np.ndarray
    """Times (s) of the samples; see motion_times()."""
    marks: np.ndarray
    """Times (s) at which a step must end."""
    turns: np.ndarray
    """Turns of the steering; see Robot.turns()."""
    constants: Constants
    """Constants of all laws, without the heights of the ground."""
    start: LaneState
    """State at t = 0, with scratch memory."""

    @classmethod
    def of(cls, simulation: GaitSimulation) -> Prepared:
        """Prepares a simulation. Raises InputError if gait or steering do not fit the scenario."""
        robot, gait, record = simulation.robot, simulation.gait, simulation.record
        turns, solver = robot.turns(gait, simulation.steering), Solver.of(robot.model)
        return cls(
            robot=robot,
            gait=gait,
            record=record,
            times=motion_times(robot.scenario.simulation, record=record),
            marks=simulation.marks,
            turns=turns,
            constants=_constants(robot, gait, solver),
            start=_start(robot, turns, solver),
        )

    def begun_by(self, simulation: GaitSimulation) -> Prepared:
        """As Prepared.of(simulation), in less time if its robot differs by its command alone, which
        is a single sample."""
        robot = simulation.robot
        if robot.model is not self.robot.model:
            return Prepared.of(simulation)
        start, drives = self.start, self.start.drives.copy()
        drives[:, DRIVE] = robot.starting_drives()
        start = start._replace(signals=robot.commanded[0], drives=drives)
        return dataclasses.replace(self, robot=robot, start=start)

    @functools.cached_property
    def kind(self) -> object:
        """What all simulations on one LaneEngine must share. The kernel has one range of inhibiting
        neurons for all lanes; see LaneEngine.load()."""
        none = np.zeros(0)
        network = self.constants.network._replace(first=none, beyond=none)
        return self.live, shared(self.constants._replace(network=network))

    @property
    def live(self) -> bool:
        """True if the network is integrated together with the robot."""
        return self.robot.scenario.cpg.signals == "live"

    @property
    def recent_signals(self) -> int:
        """Rows of the ring buffer of signals: at least two steps' worth, or a whole command; a
        power of two."""
        scenario = self.robot.scenario
        within = scenario.settings_of(Compiled).max_step / scenario.cpg.listing_step
        least = max(2.0 * within + 32.0, len(self.robot.commanded))
        return 1 << math.ceil(math.log2(least))

    @property
    def log_sizes(self) -> dict[str, int]:
        """Sizes of the engine's Log for this gait. There is space for a few more marks."""
        return sizes_in_lanes(self.robot, self.constants.solver) | {
            "marks": len(self.marks) + 1 + _SPARE_MARKS,
            "times": len(self.times) + 1,
            "samples": len(self.times),
            "recent": self.recent_signals,
            "turns": len(self.turns),
        }


def _constants(robot: Robot, gait: Gait, solver: Solver) -> Constants:
    scenario, model = robot.scenario, robot.model
    cpg, engine = scenario.cpg, scenario.settings_of(Compiled)
    # Heun's method is stable for an actuator up to its time constant (NaN if it has none).
    max_step = np.fmin(engine.max_step, Limits(*model.actuator.limits).time_constant)
    ground = model.ground._replace(heights=None)  # lanes have different numbers of heights
    return Constants(
        robot=model._replace(ground=ground),
        solver=solver,
        network=robot.network(gait),
        senses=robot.senses,
        sides=np.repeat(robot.structure.sides, 2).astype(float),
        external_input=np.array([cpg.external_input]),
        gains=np.array([gain for _, gain in gait.gains]),
        gain=np.array([cpg.gain]),
        period=np.array([cpg.listing_step]),
        samples=np.array([sample_count(robot)], dtype=float),
        start_up=np.array([cpg.start_up]).round(MARK_DECIMALS),  # as its mark
        tolerance=np.array([engine.tolerance]),
        max_step=np.array([max_step]),
        look_ahead=np.array([engine.look_ahead]),
        max_evaluations=np.array([scenario.simulation.max_evaluations], dtype=float),
        max_speed=np.array([speed_limit(robot)]),
    )


def _start(robot: Robot, turns: np.ndarray, solver: Solver) -> LaneState:
    start, signals = allocate(LaneState, sizes_in_lanes(robot, solver)), robot.structure.signals
    start.tally.begins[0] = round(steady_start(robot.scenario), MARK_DECIMALS)
    start.step.state[:] = robot.structure.initial_state
    start.modes[:] = robot.starting_modes
    if len(robot.commanded):
        start.signals[:] = robot.commanded[0]
    start.drives[:, DRIVE] = robot.starting_drives()
    start.neurons[:] = make_neurons(initial_neurons(robot.scenario.cpg, signals))
    start.tonic[:] = robot.tonic_input(turns)[0]
    return start


def sizes_in_lanes(robot: Robot, solver: Solver) -> dict[str, int]:
    """Sizes of a robot's tables in lanes, for allocate()."""
    blocks = len(solver.schedule.later)
    return sizes_of(robot.model) | {"signals": robot.structure.signals, "blocks": blocks}
