"""Batch: robots that an engine simulates side by side."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol, Self

import numpy as np
import numpy.typing as npt

from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.results.result import SimulationResult
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.command import policy_signals
from tetra_drake.robot.readings import Readings
from tetra_drake.robot.robot import Phase, Robot
from tetra_drake.robot.signals import DrivenRobot, Pilot
from tetra_drake.robot.structure import Structure

if TYPE_CHECKING:
    import xarray


Tables = Mapping[str, np.ndarray]
"""Tables of numbers by name."""

_SAME_TIME = 1e-9
"""Largest difference (s) of two times that are the same except for rounding."""


class Viewer(Protocol):
    """Display of a simulation while it runs."""

    def wants(self, time: float) -> bool:
        """True if the viewer wants to show the robot at this simulated time (s). The engine asks
        after each step, and calls show() if it is True."""

    def show(self, frame: xarray.Dataset) -> None:
        """Shows the robot. `frame` is a trajectory with a single sample; see
        results.trajectory.make_dataset."""


class Batch:
    """Robots that an engine simulates side by side.

    A batch has a fixed number N of places, numbered from 0. Each robot is in a place; a place
    without a robot is idle.
    """

    def __init__(self, structure: Structure, places: int) -> None:
        """Makes a batch of robots of one structure. `places` is its number of places, which are
        idle at first."""
        self.readings = Readings.empty(structure, places)
        """Readings of all robots at their last pause. At the start only the times are set."""
        self.failures: list[SimulationFailure | None] = [None] * places
        """Failure of the robot in each place; None if it has not failed."""
        self.signals = structure.signals
        """Number m of actuator signals of each robot."""
        self._phases: list[tuple[Phase, ...]] = [()] * places
        """The present phase of the robot in each place, and the phases after coming events."""
        self._pilots: list[Pilot | None] = [None] * places
        """The policy of the robot in each place; None without one."""
        self._events, self._actions = np.full((2, places), math.inf)
        """Times (s) of the next event, and of the next action of the policy, in each place;
        infinite if there is none."""
        self.has_history = np.ones(places, dtype=bool)
        """False for a robot whose motion so far is unknown, because it was restored without it."""

    def _begin_all(self, robots: Sequence[DrivenRobot]) -> None:
        """Puts robots in the first places, in their order. Raises InputError if one differs too
        much from the first robot; see begin()."""
        for place, robot in enumerate(robots):
            if not self.begin(place, robot):
                problem = "a robot has another structure, kind of law, or size than the first"
                raise InputError(robot.name, f"robot {place}", problem)

    def begin(self, place: int, robot: DrivenRobot) -> bool:
        """Puts a robot at its start into a place of the batch.

        Returns False, and changes nothing, if the robot differs too much from the first one of the
        batch: it has another structure or kind of law, or needs larger tables, such as of terrain
        heights.

        Raises InputError if the engine cannot simulate it, and SimulationFailure if it fails before
        its first step.
        """
        raise NotImplementedError

    def advance(
        self,
        until: npt.ArrayLike = math.inf,
        signals: npt.ArrayLike | None = None,
        *,
        briefly: bool = False,
    ) -> None:
        """Simulates each robot until its time in `until`, the end of its simulation, or a failure.
        Robots change at the times of their scenario's events.

        Calls time_limit.check_time() often, which raises TimeBudgetExceeded.

        Args:
            until: simulated times (s), for each place (N,) or for all. A robot that has reached its
                time pauses.
            signals: m actuator signals (N, m) of each robot, which are forces in newtons. They
                change linearly from the old ones within one network step, `cpg.listing_step`, and
                are then constant. A robot that pauses, or has a gait or a command, ignores them.
            briefly: returns as soon as a robot has ended, after some 30 ms of wall time, or at the
                next event or action of a policy. Engines that simulate one robot after another
                return only there.

        Raises:
            InputError: if an argument has another shape.
        """
        places = len(self.failures)
        times = checked_numbers(until, (), (places,), source="Batch", key="until")
        until = np.broadcast_to(times, places)
        if signals is not None:
            shape = places, self.signals
            self._hold(until, checked_numbers(signals, shape, source="Batch", key="signals"))
        while True:
            self._pass_events()
            self._act()
            instants = np.minimum(self._events, self._actions)
            # The policies act together: their robots wait for each other.
            waits = bool(np.isfinite(self._actions).any())
            self._advance(np.minimum(until, instants), briefly=briefly and not waits)
            goes_on = np.isfinite(instants) & (instants <= until)
            if briefly or not goes_on.any():
                return
            over = np.array([self.ended(place) for place in range(places)])
            self._events[over] = self._actions[over] = math.inf
            if not (goes_on & ~over).any():
                return

    def _follow(self, place: int, robot: DrivenRobot | None) -> None:
        """Notes what will happen to a robot at its start in a place: the events of its scenario,
        and the actions of its policy. None for a place without a robot."""
        self._phases[place] = () if robot is None else robot.robot.phases
        self._pilots[place] = pilot = None if robot is None else robot.pilot
        self._events[place] = _next_event(self._phases[place])
        self.has_history[place] = True
        self._actions[place] = math.inf if pilot is None else pilot.acts_after(0.0)

    def _pass_events(self) -> None:
        """Changes the robots that are at the time of an event."""
        for place in self._places_at(self._events):
            phases = self._phases[place]
            while self.readings.time[place] >= _next_event(phases) - _SAME_TIME:
                before, after, *_ = phases
                self._become(place, after.robot, after.p_BC - before.p_BC)
                phases = phases[1:]
            self._phases[place], self._events[place] = phases, _next_event(phases)

    def _act(self) -> None:
        """Lets the policies act whose robots are at the time of an action."""
        if not (places := self._places_at(self._actions)):
            return
        pilots = [pilot for place in places if (pilot := self._pilots[place]) is not None]
        signals, until = np.zeros((len(self._pilots), self.signals)), np.zeros(len(self._pilots))
        signals[places] = policy_signals(pilots, self.readings.rows(places))
        until[places] = math.inf
        self._hold(until, signals)
        for place, pilot in zip(places, pilots, strict=True):
            self._actions[place] = pilot.acts_after(self._actions[place])

    def _places_at(self, instants: np.ndarray) -> list[int]:
        """Places whose robots are at their time (s) in `instants`."""
        return np.flatnonzero(self.readings.time >= instants - _SAME_TIME).tolist()

    def _become(self, place: int, robot: Robot, p_BC: np.ndarray) -> None:
        """Replaces the robot in a place by another one of the same structure, whose nodes move on
        in the same way. The origins of its bodies' frames are at p_BC (bodies, 3) in m in the
        frames of the old one."""
        raise NotImplementedError

    def _hold(self, until: np.ndarray, signals: np.ndarray) -> None:
        """Sets the signals (N, m) of the robots that have not reached their time (s) in `until`;
        see advance()."""
        raise NotImplementedError

    def _advance(self, until: np.ndarray, *, briefly: bool) -> None:
        raise NotImplementedError

    def ended(self, place: int) -> bool:
        """True if the robot in a place has failed, or reached the end of its simulation. False if
        it has only paused, or the place is idle."""
        raise NotImplementedError

    def result(self, place: int) -> SimulationResult:
        """Result of the robot in a place, after its simulation has ended. Raises its failure if it
        failed, and InputError if it has not ended."""
        if failure := self.failures[place]:
            raise failure
        if not self.ended(place):
            raise InputError("Batch", f"place {place}", "has no robot that has reached its end")
        if not self.has_history[place]:
            problem = f"robot {place} was restored without its motion before: save(history=True)"
            raise InputError("Simulation", "result", problem)
        return self._result(place)

    def _result(self, place: int) -> SimulationResult:
        raise NotImplementedError

    def change(self, place: int, driven: DrivenRobot) -> None:
        """Lets the robot in a place go on as `driven`, which differs from it only by more events of
        its scenario, from now on."""
        phases, now = driven.robot.phases, self.readings.time[place] + _SAME_TIME
        phases = phases[sum(phase.begins <= now for phase in phases) - 1 :]
        self._become(place, phases[0].robot, phases[0].p_BC - self._phases[place][0].p_BC)
        self._rename(place, driven)
        self._phases[place], self._events[place] = phases, _next_event(phases)

    def _rename(self, place: int, driven: DrivenRobot) -> None:
        """Sets the robot at t = 0, for the result of the robot in a place."""
        raise NotImplementedError

    def save(self, places: Sequence[int], *, history: bool) -> dict[str, np.ndarray]:
        """The states of controlled robots that pause, as tables; the first axis is `places`. With
        `history` they have the motion so far."""
        saved = self._save(places)
        saved["phases_left"] = np.array([len(self._phases[place]) for place in places])
        for name, table in self.readings._asdict().items():
            saved[f"readings.{name}"] = table[places]
        motions = [self.motion(place) for place in places] if history else []
        if motions:
            kept = saved["history.kept"] = np.array([len(motion.times) for motion in motions])
            for name, first in vars(motions[0]).items():
                if first is not None:
                    table = np.zeros((len(places), kept.max(), *first.shape[1:]))
                    for row, motion in enumerate(motions):
                        table[row, : kept[row]] = getattr(motion, name)
                    saved[f"history.{name}"] = table
        return saved

    def restore(self, places: Sequence[int], saved: Tables) -> None:
        """Puts robots into states of save(). Places must have the same robots, which have not
        failed."""
        for place, left in zip(places, saved["phases_left"].tolist(), strict=True):
            now = self._phases[place]
            if len(now) != left:
                phases = (now[0].robot.before or now[0].robot).phases[-left:]
                self._become(place, phases[0].robot, np.zeros_like(phases[0].p_BC))
                self._phases[place], self._events[place] = phases, _next_event(phases)
        for name, table in self.readings._asdict().items():
            table[places] = saved[f"readings.{name}"]
        self._restore(places, saved)
        self.has_history[places] = "history.kept" in saved
        fields = [field.name for field in dataclasses.fields(Motion)]
        tables = {name: saved[f"history.{name}"] for name in fields if f"history.{name}" in saved}
        for row, place in enumerate(places if tables else ()):
            known = slice(saved["history.kept"][row])
            motion = Motion(**{name: table[row, known].copy() for name, table in tables.items()})
            self._remember(place, motion)

    def assume(self, place: int, time: float, readings: Readings) -> None:
        """Puts the robot in a place into the motion of other readings at a time (s). Its actuators
        keep their states. A contact node that touches the ground sticks. Raises InputError if the
        engine cannot do it."""
        raise InputError("Simulation", "assume", "needs a scenario on the engine compiled")

    def motion(self, place: int) -> Motion:
        """Recorded motion of the robot in a place, up to its present time."""
        raise NotImplementedError

    def _save(self, places: Sequence[int]) -> dict[str, np.ndarray]:
        """The engine's own tables for save()."""
        raise NotImplementedError

    def _restore(self, places: Sequence[int], saved: Tables) -> None:
        """Puts robots into the states of the engine's own tables, without their motions before."""
        raise NotImplementedError

    def _remember(self, place: int, motion: Motion) -> None:
        """Gives a restored robot its motion before."""
        raise NotImplementedError

    def stop(self, place: int) -> float:
        """Removes the robot and its failure from a place, which becomes idle. Returns the wall time
        (s) that the robot has taken."""
        raise NotImplementedError


class LoneRobot(Protocol):
    """Simulation of a single robot, as a part of a SerialBatch, which simulates one robot after
    another."""

    driven: DrivenRobot
    first: DrivenRobot
    """The driven robot at t = 0, before events."""
    wall_time: float
    """Wall time (s) that the simulation has taken."""

    def hold(self, signals: np.ndarray) -> None:
        """Sets the actuator signals (m,) in N that hold from now on. They change linearly from the
        old ones, within one `cpg.listing_step`."""

    def advance_to(self, time: float) -> None:
        """Simulates to a time (s). Raises Diverged or StepBudgetExceeded."""

    def readings(self) -> Readings:
        """The readings of the robot at its present time, without the axis of robots."""

    def result(self) -> SimulationResult:
        """The result at the end of the simulation."""

    def become(self, robot: Robot, p_BC: np.ndarray) -> Self:
        """The simulation that continues with another robot in place of this one; see
        Batch._become()."""

    def motion(self) -> Motion:
        """The motion up to now, at the times of the samples."""

    def numbers(self) -> dict[str, np.ndarray]:
        """The state of the simulation, as arrays by name."""

    def restore(self, numbers: Tables) -> None:
        """Puts the simulation into a state of numbers(), without the motion before."""

    def remember(self, motion: Motion) -> None:
        """Gives a restored simulation its motion before."""


class SerialBatch(Batch):
    """Batch of robots that are simulated one after another, each by its own LoneRobot."""

    def __init__(
        self, start: Callable[[DrivenRobot], LoneRobot], robots: Sequence[DrivenRobot], places: int
    ) -> None:
        """Starts robots in the first of `places` places; the other places are idle. `start` puts a
        robot at its start and returns its simulation."""
        super().__init__(robots[0].robot.structure, places)
        self._start = start
        self._robots: list[LoneRobot | None] = [None] * places
        self._reached, self._ends = np.zeros(places), np.zeros(places)
        self._begin_all(robots)

    def begin(self, place: int, robot: DrivenRobot) -> bool:
        structure = robot.robot.structure
        like, ours = Readings.empty(structure, 1), self.readings
        fits = all(a.shape[1:] == b.shape[1:] for a, b in zip(like, ours, strict=True))
        if structure.signals != self.signals or not fits:
            return False
        self._robots[place] = self._start(robot)
        self._follow(place, robot)
        self.failures[place], self.readings.time[place] = None, 0.0
        self._reached[place], self._ends[place] = 0.0, robot.robot.scenario.simulation.duration
        return True

    def _hold(self, until: np.ndarray, signals: np.ndarray) -> None:
        for place, robot in self._before(until):
            if robot.driven.is_controlled:
                robot.hold(signals[place])

    def _before(self, until: np.ndarray) -> list[tuple[int, LoneRobot]]:
        """Places and robots that have neither ended nor reached their time (s) in `until`."""
        places = np.flatnonzero(np.minimum(until, self._ends) > self._reached).tolist()
        robots = [(place, self._robots[place]) for place in places if not self.failures[place]]
        return [(place, robot) for place, robot in robots if robot is not None]

    def _advance(self, until: np.ndarray, *, briefly: bool) -> None:
        until = np.minimum(until, self._ends)
        for place, robot in self._before(until):
            try:
                robot.advance_to(float(until[place]))
            except SimulationFailure as failure:
                failure.wall_time = robot.wall_time
                self.failures[place] = failure
            else:
                self.readings.put(place, robot.readings())
                self._reached[place] = until[place]

    def _become(self, place: int, robot: Robot, p_BC: np.ndarray) -> None:
        self._robots[place] = self._robot_in(place).become(robot, p_BC)

    def _rename(self, place: int, driven: DrivenRobot) -> None:
        self._robot_in(place).first = driven

    def _robot_in(self, place: int) -> LoneRobot:
        robot = self._robots[place]
        assert robot is not None
        return robot

    def motion(self, place: int) -> Motion:
        return self._robot_in(place).motion()

    def _save(self, places: Sequence[int]) -> dict[str, np.ndarray]:
        rows = [self._robot_in(place).numbers() for place in places]
        saved = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        return saved | {"reached": self._reached[places]}

    def _restore(self, places: Sequence[int], saved: Tables) -> None:
        for row, place in enumerate(places):
            self._robot_in(place).restore({name: table[row] for name, table in saved.items()})
        self._reached[places] = saved["reached"]

    def _remember(self, place: int, motion: Motion) -> None:
        self._robot_in(place).remember(motion)

    def ended(self, place: int) -> bool:
        is_over = self.failures[place] is not None or self._reached[place] >= self._ends[place]
        return bool(is_over) and self._robots[place] is not None

    def _result(self, place: int) -> SimulationResult:
        return self._robot_in(place).result()

    def stop(self, place: int) -> float:
        robot, self._robots[place] = self._robots[place], None
        self.failures[place] = None
        self._follow(place, None)
        return 0.0 if robot is None else robot.wall_time


def _next_event(phases: Sequence[Phase]) -> float:
    """Time (s) at which the second phase begins; infinite if there is none."""
    return phases[1].begins if len(phases) > 1 else math.inf


def checked_numbers(
    given: npt.ArrayLike, *shapes: tuple[int, ...], source: str, key: str
) -> np.ndarray:
    """Converts an argument to real numbers (floats) of one of the given shapes. Raises InputError
    for anything else. Its message names `source`, the class or function, and `key`, the
    argument."""
    found = ""
    with contextlib.suppress(TypeError, ValueError):
        numbers = np.asarray(given)
        if numbers.dtype.kind in "iuf" and not np.ma.is_masked(given):
            if numbers.shape in shapes:
                return numbers.astype(float)
            found = f"the shape {numbers.shape}"
    problem = f"found {found or repr(given):.60}, expected real numbers of shape {shapes[0]}"
    raise InputError(source, key, problem)
