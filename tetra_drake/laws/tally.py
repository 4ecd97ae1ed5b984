"""Tally of a simulation: sums and extremes over all steps, which metrics are computed from.

A part of the tally is a NamedTuple of tables, with a kernel that adds a step to them. All engines
call observe(), which calls these kernels, at every step. On MuJoCo, which has its own contact, the
forces of the ground here are the law's at MuJoCo's states. TalliedMetrics declares the metrics that
are computed from the tables; scenario.metrics has all metrics.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple, Self

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Real, Table, Truth, maximum, minimum, select
from tetra_drake.kernels.packed import allocate
from tetra_drake.laws import cable
from tetra_drake.laws.actuator import LIMITS, exertion
from tetra_drake.laws.clearance import least_strut_distance
from tetra_drake.laws.contact import NORMAL
from tetra_drake.laws.forces import Forces, sizes_of
from tetra_drake.laws.kinematics import pitch_rate
from tetra_drake.laws.model import Model


class Step(NamedTuple):
    """A step of a simulation, with signals and forces at its end. The first step, and a repeated
    step, take no time."""

    robot: Model
    signals: Table
    """Signals (signals,) in N at the end of the step."""
    signals_before: Table
    """Signals (signals,) in N at the beginning of the step."""
    forces: Forces
    duration: Real
    """Duration of the step in s."""
    takes_time: Truth
    counts: Truth
    """True if the step takes time and is in the steady stretch. Sums are over these steps."""
    counted: Real
    """Duration (s) of the step if it counts, otherwise 0."""


class Effort(NamedTuple):
    """Effort of the actuators. Integrals are over the steady stretch, summed over the actuators;
    peaks are over all steps."""

    left: Annotated[Table, "cables"]
    """Exertion.left of each driven cable at the latest step, in m."""
    peak_force: Annotated[Table, 1]
    """Largest load of an actuator, in N; see actuator.Exertion."""
    peak_speed: Annotated[Table, 1]
    """Largest speed of an actuator in either direction, in m/s."""
    peak_power: Annotated[Table, 1]
    """Largest power of an actuator, in W."""
    impulse: Annotated[Table, 1]
    """Integral of the load, in N s."""
    wound: Annotated[Table, 1]
    """Length of cable wound and paid out, in m."""
    pulled: Annotated[Table, 1]
    """Integral of the positive power of the load, in J."""
    work: Annotated[Table, 1]
    """Integral of the positive power of Exertion.pull, in J."""
    limited: Annotated[Table, 1]
    """Time at a limit of an actuator, in s."""


@inlined
def add_to_effort(effort: Effort, step: Step) -> None:
    """Adds a step."""
    signal, cable_forces = step.robot.cables.signal, step.forces.cable_forces
    drives = step.forces.drives
    per_time, work = select(step.takes_time, 1.0 / step.duration, 0.0), 0.0 * step.duration
    drive = 0
    for i in range(effort.left.size):
        if signal[i] == cable.PASSIVE:
            continue
        tension, length = cable_forces[i, cable.TENSION], cable_forces[i, cable.LENGTH]
        mean_signal = 0.5 * (step.signals_before[signal[i]] + step.signals[signal[i]])
        own = exertion(step.robot.actuator, drives, drive, tension, length, mean_signal)
        drive += 1
        wound = select(step.takes_time, effort.left[i] - own.left, 0.0)
        effort.left[i] = own.left
        speed = wound * per_time
        effort.peak_force[0] = maximum(effort.peak_force[0], own.load)
        effort.peak_speed[0] = maximum(effort.peak_speed[0], abs(speed))
        effort.peak_power[0] = maximum(effort.peak_power[0], own.load * speed)
        wound = select(step.counts, wound, 0.0)
        work += maximum(own.pull * wound, 0.0)
        effort.impulse[0] += step.counted * own.load
        effort.wound[0] += abs(wound)
        effort.pulled[0] += maximum(own.load * wound, 0.0)
        effort.limited[0] += step.counted * own.limited
    effort.work[0] += work


class Roughness(NamedTuple):
    """Roughness of the signals."""

    total: Annotated[Table, 1]
    """Integral of (dS/dt)² of all signals, in N²/s."""


@inlined
def add_to_roughness(roughness: Roughness, step: Step) -> None:
    """Adds a step."""
    square = 0.0 * step.duration
    for k in range(step.signals.size):
        change = step.signals[k] - step.signals_before[k]
        square += change * change
    roughness.total[0] += select(step.counts, square / step.duration, 0.0)


class Lifted(NamedTuple):
    """Time that bodies are off the ground."""

    time: Annotated[Table, "bodies"]
    """Time (bodies,) in s while no contact node of a body bears a normal force."""


@inlined
def add_to_lifted(lifted: Lifted, step: Step) -> None:
    """Adds a step."""
    carriers, i = step.robot.ground.carriers, 0
    for body in range(lifted.time.size):
        load = 0.0 * step.counted
        while i < carriers.size and carriers[i] == body:
            load += step.forces.ground_forces[i, NORMAL]
            i += 1
        lifted.time[body] += select(load == 0.0, step.counted, 0.0)


class LeastTension(NamedTuple):
    """Least tension over all steps."""

    of_all: Annotated[Table, 1, math.inf]
    """Least tension of all cables, in N."""


@inlined
def add_to_tension(tension: LeastTension, step: Step) -> None:
    """Adds a step."""
    least = tension.of_all[0]
    for i in range(step.forces.cable_forces.shape[0]):
        least = minimum(least, step.forces.cable_forces[i, cable.TENSION])
    tension.of_all[0] = least


class Rolled(NamedTuple):
    """Rotation of the structure about the world's y axis, over all steps."""

    rate: Annotated[Table, 1]
    """Angular velocity (rad/s) at the latest step; see kinematics.pitch_rate()."""
    angle: Annotated[Table, 1]
    """Integral of the rate, in rad."""


@inlined
def add_to_rolled(rolled: Rolled, step: Step) -> None:
    """Adds a step."""
    first_node = step.robot.first_node
    rate = pitch_rate(step.forces.nodes, first_node[first_node.size - 1])
    rolled.angle[0] += select(step.takes_time, 0.5 * step.duration * (rolled.rate[0] + rate), 0.0)
    rolled.rate[0] = rate


class Tally(NamedTuple):
    """Tally of a simulation: its time, and the parts that metrics need."""

    begins: Annotated[Table, 1]
    """Time (s) at which the steady stretch begins."""
    time: Annotated[Table, 1]
    """Time (s) at the end of the latest step."""
    signals: Annotated[Table, "signals"]
    """Signals (N) at the end of the latest step."""
    clearance: Annotated[Table, 1, math.inf]
    """Least distance between struts, in m; see update_clearance()."""
    effort: Effort
    roughness: Roughness
    lifted: Lifted
    tension: LeastTension
    rolled: Rolled

    @classmethod
    def of(cls, robot: Model, *, signals: int, begins: float) -> Self:
        """The tally at the start of a simulation. `begins` (s) is the start of the steady
        stretch."""
        tally = allocate(cls, sizes_of(robot) | {"signals": signals})
        tally.begins[0] = begins
        return tally


@inlined
def observe(tally: Tally, robot: Model, time: Real, signals: Table, forces: Forces) -> None:
    """Adds the step that ends at `time` (s) with these signals and forces."""
    duration = time - tally.time[0]
    takes_time = duration > 0.0
    counts = takes_time & (tally.time[0] >= tally.begins[0])
    step = Step(
        robot=robot,
        signals=signals,
        signals_before=tally.signals,
        forces=forces,
        duration=duration,
        takes_time=takes_time,
        counts=counts,
        counted=select(counts, duration, 0.0),
    )
    add_to_effort(tally.effort, step)
    add_to_roughness(tally.roughness, step)
    add_to_lifted(tally.lifted, step)
    add_to_tension(tally.tension, step)
    add_to_rolled(tally.rolled, step)
    for k in range(signals.size):
        tally.signals[k] = signals[k]
    tally.time[0] = time


@inlined
def update_clearance(tally: Tally, robot: Model, state: Table, nodes: Table) -> None:
    """Updates the clearance for a state (13 bodies,). It is too slow to be called at every step.
    `nodes` is the table of laws.kinematics."""
    radius, first_node, least = robot.bodies.radius, robot.first_node, tally.clearance[0]
    least = least_strut_distance(robot.struts, radius, first_node, state, nodes, least)
    tally.clearance[0] = least


@dataclass(frozen=True)
class Metric:
    """Declaration of a metric: its unit, its computation, and its use."""

    unit: str
    """SI unit; "" for none."""
    note: str
    """Short explanation for tables."""
    compute: Callable[[Any], float]
    """Function of a scenario.metrics.Walk, or of Poses."""
    least: bool = False
    """True if the least value of several simulations is recorded, not their mean."""
    most: bool = False
    """True if the greatest value of several simulations is recorded."""
    is_cost: bool = False
    """True if less is better. A requirement is then an upper limit."""
    is_share: bool = False
    """True for a share of time. It is shown in percent."""
    of_pose: bool = False
    """True if Poses are enough for it."""
    needs: str = ""
    """Property, such as LIMITS, that a robot must have for this metric; "" for no condition."""


def metric(unit: str, note: str, compute: Callable[[Any], float], **more: Any) -> Any:
    """A field of a class of metrics, with its declaration as metadata; see Metric."""
    return field(metadata={"metric": Metric(unit, note, compute, **more)})


def total(name: str) -> Callable[[Any], float]:
    """Function of a Walk: a number of its tally, such as "effort.work"."""
    number = operator.attrgetter(name)
    return lambda walk: number(walk.tally)[0]


def mean(name: str) -> Callable[[Any], float]:
    """Function of a Walk: a total of Effort as mean over the steady stretch and the actuators."""
    return lambda walk: walk.per_actuator_time * getattr(walk.tally.effort, name)[0]


def greatest(unit: str, note: str, compute: Callable[[Any], float], **more: Any) -> Any:
    """Declaration of a cost whose greatest value of several simulations counts."""
    return metric(unit, note, compute, most=True, is_cost=True, **more)


def _signal_rate(walk: Any) -> float:
    mean_square = walk.per_steady_time * float(walk.tally.roughness.total[0])
    return math.sqrt(mean_square / max(walk.signals.shape[1], 1))


@dataclass(frozen=True)
class TalliedMetrics:
    """Metrics of every step of a simulation: functions of the tally."""

    rolled: float = metric("rad", "forward positive", total("rolled.angle"))
    """Angle by which the robot has rolled forward, about the world's y axis, at the end. Whole
    turns count. It is the integral of the angular velocity of the rigid motion that fits the nodes'
    velocities best, so a change of shape alone does not count."""
    actuator_work: float = metric("J", "of all actuators", total("effort.work"), is_cost=True)
    """Work of the actuators in the steady stretch, if they cannot recover energy: the integral of
    max(0, -S dl/dt) for driven cables with signal S and length l."""
    signal_rate: float = metric("N/s", "how fast signals change", _signal_rate, is_cost=True)
    """Root mean square of dS/dt over all signals S in the steady stretch. Smaller is smoother."""
    lifted: float = metric(
        "",
        "time off the ground",
        lambda walk: sum(walk.lifted_shares) / len(walk.lifted_shares),
        is_share=True,
    )
    """Share of the steady stretch during which a body is off the ground, mean over the bodies. A
    body is off the ground if no contact node of it bears a normal force. In MuJoCo this metric says
    little."""
    clearance: float = metric("m", "smallest gap of struts' axes", total("clearance"), least=True)
    """Least distance, at any time, between the axes of struts of two bodies. Struts overlap if it
    is less than their diameter: the model does not prevent this."""
    tension: float = metric("N", "smallest of any cable", total("tension.of_all"), least=True)
    """Least tension of any cable at any time. Below 0 the cable would have to push."""
    peak_actuator_force: float = greatest(
        "N", "at any time; a cable can pull a winch backward", total("effort.peak_force")
    )
    """Greatest load of an actuator at any time: the tension of its cable, without what the cable's
    own spring exerts beside an actuator with limits. It exceeds the `max_force` of a winch while
    the robot stretches the cable faster than the stalled winch pays out."""
    mean_actuator_force: float = metric("N", "of all driven cables", mean("impulse"), is_cost=True)
    """Mean load of the actuators in the steady stretch."""
    peak_actuator_speed: float = greatest("m/s", "at any time", total("effort.peak_speed"))
    """Greatest speed of an actuator at any time, winding or paying out: the rate of the free length
    for a winch, otherwise of the cable's length."""
    mean_actuator_speed: float = metric("m/s", "winding or paying out", mean("wound"), is_cost=True)
    """Mean speed in the steady stretch, winding or paying out."""
    peak_actuator_power: float = greatest("W", "at any time", total("effort.peak_power"))
    """Greatest product of an actuator's load and winding speed, at any time."""
    mean_actuator_power: float = greatest("W", "effort of an actuator", mean("pulled"))
    """Mean positive power of an actuator in the steady stretch: the effort of a gait."""
    actuator_limited: float = greatest(
        "", "time at a limit of an actuator", mean("limited"), is_share=True, needs=LIMITS
    )
    """Share of the steady stretch during which a limit of an actuator binds, mean over the
    actuators."""
