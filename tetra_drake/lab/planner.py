"""Planner: model predictive control of robots by sampled motions, in real time (MPPI).

In each decision the planner simulates many noisy copies of its last plan from the present state, on
the compiled engine. The new plan is their mean, weighted by exp(-cost / temperature): model
predictive path integral control (Williams et al., 2017).
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping, Sequence
from types import NoneType
from typing import Any

import numpy as np
import numpy.typing as npt

from tetra_drake.errors import (
    InputError,
    check_positive,
    check_type,
    check_whole,
    checked_numbers,
)
from tetra_drake.lab.stepping.simulation import Simulation
from tetra_drake.lab.stepping.states import States
from tetra_drake.laws.actuator import limits_of
from tetra_drake.robot.command import Command
from tetra_drake.robot.readings import Readings
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import GivenScenario, given_scenario

Cost = Callable[[Readings], npt.ArrayLike] | Mapping[str, npt.ArrayLike]
"""Cost of motions, from Readings whose arrays have the axes (times, robots, ...). A function
returns costs of the robots (robots,), or of each time (times, robots), whose mean counts. Or
weights by the names of readings: the cost is the sum of the readings times their weights."""


_LOG = logging.getLogger("tetra_drake")
MOST_STEPS = 10_000
"""Largest number of control periods that a plan looks ahead."""


class Planner:
    """Controller that plans the actions of a robot again and again, with a simulation as its model.

        >>> planner = td.Planner(
        ...     td.load_scenario("quick"), {"v_WN": [-1.0, 0.0, 0.0]}, samples=8, horizon=0.1
        ... )
        >>> result = td.simulate(td.load_scenario("quick"), controller=planner)
        >>> inches, speed = result.metrics.distance_in, planner.decisions_per_second

    The robot may be on another engine than the model, or be disturbed. The planner knows its
    readings only. From them the model gets the positions and velocities of the bodies. Contact
    nodes that touch the ground stick where they are; deflections of bristles begin at 0. The states
    of the actuators are those that the model has reached with the same actions.

    A plan has a value at each of a few knots, evenly spaced over the horizon, for each driven
    cable. Plans are linear between knots, and actions are held for a control period. For another
    robot of the same scenario, reset() it.

    Attributes:
        model: the simulation of the samples. `model.damage(0, cables=[...])` tells the planner of
            cut cables; `model.reset()` repairs it.
        limits: least and greatest actions, two rows (2, actions).
        wall_times: wall times (s) of the decisions.
        costs: mean costs of the samples in the decisions, without samples that have failed.
    """

    __name__ = "planner"

    def __init__(
        self,
        scenario: GivenScenario,
        cost: Cost,
        *,
        samples: int = 200,
        horizon: float = 2.0,
        knots: int = 10,
        temperature: float = 0.3,
        noise: float = 0.3,
        command: Command | None = None,
        limits: npt.ArrayLike | None = None,
        control_period: float | None = None,
        decision_period: float | None = None,
        delayed: bool = False,
        seed: int = 0,
        workers: int | None = None,
    ) -> None:
        """Makes a planner. The cost is tried once, with robots at rest.

        Args:
            scenario: the scenario of the model. Its engine, events and disturbances do not count.
            cost: what the planner minimises; see Cost.
            samples: number of simulated plans in each decision.
            horizon: time (s) that a plan looks ahead.
            knots: number of knots of a plan, the first one at its beginning.
            temperature: how far worse samples count: a sample that is worse than the best by this
                share of the costs' standard deviation has a weight of 1/e.
            noise: standard deviation of the samples' knots, as a share of half the actions' range.
            command: setpoints over time, such as the commands of a gait (see td.export and
                td.load_command). The first plan is to follow them. Later plans change them by up to
                half the actions' range. Without a command, the first plan is to stay at rest.
            limits: least and greatest action of each cable in SI units, (2, actions) or (2, 1). By
                default the actions for signals with the usual amplitude of a network, within the
                limits of the actuators, and the command.
            control_period: time (s) between the model's actions; by default the scenario's.
            decision_period: time (s) between decisions, a multiple of the control period, which is
                its default.
            delayed: True for a plan that acts one decision period after its readings, so that there
                is time to compute it; the model predicts the state until then.
            seed: seed of the noise.
            workers: number of threads; one per core by default.

        Raises:
            InputError: if an argument does not fit, the robot has no driven cables, or the cost is
                NaN or has another shape.
        """
        source, scenario = "Planner", given_scenario(scenario).on_engine("compiled")
        self._samples = check_whole(source, "samples", samples, least=2)
        self._knots = check_whole(source, "knots", knots, least=2, most=MOST_STEPS)
        self._seed = check_whole(source, "seed", seed, least=0)
        check_type(source, "delayed", delayed, bool)
        check_type(source, "cost", cost, Callable, Mapping)
        check_type(source, "command", command, Command, NoneType)
        step = scenario.simulation.control_period if control_period is None else control_period
        pause = step if decision_period is None else decision_period
        given = {"horizon": horizon, "temperature": temperature, "noise": noise}
        for key, number in (given | {"decision_period": pause, "control_period": step}).items():
            check_positive(source, key, number)
        self._cost, self._temperature, self._noise = cost, temperature, noise
        self._period, self._delayed, self._decision_period = step, delayed, pause
        self._steps, self._ahead = math.ceil(horizon / step - 1e-6), round(pause / step)
        if self._ahead < 1 or abs(pause - self._ahead * step) > 1e-6 * step or pause > horizon:
            expected = f"expected a multiple of the control period, {step:g} s, up to the horizon"
            raise InputError(source, "decision_period", f"found {pause:g} s, {expected}")
        if self._steps > MOST_STEPS:
            expected = f"expected at most {MOST_STEPS} control periods of {step:g} s"
            raise InputError(source, "horizon", f"found {horizon:g} s, {expected}")

        # The model's time begins at each decision anew, so that it needs little memory.
        duration = step * (self._steps + self._ahead + 2)
        alone = scenario.undisturbed().with_sections(policy=None, evolve={}, sensing=None)
        model = alone.with_numbers({"simulation.duration": duration})
        robot = Robot.of(model)
        if not robot.driven.size:
            raise InputError(source, "scenario", f"{scenario.name} has no driven cables to plan")
        self.model = Simulation(model, count=samples, control_period=step, workers=workers)
        self.limits, self._command = self._usual_limits(robot), command
        if command is not None:
            command.check(robot)
            known = np.vstack([self.limits, command.samples])
            self.limits = np.stack([known.min(axis=0), known.max(axis=0)])
        if limits is not None:
            shape = self.limits.shape
            own = checked_numbers(limits, shape, (2, 1), source=source, key="limits")
            self.limits = np.broadcast_to(own, shape)
        if not (np.isfinite(self.limits).all() and (self.limits[0] <= self.limits[1]).all()):
            raise InputError(source, "limits", "expected finite numbers, the least actions first")

        times, grid = step * np.arange(self._steps), np.linspace(0.0, horizon, knots)
        self._between, self._shift = _shares(times, grid), _shares(grid + pause, grid)
        self.reset()
        self._costs([self.model.state], 0.0)

    def reset(self) -> None:
        """Begins anew: without a plan, with a robot at its start, and with the first noise. Cables
        that the planner knows to be cut stay so."""
        cut = self.model.damage_of(0)
        self.model.reset()
        if cut:
            self.model.damage(0, cables=cut)
        middle, self._half = self.limits.mean(axis=0), 0.5 * np.ptp(self.limits, axis=0)
        self._base = self._command or Command("middle", self._period, middle[np.newaxis])
        first = np.zeros_like(middle)
        if self._command is None:
            first = (self.model.rest[0] - middle) / np.where(self._half > 0.0, self._half, 1.0)
        self._plan = self._next_plan = np.tile(np.clip(first, -1.0, 1.0), (self._knots, 1))
        self._random = np.random.default_rng(self._seed)
        self._begins, self._next, self._latest = 0.0, -math.inf, -math.inf
        self.wall_times: list[float] = []
        self.costs: list[float] = []
        self.lost = 0
        """Number of decisions that kept the plan before, since all samples failed: readings with
        NaN, such as of a lost marker, or a robot that nothing saves."""

    @property
    def decisions(self) -> int:
        """Number of decisions since reset()."""
        return len(self.wall_times)

    @property
    def decisions_per_second(self) -> float:
        """Decisions per second of wall time that the planner can make, on average."""
        return self.decisions / sum(self.wall_times) if self.wall_times else math.nan

    @property
    def deadlines_kept(self) -> float:
        """Share of the decisions that took no longer than the decision period."""
        return float(np.mean(np.array(self.wall_times) <= self._decision_period))

    def __str__(self) -> str:
        speed, kept = self.decisions_per_second, self.deadlines_kept
        lost = f", {self.lost} without a result" * (self.lost > 0)
        return f"{self.decisions} decisions, {speed:.3g} per second, {kept:.1%} in time{lost}"

    def __call__(self, now: float, readings: Readings) -> np.ndarray:
        """The actions (actions,) at a time (s), for simulate(controller=...).

        `readings` are of one robot, without an axis of robots. A time before the latest one
        begins anew; see reset().
        """
        now = float(checked_numbers(now, (), source="Planner", key="now", finite=True))
        check_type("Planner", "readings", readings, Readings)
        if now < self._latest:
            self.reset()
        self._latest = now
        if now >= self._next - 1e-9:
            started = time.perf_counter()
            self._decide(now, readings)
            self.wall_times.append(time.perf_counter() - started)
            self._begins, self._next = now, now + self._decision_period
        step = int((now - self._begins) / self._period + 1e-6)
        return np.asarray(self._actions(self._plan, self._begins)[min(step, self._steps - 1)])

    def _actions(self, plans: np.ndarray, begin: float) -> np.ndarray:
        """Actions (..., control periods, actions) of plans (..., knots, actions) that begin at a
        time (s)."""
        base = self._base.at(begin + self._period * np.arange(self._steps))
        return np.clip(base + self._half * (self._between @ plans), *self.limits)

    def _decide(self, now: float, readings: Readings) -> None:
        """Makes the plan from now on, or, if it is delayed, from the next decision on. The model's
        first robot is the robot's twin: it goes on to the time of the next decision."""
        self.model.assume(readings._replace(time=self._period))
        if self._delayed:
            self._plan = self._next_plan
            self._go_on(now)
            state = self.model.save([0])
            self._next_plan = self._improved(self._shift @ self._plan, state, now)
            self.model.restore(state, [0])
            return
        state, first = self.model.save([0]), not self.decisions
        self._plan = self._improved(self._plan if first else self._shift @ self._plan, state, now)
        self.model.restore(state, [0])
        self._go_on(now)

    def _go_on(self, now: float) -> None:
        """Moves the robot's twin by the plan until the next decision."""
        for actions in self._actions(self._plan, now)[: self._ahead]:
            self.model.step(np.tile(actions, (self._samples, 1)), indices=[0])

    def _improved(self, plan: np.ndarray, state: States, now: float) -> np.ndarray:
        """Weighted mean of noisy copies of a plan; the first copy has no noise."""
        noise = self._random.normal(0.0, self._noise, (self._samples, *plan.shape))
        noise[0] = 0.0
        candidates = np.clip(plan + noise, -1.0, 1.0)
        begin = now + self._decision_period if self._delayed else now
        actions = self._actions(candidates, begin)
        self.model.restore(state)
        moments = [self.model.step(actions[:, step]) for step in range(self._steps)]
        costs = self._costs(moments, now - self._period)
        known = np.isfinite(costs)
        if not known.any():  # all have failed
            if not self.lost:
                _LOG.warning("planner: all samples fail at %g s; it keeps its plan", now)
            self.lost += 1
            self.costs.append(math.nan)
            return plan
        self.costs.append(float(costs[known].mean()))
        scale = self._temperature * float(costs[known].std()) or 1.0
        weights = np.exp((costs[known].min() - costs) / scale)
        return np.asarray(np.tensordot(weights / weights.sum(), candidates, 1))

    def _costs(self, moments: Sequence[Readings], offset: float) -> np.ndarray:
        """Costs (samples,) of the motions with readings at several times; infinite for robots that
        have failed. Their times are counted from `offset` (s). Raises InputError for costs that are
        NaN or -inf, or have another shape."""
        readings = Readings(*(np.array(values) for values in zip(*moments, strict=True)))
        readings = readings._replace(time=readings.time + offset)
        shape = readings.time.shape
        given: Any = self._cost
        if isinstance(given, Mapping):
            given = sum(self._weighted(name, readings) for name in given)
        else:
            given = given(readings)
        costs = checked_numbers(given, shape[1:], shape, source="Planner", key="cost")
        costs = costs.mean(axis=0) if costs.ndim == 2 else costs
        failed = np.array([failure is not None for failure in self.model.failures])
        if (bad := ~(costs > -math.inf) & ~failed).any():
            problem = f"found {costs[bad.argmax()]} for sample {bad.argmax()}, expected numbers"
            raise InputError("Planner", "cost", problem)
        return np.where(failed, math.inf, costs)

    def _weighted(self, name: str, readings: Readings) -> np.ndarray:
        """Sum (times, samples) of the readings with a name times their weights."""
        if name not in Readings._fields:
            known = ", ".join(Readings._fields)
            raise InputError("Planner", f"cost.{name}", f"is no reading, expected one of {known}")
        values, weights = getattr(readings, name), self._cost[name]  # type: ignore[index]
        try:
            weighted = np.broadcast_to(weights, values.shape[2:]) * values
        except (TypeError, ValueError):
            problem = f"found {weights!r:.60}, expected weights of shape {values.shape[2:]}"
            raise InputError("Planner", f"cost.{name}", problem) from None
        return np.asarray(weighted.reshape(*values.shape[:2], -1).sum(axis=-1))

    @staticmethod
    def _usual_limits(robot: Robot) -> np.ndarray:
        """Least and greatest actions (2, actions) of a robot with a network, by its signals' usual
        amplitude and by the limits of its actuators."""
        scenario, cables = robot.scenario, robot.starting_cables()
        amplitude = scenario.cpg.usual_amplitude * np.array([[-1.0], [1.0]])
        signals = np.broadcast_to(amplitude, (2, robot.driven.size))
        ends = scenario.actuation.commands(cables._replace(signal=signals))
        least = limits_of(scenario.actuation.actuator()).least_length
        return np.sort(ends if math.isnan(least) else np.maximum(ends, least), axis=0)


def _shares(times: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Matrix (times, knots) that interpolates values at the times `grid` of knots linearly."""
    return np.stack([np.interp(times, grid, one) for one in np.eye(len(grid))], axis=1)
