"""Robot prepared for a lane of the compiled engine: constants, state at t = 0, sample times."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from tetra_drake.engines.lanes import loop
from tetra_drake.engines.lanes.dynamics import Solver
from tetra_drake.engines.lanes.loop import Constants, LaneState
from tetra_drake.engines.lanes.tables import shared
from tetra_drake.kernels.packed import allocate
from tetra_drake.laws.actuator import DRIVE, limits_of
from tetra_drake.laws.forces import sizes_of
from tetra_drake.laws.oscillator import make_states
from tetra_drake.results.result import motion_times
from tetra_drake.robot.signals import MARK_DECIMALS, DrivenRobot
from tetra_drake.robot.speed_limit import speed_limit
from tetra_drake.scenario.engine_kinds import Compiled, look_ahead


@dataclass(frozen=True, eq=False)
class Prepared:
    """Driven robot in the form that the lanes need: constants and state of its kernels."""

    driven: DrivenRobot
    record: bool
    times: np.ndarray
    """Times (s) of the samples; see motion_times()."""
    turns: np.ndarray
    """Steering, -1 to 1, at multiples of `cpg.listing_step`; see Robot.turns()."""
    sizes: dict[str, int]
    """Sizes of the robot's tables, for allocate()."""
    constants: Constants
    """Constants of all laws, without the heights of the ground."""
    kind: object
    """Value that must be equal for all robots in the same lanes: indices, Booleans, shapes of
    tables."""
    start: LaneState
    """State at t = 0, with scratch memory."""

    @classmethod
    def of(cls, driven: DrivenRobot, *, record: bool) -> Prepared:
        """Prepares a robot for a lane, at t = 0. With `record`, its trajectory is sampled. Raises
        InputError if gait or steering do not fit the scenario."""
        robot, model, structure = driven.robot, driven.robot.model, driven.robot.structure
        scenario, turns, solver = robot.scenario, driven.turns, Solver.of(model)
        cpg, engine = scenario.cpg, scenario.settings_of(Compiled)
        oscillators = driven.oscillators
        longest = engine.longest_step(robot.longest_step)
        is_jointed = model.joints.node_a.size > 0
        tolerance = engine.tolerance_under(scenario.friction, is_jointed=is_jointed)
        times = motion_times(scenario.simulation, record=record)
        # The ring buffer of signals has two steps' worth of rows, or a whole command.
        rows = max(2.0 * longest / cpg.listing_step + 32.0, len(driven.samples))
        sizes = sizes_of(model) | {
            "signals": structure.signals,
            "states": oscillators.start.size,
            "blocks": len(solver.schedule.later),
            "marks": len(driven.marks) + 1,
            "times": len(times) + 1,
            "samples": len(times),
            "recent": 1 << math.ceil(math.log2(rows)),
            "turns": len(turns),
            "heights": robot.ground.heights.size,
        }

        # Heun's method is stable for an actuator up to its time constant (NaN if it has none).
        max_step = np.fmin(longest, limits_of(model.actuator).time_constant)
        ground = model.ground._replace(heights=None)  # lanes have different numbers of heights
        constants = Constants(
            robot=solver.oriented(model)._replace(ground=ground),
            solver=solver,
            oscillators=oscillators,
            senses=robot.senses,
            sides=np.repeat(structure.sides, 2).astype(float),
            tonic_input=np.array([cpg.tonic]),
            gain=np.array([cpg.gain]),
            period=np.array([cpg.listing_step]),
            samples=np.array([driven.sample_count], dtype=float),
            start_up=np.array([driven.start_up]).round(MARK_DECIMALS),  # as its mark
            tolerance=np.array([tolerance]),
            max_step=np.array([max_step]),
            look_ahead=np.array([look_ahead(tolerance)]),
            max_evaluations=np.array([scenario.simulation.max_evaluations], dtype=float),
            max_speed=np.array([speed_limit(driven)]),
            is_live=driven.is_live,
        )
        kind = shared(constants)
        start = allocate(LaneState, sizes)
        start.clock[loop.STATUS], start.clock[loop.DUE] = loop.DONE, times[1]
        start.clock[loop.PLANNED] = min(look_ahead(tolerance), longest)
        start.clock[loop.SAMPLES] = len(driven.samples)
        start.tally.begins[0] = round(driven.steady_start, MARK_DECIMALS)
        start.step.state[:] = structure.initial_state
        start.modes[:] = robot.starting_modes
        start.signals[:] = robot.first_signals
        start.drives[:, DRIVE] = robot.starting_drives()
        start.oscillators[:] = make_states(oscillators)
        start.tonic[:] = robot.tonic_input(turns)[0]
        return cls(driven, record, times, turns, sizes, constants, kind, start)

    def like(self, driven: DrivenRobot) -> Prepared:
        """Prepares another driven robot, like Prepared.of(). It is faster if only the gait or the
        first signals differ from this one, whose constants are then used again."""
        robot, own = driven.robot, self.driven.robot
        is_alike = (
            type(driven) is type(self.driven)
            and len(driven.samples) == len(self.driven.samples) <= 1
            and robot.model is own.model
            and robot.structure is own.structure
            and robot.scenario is own.scenario
        )
        if not is_alike:
            return Prepared.of(driven, record=self.record)
        oscillators, turns, drives = driven.oscillators, driven.turns, self.start.drives
        if robot is not own:
            drives = drives.copy()
            drives[:, DRIVE] = robot.starting_drives()
        return dataclasses.replace(
            self,
            driven=driven,
            turns=turns,
            sizes=self.sizes | {"turns": len(turns)},
            constants=self.constants._replace(oscillators=oscillators),
            start=self.start._replace(
                signals=robot.first_signals,
                drives=drives,
                oscillators=make_states(oscillators),
                tonic=robot.tonic_input(turns)[0],
            ),
        )
