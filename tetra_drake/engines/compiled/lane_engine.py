"""Memory of the compiled engine: loads a gait into a SIMD lane, runs it, and reads its result."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numba.core import registry

from tetra_drake.engines.compiled import control_periods, loop
from tetra_drake.engines.compiled.prepared import Prepared
from tetra_drake.errors import MAX_SPEED, Diverged, SimulationFailure, StepBudgetExceeded
from tetra_drake.physics.actuator import DRIVE
from tetra_drake.physics.terrain import SurfaceGrid
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.readings import Readings
from tetra_drake.scenario.engine_kinds import Compiled
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.simd.allocation import allocate
from tetra_drake.simd.compiling import machine_code
from tetra_drake.simd.lanes import FieldArray, lane_table
from tetra_drake.simd.packed import Packed

FIRST = SurfaceGrid._fields.index("first")
"""Column of Ground.grid with the index of the first height. It differs between lanes, because one
table has the heights of all lanes."""


_BODY_STEPS = 100_000
"""Iterations times bodies per call of the kernel, about 70 ms. Between calls Python handles signals
of the operating system."""


class LaneEngine:
    """Simulates similar gaits (see accepts()) in a number of lanes."""

    def __init__(self, first: Prepared, *, width: int) -> None:
        """An engine with `width` lanes for gaits like `first`. Compiles its kernel if necessary."""
        self._first, self._kind = first, first.kind
        self._bodies = len(first.robot.structure.bodies)
        self._heights = np.zeros((width, first.robot.ground.heights.size))
        self._constants = _constants_in_lanes(first.constants, self._heights)
        self._lanes = in_lanes(first.start, width)
        self._log = allocate(loop.Log, first.log_sizes | {"lanes": width})
        self._parts = Packed((self._constants, self._lanes, self._log, first.live))
        self._advance = machine_code(loop.advance, self._parts, 0)
        self._in_lane: list[Prepared | None] = [None] * width
        self._wall_times = np.zeros(width)
        self._status = self._lanes.clock.array[loop.STATUS]
        for lane in range(width):  # idle lanes compute, too, and need valid numbers
            self.load(lane, first)
            self.stop(lane)

    def accepts(self, prepared: Prepared) -> bool:
        """True if a gait fits this engine's tables: the same structure and kinds of laws as the
        first gait, and no more samples, marks, turns or heights."""
        log = self._log
        return (
            prepared.kind == self._kind
            and len(prepared.times) < log.times.shape[1]
            and len(prepared.marks) < log.marks.shape[1]
            and prepared.recent_signals <= log.recent.shape[1]
            and len(prepared.turns) <= log.turns.shape[1]
            and prepared.robot.ground.heights.size <= self._heights.shape[1]
        )

    @property
    def idle(self) -> list[int]:
        """Indices of the lanes without a gait."""
        return [lane for lane, prepared in enumerate(self._in_lane) if prepared is None]

    def load(self, lane: int, prepared: Prepared) -> None:
        """Starts a gait in a lane. Raises InputError if the gait does not fit its scenario."""
        constants, start = prepared.constants, prepared.start
        fill_lane(self._constants, constants, lane)
        fill_lane(self._lanes, start, lane)
        network, given = self._constants.network, constants.network
        # The kernel has one range of inhibiting neurons for all lanes.
        network.first.array[:] = np.minimum(network.first.array, given.first)
        network.beyond.array[:] = np.maximum(network.beyond.array, given.beyond)
        heights = prepared.robot.ground.heights
        self._heights[lane, : heights.size] = heights
        self._constants.robot.ground.grid.array[FIRST, lane] = lane * self._heights.shape[1]

        log, clock = self._log, self._lanes.clock.array
        turns, commanded = prepared.turns, prepared.robot.commanded
        log.times[lane] = log.marks[lane] = math.inf
        log.times[lane, : len(prepared.times)] = prepared.times
        log.marks[lane, : len(prepared.marks)] = prepared.marks
        log.turns[lane], log.turns[lane, : len(turns)] = turns[-1], turns
        log.states[lane, 0], log.modes[lane, 0] = start.step.state, start.modes
        log.signals[lane, 0] = start.signals
        log.recent[lane, : len(commanded)] = commanded
        clock[loop.SAMPLES, lane] = len(commanded)
        log.drives[lane, 0] = start.drives[:, DRIVE]
        log.kept[lane], log.passed[lane] = 1, 0
        engine = prepared.robot.scenario.settings_of(Compiled)
        self._status[lane] = loop.RUNNING
        clock[loop.PLANNED, lane] = min(engine.look_ahead, engine.max_step)
        clock[loop.MARK, lane], clock[loop.DUE, lane] = log.marks[lane, 0], log.times[lane, 1]
        self._in_lane[lane], self._wall_times[lane] = prepared, 0.0

    def stop(self, lane: int) -> float:
        """Removes the gait from a lane, finished or not. Returns its wall time in s."""
        self._in_lane[lane] = None
        self._status[lane] = loop.IDLE
        return float(self._wall_times[lane])

    def advance(self, body_steps: int) -> list[int]:
        """Simulates until a gait ends, or for about `body_steps` iterations times bodies. Returns
        the lanes with finished gaits; result() empties a lane. Other Python threads run
        meanwhile."""
        self._simulate(body_steps)
        busy = [lane for lane, prepared in enumerate(self._in_lane) if prepared is not None]
        return [lane for lane in busy if self._status[lane] != loop.RUNNING]

    @functools.cached_property
    def _hold(self) -> Callable[..., None]:
        table = np.zeros((1, 1))
        return machine_code(control_periods.hold, self._parts, table, table)

    @functools.cached_property
    def _read(self) -> Callable[..., None]:
        none = Packed(Readings.empty(self._first.robot.structure, 0))
        return machine_code(control_periods.read, self._parts, none)

    def hold(self, signals: np.ndarray, marks: np.ndarray) -> None:
        """Appends a sample to the command of each lane, and sets the next marks; see
        control_periods.hold()."""
        contiguous = np.ascontiguousarray  # the machine code does not check its arguments
        self._hold(self._parts, contiguous(signals), contiguous(marks))

    def run(self) -> None:
        """Simulates until all lanes have reached their last mark or failed."""
        while (self._status == loop.RUNNING).any():
            self._simulate(_BODY_STEPS)

    def _simulate(self, body_steps: int) -> None:
        """Simulates until a gait ends, or for about `body_steps` iterations times bodies."""
        started = time.perf_counter()
        self._advance(self._parts, max(1, body_steps // (loop.ROUND * self._bodies)))
        busy = len(self._in_lane) - self._in_lane.count(None)
        self._wall_times += (time.perf_counter() - started) / max(busy, 1)

    def read(self, readings: Packed[Readings]) -> None:
        """Writes the readings of the first lanes, a row for each; see control_periods.read()."""
        self._read(self._parts, readings)

    @property
    def failed(self) -> np.ndarray:
        """True for each lane whose simulation has failed."""
        failed: np.ndarray = self._status > loop.DONE
        return failed

    def failure(self, lane: int) -> SimulationFailure | None:
        """The failure of the simulation in a lane; None if it goes on or is finished."""
        prepared, status = self._in_lane[lane], int(self._status[lane])
        if prepared is None or status in (loop.RUNNING, loop.DONE):
            return None
        ended = float(self._lanes.clock.array[loop.TIME, lane])
        return _failure(status, time=ended, scenario=prepared.robot.scenario)

    def result(self, lane: int) -> SimulationResult:
        """The result of the finished simulation in a lane; the lane becomes idle. Raises Diverged
        or StepBudgetExceeded if the simulation failed."""
        prepared, failure = self._in_lane[lane], self.failure(lane)
        if prepared is None:
            raise ValueError(f"lane {lane} is idle")
        wall_time = self.stop(lane)
        clock = self._lanes.clock.array[:, lane]
        if failure is not None:
            failure.wall_time = wall_time
            raise failure
        return make_result(
            prepared.robot,
            prepared.gait,
            self.motion(lane),
            totals=of_lane(self._lanes.tally, lane),
            work=IntegratorWork(
                scheme="ros2",
                accuracy=prepared.robot.scenario.settings_of(Compiled).tolerance,
                steps=int(clock[loop.TAKEN]),
                derivative_evaluations=loop.EVALUATIONS * int(clock[loop.TRIED]),
            ),
            wall_time=wall_time,
            record=prepared.record,
        )

    def motion(self, lane: int) -> Motion:
        """Samples of the latest simulation in a lane, up to now."""
        log = self._log
        kept = slice(log.kept[lane])
        return Motion(
            times=log.times[lane, kept].copy(),
            states=log.states[lane, kept].copy(),
            signals=log.signals[lane, kept].copy(),
            modes=log.modes[lane, kept].copy(),
            drives=log.drives[lane, kept].copy(),
        )


def _failure(status: int, *, time: float, scenario: Scenario) -> SimulationFailure:
    """The failure of a simulation that ended at a time (s) with this status."""
    budget = scenario.simulation.max_evaluations
    if status == loop.TOO_MANY_EVALUATIONS:
        reason = f"force evaluations exceed the budget of {budget}"
        return StepBudgetExceeded(time=time, reason=reason)
    reasons = {
        loop.TOO_FAST: f"a body's velocity exceeds the limit of {MAX_SPEED:g} m/s",
        loop.STEP_TOO_SMALL: "no step is small enough for the tolerance",
    }
    return Diverged(time=time, reason=reasons[status])


def lanes_for(gaits: float) -> int:
    """Fastest number of lanes for simulating a number of gaits on one core of this machine.

    The results do not depend on the number of lanes. Eight doubles fill a register of AVX-512. With
    narrower registers, eight lanes would need more registers than there are, so four are faster.
    """
    if gaits <= 1:
        return 1
    return 8 if gaits > 4 and "+avx512f" in processor_features() else 4


def processor_features() -> str:
    """Instruction sets that numba compiles for, such as "+avx2": from its settings or the
    machine."""
    return registry.cpu_target.target_context.codegen().magic_tuple()[2]


def _constants_in_lanes(constants: loop.Constants, heights: np.ndarray) -> loop.Constants:
    """Tables in lanes for constants like the given ones. `heights` has a row per lane."""
    width = len(heights)
    lanes = in_lanes(constants, width)
    # A field of any size: one compiled kernel serves robots of any size.
    inhibition = lane_table(constants.network.inhibition.shape, width, any_size=True)
    ground = lanes.robot.ground._replace(heights=FieldArray(heights.ravel()))
    robot, network = lanes.robot._replace(ground=ground), lanes.network
    return lanes._replace(robot=robot, network=network._replace(inhibition=inhibition))


def in_lanes(values: Any, width: int) -> Any:
    """NamedTuples with a table in lanes (zeros) for each array of real numbers. Arrays of indices
    are shared by all lanes. Other values stay as they are."""
    if isinstance(values, tuple):
        return type(values)(*(in_lanes(value, width) for value in values))
    if not isinstance(values, np.ndarray):
        return values
    if values.dtype == np.int64:
        return FieldArray(values.copy())
    return lane_table(values.shape, width)


def fill_lane(tables: Any, values: Any, lane: int) -> None:
    """Copies the real numbers of NamedTuples to one lane of tables from in_lanes()."""
    if isinstance(values, tuple):
        for table, value in zip(tables, values, strict=True):
            fill_lane(table, value, lane)
    elif isinstance(values, np.ndarray) and values.dtype == np.float64:
        tables.array[..., lane] = values


def of_lane(tables: Any, lane: int) -> Any:
    """A copy of the numbers in a lane of tables in NamedTuples."""
    if isinstance(tables, tuple):
        return type(tables)(*(of_lane(table, lane) for table in tables))
    return tables.array[..., lane].copy()
