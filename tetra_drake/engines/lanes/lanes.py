"""Memory of the compiled engine: robots in places, which take turns in the lanes of a thread."""

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
from tetra_drake.engines.time_limit import check_time
from tetra_drake.errors import Diverged, SimulationFailure, StepBudgetExceeded
from tetra_drake.kernels.allocation import allocate
from tetra_drake.kernels.compiling import machine_code
from tetra_drake.kernels.lanes import FieldArray
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.actuator import DRIVE
from tetra_drake.laws.terrain import SurfaceGrid
from tetra_drake.results.result import IntegratorWork, SimulationResult, make_result
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.driven import MARK_DECIMALS
from tetra_drake.robot.readings import Readings
from tetra_drake.scenario.engine_kinds import Compiled

FIRST = SurfaceGrid._fields.index("first")
"""Column of Ground.grid with the index of the first height. It differs between robots, because one
table has the heights of all robots."""

_BODY_STEPS = 25_000
"""Iterations times bodies per call of the kernel, about 30 ms. Between calls Python handles signals
of the operating system, and limits of time."""


class Lanes:
    """Similar robots (see accepts()), which one thread simulates in the lanes of this processor."""

    def __init__(self, first: Prepared, readings: Readings) -> None:
        """Places for robots like `first`, one for each row of `readings`. Compiles the kernel if
        necessary."""
        robot, width, places = first.robot, processor_lanes(), len(readings.time)
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
            "numbers": index(self._lanes.step.end, states),
            "constants": len(constants),
            "signals": robot.structure.signals,
        }
        self._places = allocate(Places, sizes)
        memory = Memory(states, constants)
        self._parts = Packed(
            (
                self._constants,
                self._lanes,
                self._log,
                memory,
                self._places,
                readings,
                first.driven.is_live,
            )
        )
        self._advance = machine_code(advance, self._parts, 0)
        self._prepared: list[Prepared | None] = [None] * places
        self._wall_times, self._tried = np.zeros(places), np.zeros(places)
        self._running = self._lanes.clock.array[loop.STATUS]
        self._running[:] = loop.IDLE
        self._ends = np.zeros(places)

    @property
    def status(self) -> np.ndarray:
        """Status of the robot in each place; see loop."""
        return self._places.states[:, loop.STATUS]

    def accepts(self, prepared: Prepared) -> bool:
        """True if a robot fits these tables: the same structure and kinds of laws as the first
        robot, and no more samples, marks, turns or heights."""
        log = self._log
        return (
            prepared.kind == self._kind
            and len(prepared.times) < log.times.shape[1]
            and len(prepared.driven.marks) < log.marks.shape[1]
            and prepared.recent_signals <= log.recent.shape[1]
            and len(prepared.turns) <= log.turns.shape[1]
            and prepared.robot.ground.heights.size <= self._heights.shape[1]
        )

    def load(self, place: int, prepared: Prepared) -> None:
        """Puts a robot at its start."""
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
        marks, turns, samples = prepared.driven.marks, prepared.turns, prepared.driven.samples
        log.times[place] = log.marks[place] = math.inf
        log.times[place, : len(prepared.times)] = prepared.times
        log.marks[place, : len(marks)] = marks
        log.turns[place], log.turns[place, : len(turns)] = turns[-1], turns
        log.states[place, 0], log.modes[place, 0] = start.step.state, start.modes
        log.signals[place, 0] = start.signals
        log.recent[place, : len(samples)] = samples
        log.drives[place, 0] = start.drives[:, DRIVE]
        log.kept[place], log.passed[place], log.change_ends[place] = 1, 0, 0.0
        state = self._places.states[place]
        state[:] = numbers_of(start)[: state.size]
        engine = prepared.robot.scenario.settings_of(Compiled)
        state[loop.STATUS], state[loop.SAMPLES] = loop.DONE, len(samples)
        state[loop.PLANNED] = min(engine.look_ahead, engine.max_step)
        state[loop.DUE] = log.times[place, 1]
        self._places.signals[place], self._places.holds[place] = start.signals, 0
        self._prepared[place], self._ends[place] = prepared, marks[-1]
        self._wall_times[place] = self._tried[place] = 0.0

    def stop(self, place: int) -> float:
        """Empties a place, whether its robot has ended or not. Returns its wall time in s."""
        self._wait([other for other in self._waiting() if other != place])
        self._running[self._log.place == place] = loop.IDLE
        self.status[place] = loop.IDLE
        self._prepared[place], self._ends[place] = None, 0.0
        return float(self._wall_times[place])

    def copy(self, place: int, to: int, source: Lanes) -> None:
        """Copies a robot from a place of other lanes like these, which may be these."""
        self.stop(to)
        for name in set(loop.Log._fields) - {"place"}:
            getattr(self._log, name)[to] = getattr(source._log, name)[place]
        for name in ("states", "constants", "signals", "holds"):
            getattr(self._places, name)[to] = getattr(source._places, name)[place]
        self._places.constants[to, self._first_height] = to * self._heights.shape[1]
        network, others = self._constants.network, source._constants.network
        network.first.array[:] = np.minimum(network.first.array, others.first.array)
        network.beyond.array[:] = np.maximum(network.beyond.array, others.beyond.array)
        self._prepared[to], self._heights[to] = source._prepared[place], source._heights[place]
        self._ends[to], self._tried[to] = source._ends[place], source._tried[place]
        self._wall_times[to] = source._wall_times[place]

    def advance(
        self, until: np.ndarray, signals: np.ndarray | None, *, briefly: bool = False
    ) -> None:
        """See Batch.advance(). Other Python threads run meanwhile."""
        states, log, places = self._places.states, self._log, self._places
        log.until[:] = np.minimum(until, self._ends)
        goes = (self.status == loop.DONE) & (states[:, loop.TIME] < log.until)
        if signals is not None:
            step = self._constants.period.array[0, 0]
            ends = (states[:, loop.TIME] + step).round(MARK_DECIMALS)
            changes = goes & (signals != places.signals).any(axis=1)
            log.change_ends[changes] = ends[changes]
            places.signals[goes], places.holds[goes] = signals[goes], 1
        states[goes, loop.STATUS] = loop.RUNNING
        work = states[:, loop.TRIED] - self._tried
        self._tried += work
        longest_first = np.argsort(-work, kind="stable")  # so that the lanes end together
        self._wait([*self._waiting(), *longest_first[goes[longest_first]]])
        self._simulate()
        while not briefly and (self._running == loop.RUNNING).any():
            check_time()
            self._simulate()

    def _waiting(self) -> list[int]:
        """The places whose robots wait for a lane."""
        first, last = self._places.queue[[NEXT, LAST]]
        return self._places.waiting[first:last].tolist()

    def _wait(self, places: Sequence[int]) -> None:
        """Sets the places whose robots wait for a lane."""
        self._places.waiting[: len(places)] = places
        self._places.queue[[NEXT, LAST]] = 0, len(places)

    def _simulate(self) -> None:
        """Simulates until a robot ends and none waits, or for some 30 ms."""
        started = time.perf_counter()
        self._advance(self._parts, max(1, _BODY_STEPS // (ROUND * self._bodies)))
        busy = max(1, int(np.count_nonzero(self._ends)))
        self._wall_times += (time.perf_counter() - started) / busy

    def ended(self, place: int) -> bool:
        """True if the robot in a place has failed, or reached its end."""
        arrived = self._places.states[place, loop.TIME] >= self._ends[place]
        return bool(self.status[place] > loop.DONE or (self.status[place] == loop.DONE and arrived))

    def failure(self, place: int) -> SimulationFailure:
        """The failure of the robot in a place."""
        prepared = self._prepared[place]
        assert prepared is not None
        ended = float(self._places.states[place, loop.TIME])
        failure = _failure(int(self.status[place]), time=ended, prepared=prepared)
        failure.wall_time = float(self._wall_times[place])
        return failure

    def result(self, place: int) -> SimulationResult:
        """The result of the robot in a place, at its end."""
        prepared = self._prepared[place]
        assert prepared is not None
        state = self._places.states[place].copy()
        return make_result(
            prepared.driven,
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
