"""Memory of the compiled engine: loads a gait into a SIMD lane, runs it, and reads its result."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np
from numba.core import registry

from tetra_drake.engines.lanes import loop
from tetra_drake.engines.lanes.places import LAST, NEXT, ROUND, Memory, Places, advance
from tetra_drake.engines.lanes.prepared import Prepared
from tetra_drake.engines.lanes.tables import in_lanes, numbers_of, views
from tetra_drake.errors import Diverged, SimulationFailure, StepBudgetExceeded
from tetra_drake.kernels.allocation import allocate
from tetra_drake.kernels.compiling import machine_code
from tetra_drake.kernels.lanes import FieldArray
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.actuator import DRIVE
from tetra_drake.laws.terrain import SurfaceGrid
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.readings import Readings
from tetra_drake.scenario.engine_kinds import Compiled

FIRST = SurfaceGrid._fields.index("first")
"""Column of Ground.grid with the index of the first height. It differs between robots, because one
table has the heights of all robots."""

BODY_STEPS = 100_000
"""Iterations times bodies per call of the kernel, about 70 ms. Between calls Python handles signals
of the operating system."""


class LaneEngine:
    """Simulates similar robots (see accepts()) in the lanes of this processor."""

    def __init__(self, first: Prepared, *, readings: Readings | None = None) -> None:
        """An engine for robots like `first`. Compiles its kernel if necessary.

        There are as many places for robots as lanes. With `readings`, robots are simulated in
        control periods, and there is a place for each row.
        """
        robot, width = first.robot, processor_lanes()
        places = width if readings is None else len(readings.time)
        paused = 0 if readings is None else places
        if readings is None:
            readings = Readings.empty(robot.structure, 0)
        self._kind, self._bodies = first.kind, len(robot.structure.bodies)
        self._heights = np.zeros((places, robot.ground.heights.size))
        self._constants, constants = _constants_in_lanes(first.constants, self._heights, width)
        self._lanes, states = in_lanes(first.start, width)
        self._log = allocate(loop.Log, first.log_sizes | {"lanes": width, "places": places})

        def index(table: FieldArray, memory: np.ndarray) -> int:
            """Index of a table's first number among the numbers of its memory."""
            return (table.address - memory.ctypes.data) // memory.strides[0]

        self._tally = index(self._lanes.tally.begins, states)
        self._first_height = index(self._constants.robot.ground.grid, constants) + FIRST
        sizes = {
            "places": places,
            "lanes": width,
            "numbers": index(self._lanes.step.end, states),
            "constants": len(constants),
            "paused": paused,
            "signals": robot.structure.signals,
        }
        self._places = allocate(Places, sizes)
        memory = Memory(states, constants)
        self._parts = Packed(
            (self._constants, self._lanes, self._log, memory, self._places, readings, first.live)
        )
        self._advance = machine_code(advance, self._parts, 0)
        self._prepared: list[Prepared | None] = [None] * places
        self._wall_times, self._tried = np.zeros(places), np.zeros(places)
        self._running = self._lanes.clock.array[loop.STATUS]
        self._running[:] = loop.IDLE

    @property
    def status(self) -> np.ndarray:
        """Status of the robot in each place; see loop."""
        return self._places.states[:, loop.STATUS]

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
        """The places without a robot."""
        return [place for place, prepared in enumerate(self._prepared) if prepared is None]

    def load(self, place: int, prepared: Prepared) -> None:
        """Puts a robot at its start. Raises InputError if the gait does not fit its scenario."""
        log, start, heights = self._log, prepared.start, prepared.robot.ground.heights
        constants, network = self._places.constants[place], self._constants.network
        constants[:] = numbers_of(prepared.constants)
        constants[self._first_height] = place * self._heights.shape[1]
        self._heights[place, : heights.size] = heights
        # The kernel has one range of inhibiting neurons for all lanes.
        network.first.array[:] = np.minimum(network.first.array, prepared.constants.network.first)
        network.beyond.array[:] = np.maximum(
            network.beyond.array, prepared.constants.network.beyond
        )
        turns, commanded = prepared.turns, prepared.robot.commanded
        log.times[place] = log.marks[place] = math.inf
        log.times[place, : len(prepared.times)] = prepared.times
        log.marks[place, : len(prepared.marks)] = prepared.marks
        log.turns[place], log.turns[place, : len(turns)] = turns[-1], turns
        log.states[place, 0], log.modes[place, 0] = start.step.state, start.modes
        log.signals[place, 0] = start.signals
        log.recent[place, : len(commanded)] = commanded
        log.drives[place, 0] = start.drives[:, DRIVE]
        log.kept[place], log.passed[place] = 1, 0
        state = self._places.states[place]
        state[:] = numbers_of(start)[: state.size]
        engine = prepared.robot.scenario.settings_of(Compiled)
        state[loop.STATUS], state[loop.SAMPLES] = loop.RUNNING, len(commanded)
        state[loop.PLANNED] = min(engine.look_ahead, engine.max_step)
        state[loop.MARK], state[loop.DUE] = log.marks[place, 0], log.times[place, 1]
        self._prepared[place], self._wall_times[place] = prepared, 0.0
        if not self._places.marks.size:
            self._wait([place])

    def _wait(self, places: Sequence[int] | np.ndarray) -> None:
        """Appends places to those whose robots wait for a lane."""
        waiting, queue = self._places.waiting, self._places.queue
        left = waiting[queue[NEXT] : queue[LAST]].tolist()
        count = len(left) + len(places)
        waiting[:count] = [*left, *places]
        queue[:] = 0, count

    def stop(self, place: int) -> float:
        """Empties a place, whether its robot has ended or not. Returns its wall time in s."""
        self._running[self._log.place == place] = loop.IDLE
        self._prepared[place] = None
        return float(self._wall_times[place])

    def advance(self, body_steps: int) -> list[int]:
        """Simulates until a robot ends, or for about `body_steps` iterations times bodies. Returns
        the places of robots that have ended; stop() empties a place. Other Python threads run
        meanwhile."""
        self._simulate(body_steps)
        ended = np.flatnonzero(self.status != loop.RUNNING).tolist()
        return [place for place in ended if self._prepared[place] is not None]

    def advance_to_pause(self, signals: np.ndarray, marks: np.ndarray) -> None:
        """Simulates a control period of the robots with marks; see Stepper.advance()."""
        self._places.signals[:], self._places.marks[:] = signals, marks
        work = self._places.states[:, loop.TRIED] - self._tried
        self._tried += work
        longest_first = np.argsort(-work, kind="stable")  # so that the lanes end together
        self._wait(longest_first[np.isfinite(marks[longest_first, 0])])
        self._simulate(BODY_STEPS)
        while (self._running == loop.RUNNING).any():
            self._simulate(BODY_STEPS)

    def _simulate(self, body_steps: int) -> None:
        """Simulates until a robot ends, or for about `body_steps` iterations times bodies."""
        started = time.perf_counter()
        self._advance(self._parts, max(1, body_steps // (ROUND * self._bodies)))
        busy = len(self._prepared) - self._prepared.count(None)
        self._wall_times += (time.perf_counter() - started) / max(busy, 1)

    def failure(self, place: int) -> SimulationFailure | None:
        """The failure of the robot in a place; None if it goes on or has reached its end."""
        prepared, status = self._prepared[place], int(self.status[place])
        if prepared is None or status <= loop.DONE:
            return None
        ended = float(self._places.states[place, loop.TIME])
        failure = _failure(status, time=ended, prepared=prepared)
        failure.wall_time = float(self._wall_times[place])
        return failure

    def result(self, place: int) -> SimulationResult:
        """The result of the robot in a place, at the end of its motion. Raises Diverged or
        StepBudgetExceeded if the simulation failed."""
        prepared, failure = self._prepared[place], self.failure(place)
        if prepared is None:
            raise ValueError(f"place {place} is idle")
        if failure is not None:
            raise failure
        state = self._places.states[place].copy()
        return make_result(
            prepared.robot,
            prepared.gait,
            self.motion(place),
            totals=views(prepared.start.tally, state[self._tally :]),
            work=IntegratorWork(
                scheme="ros2",
                accuracy=prepared.robot.scenario.settings_of(Compiled).tolerance,
                steps=int(state[loop.TAKEN]),
                derivative_evaluations=loop.EVALUATIONS * int(state[loop.TRIED]),
            ),
            wall_time=float(self._wall_times[place]),
            record=prepared.record,
        )

    def motion(self, place: int) -> Motion:
        """Samples of the latest simulation in a place, up to now."""
        log = self._log
        kept = slice(log.kept[place])
        return Motion(
            times=log.times[place, kept].copy(),
            states=log.states[place, kept].copy(),
            signals=log.signals[place, kept].copy(),
            modes=log.modes[place, kept].copy(),
            drives=log.drives[place, kept].copy(),
        )


def _failure(status: int, *, time: float, prepared: Prepared) -> SimulationFailure:
    """The failure of a simulation that ended at a time (s) with this status."""
    if status == loop.TOO_MANY_EVALUATIONS:
        budget = prepared.robot.scenario.simulation.max_evaluations
        reason = f"force evaluations exceed the budget of {budget}"
        return StepBudgetExceeded(time=time, reason=reason)
    if status == loop.TOO_FAST:
        return Diverged.too_fast(time=time, limit=float(prepared.constants.max_speed[0]))
    return Diverged(time=time, reason="no step is small enough for the tolerance")


def processor_lanes() -> int:
    """Number of lanes on this processor, for any number of robots, so that one kernel is compiled.

    The results do not depend on it. Eight doubles fill a register of AVX-512. With narrower
    registers, eight lanes would need more registers than there are, so four are faster.
    """
    return 8 if "+avx512f" in processor_features() else 4


def processor_features() -> str:
    """Instruction sets that numba compiles for, such as "+avx2": from its settings or the
    machine."""
    return registry.cpu_target.target_context.codegen().magic_tuple()[2]


def _constants_in_lanes(
    constants: loop.Constants, heights: np.ndarray, width: int
) -> tuple[loop.Constants, np.ndarray]:
    """Tables in lanes for constants like the given ones, and their memory (numbers, lanes)."""
    lanes, memory = in_lanes(constants, width)
    # A field of any size: one compiled kernel serves robots of any size.
    inhibition = FieldArray(lanes.network.inhibition.array, width, any_size=True)
    ground = lanes.robot.ground._replace(heights=FieldArray(heights.ravel()))
    robot, network = lanes.robot._replace(ground=ground), lanes.network
    return lanes._replace(robot=robot, network=network._replace(inhibition=inhibition)), memory
