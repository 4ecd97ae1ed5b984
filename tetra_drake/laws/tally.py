"""Tally of a simulation: sums and extremes over all steps, which metrics are computed from.

All engines call observe() at every step. MuJoCo has its own model of contact. Its tally uses the
ground forces that laws.contact gives at MuJoCo's states. TalliedMetrics declares the metrics that
are computed from the tally; scenario.metrics has all metrics.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple, Self

from tetra_drake.kernels.compiling import inlined
from tetra_drake.kernels.lanes import Real, Table, maximum, minimum, select
from tetra_drake.kernels.packed import allocate
from tetra_drake.laws import cable
from tetra_drake.laws.actuator import LIMITS, exertion
from tetra_drake.laws.contact import NORMAL
from tetra_drake.laws.forces import Forces, sizes_of
from tetra_drake.laws.kinematics import pitch_rate
from tetra_drake.laws.model import Model
from tetra_drake.laws.struts import least_strut_distance

SET_IN = 1e-3
"""Time (s) of the steady stretch before peaks count. The tension overshoots for less than this
where signals set in, at the end of the start-up."""


class Effort(NamedTuple):
    """Effort of the actuators in the steady stretch: the part of the walk from
    `simulation.steady_from` to the end. Integrals are summed over the actuators. Peaks are of each
    driven cable, without the first SET_IN."""

    left: Annotated[Table, "cables"]
    """Length of each driven cable that is not wound, at the latest step, in m."""
    peak_force: Annotated[Table, "cables"]
    """Largest force that the actuator bore, in N; see actuator.Exertion.load."""
    peak_speed: Annotated[Table, "cables"]
    """Largest speed of the actuator in either direction, in m/s."""
    peak_power: Annotated[Table, "cables"]
    """Largest power of the actuator, in W."""
    impulse: Annotated[Table, 1]
    """Integral of the actuators' load, in N s; see actuator.Exertion.load."""
    wound: Annotated[Table, 1]
    """Length of cable wound and paid out, in m."""
    pulled: Annotated[Table, 1]
    """Integral of the load times the winding speed, while it is positive, in J."""
    work: Annotated[Table, 1]
    """Work of actuators that cannot recover energy, in J: the integral of the positive power of
    actuator.Exertion.pull."""
    limited: Annotated[Table, 1]
    """Time during which a limit of an actuator binds, in s."""


class Tally(NamedTuple):
    """Sums and extremes over all steps of a simulation, from which metrics are computed. All are
    arrays, so that kernels can update them in place."""

    begins: Annotated[Table, 1]
    """Time (s) at which the steady stretch begins."""
    time: Annotated[Table, 1]
    """Time (s) at the end of the latest step."""
    signals: Annotated[Table, "signals"]
    """Signals (N) at the end of the latest step."""
    clearance: Annotated[Table, 1, math.inf]
    """Least distance between struts, in m; see update_clearance()."""
    effort: Effort
    roughness: Annotated[Table, 1]
    """Integral of (dS/dt)² of all signals S over the steady stretch, in N²/s."""
    lifted: Annotated[Table, "bodies"]
    """Time (s) of each body off the ground in the steady stretch: none of its contact nodes bears a
    normal force."""
    least_tension: Annotated[Table, 1, math.inf]
    """Least tension of all cables at any time, in N."""
    pitch_rate: Annotated[Table, 1]
    """Angular velocity (rad/s) of the structure about the y axis at the latest step; see
    kinematics.pitch_rate()."""
    rolled: Annotated[Table, 1]
    """Angle (rad) by which the structure has rolled: the integral of `pitch_rate`."""

    @classmethod
    def of(cls, robot: Model, *, signals: int, begins: float) -> Self:
        """The tally at the start of a simulation of a robot. `signals` is the number of signals.
        The steady stretch, the part of the walk that metrics judge, is from the time `begins` (s)
        to the end."""
        tally = allocate(cls, sizes_of(robot) | {"signals": signals})
        tally.begins[0] = begins
        return tally


@inlined
def observe(tally: Tally, robot: Model, time: Real, signals: Table, forces: Forces) -> None:
    """Adds a simulation step to the tally. `time` (s), `signals` (N) and `forces` are those at its
    end; it began at the time of the previous call.

    The first call, and a second one for the same time, add a step of duration 0. Sums take a step
    only if it has a duration and begins in the steady stretch, the part of the walk that metrics
    judge.
    """
    duration = time - tally.time[0]
    takes_time = duration > 0.0
    counts = takes_time & (tally.time[0] >= tally.begins[0])
    counted, settled = select(counts, duration, 0.0), time >= tally.begins[0] + SET_IN
    cable_forces, effort = forces.cable_forces, tally.effort

    per_time, work, drive = select(takes_time, 1.0 / duration, 0.0), 0.0 * duration, 0
    for i in range(effort.left.size):
        driver = robot.cables.signal[i]
        if driver == cable.PASSIVE:
            continue
        tension, length = cable_forces[i, cable.TENSION], cable_forces[i, cable.LENGTH]
        mean_signal = 0.5 * (tally.signals[driver] + signals[driver])
        own = exertion(robot.actuator, forces.drives, drive, tension, length, mean_signal)
        drive += 1
        wound = select(counts, effort.left[i] - own.left, 0.0)
        effort.left[i] = own.left
        speed = select(settled, wound * per_time, 0.0)
        load = select(counts & settled, own.load, 0.0)
        effort.peak_force[i] = maximum(effort.peak_force[i], load)
        effort.peak_speed[i] = maximum(effort.peak_speed[i], abs(speed))
        effort.peak_power[i] = maximum(effort.peak_power[i], load * speed)
        work += maximum(own.pull * wound, 0.0)
        effort.impulse[0] += counted * own.load
        effort.wound[0] += abs(wound)
        effort.pulled[0] += maximum(own.load * wound, 0.0)
        effort.limited[0] += counted * own.limited
    effort.work[0] += work

    square = 0.0 * duration
    for k in range(signals.size):
        change = signals[k] - tally.signals[k]
        square += change * change
        tally.signals[k] = signals[k]
    tally.roughness[0] += select(counts, square / duration, 0.0)

    i = 0
    for body in range(tally.lifted.size):
        load = 0.0 * counted
        while i < robot.ground.carriers.size and robot.ground.carriers[i] == body:
            load += forces.ground_forces[i, NORMAL]
            i += 1
        tally.lifted[body] += select(load == 0.0, counted, 0.0)

    for i in range(cable_forces.shape[0]):
        tension = cable_forces[i, cable.TENSION]
        tally.least_tension[0] = minimum(tally.least_tension[0], tension)

    rate = pitch_rate(forces.nodes, robot.first_node[robot.first_node.size - 1])
    turned = 0.5 * duration * (tally.pitch_rate[0] + rate)
    tally.rolled[0] += select(takes_time, turned, 0.0)
    tally.pitch_rate[0], tally.time[0] = rate, time


@inlined
def update_clearance(tally: Tally, robot: Model, state: Table, nodes: Table) -> None:
    """Lowers the tally's least distance between struts of different bodies, `tally.clearance`, if
    they are nearer in a state [q; v] (13*bodies,).

    It is too slow to be called at every step. `nodes` is the table of laws.kinematics for this
    state.
    """
    radius, first_node, least = robot.bodies.radius, robot.first_node, tally.clearance[0]
    least = least_strut_distance(robot.struts, radius, first_node, state, nodes, least)
    tally.clearance[0] = least


@dataclass(frozen=True)
class Metric:
    """Declaration of a metric: its unit, the function that computes it from a simulation, and its
    use."""

    unit: str
    """SI unit; "" for none."""
    note: str
    """Short explanation of the metric, for printed tables."""
    compute: Callable[[Any], float]
    """Function that computes the metric from a scenario.metrics.Walk, or from Poses."""
    least: bool = False
    """True if the least value of several simulations is recorded, not their mean."""
    most: bool = False
    """True if the greatest value of several simulations is recorded."""
    is_cost: bool = False
    """True if less is better. A requirement is then an upper limit."""
    is_share: bool = False
    """True for a share of time. It is shown in percent."""
    of_pose: bool = False
    """True if the metric can be computed from Poses alone."""
    needs: str = ""
    """Property, such as LIMITS, that a robot must have for this metric; "" for no condition."""


def metric(unit: str, note: str, compute: Callable[[Any], float], **more: Any) -> Any:
    """Declares a metric as a field of a dataclass. The arguments are the fields of Metric, `more`
    the optional ones."""
    return field(metadata={"metric": Metric(unit, note, compute, **more)})


def total(name: str) -> Callable[[Any], float]:
    """Makes a function that reads a number from the tally of a Walk (the data of one simulation for
    metrics), the greatest of several. `name` is its path in Tally, such as "effort.work"."""
    numbers = operator.attrgetter(name)
    return lambda walk: max(numbers(walk.tally), default=0.0)


def mean(name: str) -> Callable[[Any], float]:
    """Makes a function of a Walk (the data of one simulation for metrics): a sum in Effort, such as
    "impulse", divided by the duration of the steady stretch and by the number of actuators."""
    return lambda walk: walk.per_actuator_time * getattr(walk.tally.effort, name)[0]


def greatest(unit: str, note: str, compute: Callable[[Any], float], **more: Any) -> Any:
    """Declares a metric that is a cost, as a field of a dataclass. The arguments are the fields of
    Metric; see metric(). Of several simulations its greatest value is recorded."""
    return metric(unit, note, compute, most=True, is_cost=True, **more)


@dataclass(frozen=True)
class TalliedMetrics:
    """Metrics that are computed from the tally of all steps of a simulation."""

    rolled: float = metric("rad", "forward positive", total("rolled"))
    """Angle by which the robot has rolled forward, about the world's y axis, whole turns included:
    the integral of the angular velocity of the rigid motion that fits the nodes' velocities
    best."""
    actuator_work: float = metric("J", "of all actuators", total("effort.work"), is_cost=True)
    """Work of the actuators in the steady stretch, none recovered: the integral of max(0, -S dl/dt)
    with signals S and lengths l."""
    signal_rate: float = metric(
        "N/s",
        "how fast signals change",
        lambda walk: math.sqrt(
            walk.per_steady_time * float(walk.tally.roughness[0]) / max(walk.signals.shape[1], 1)
        ),
        is_cost=True,
    )
    """Root mean square of dS/dt over all signals S in the steady stretch."""
    lifted: float = metric(
        "",
        "time off the ground",
        lambda walk: sum(walk.lifted_shares) / len(walk.lifted_shares),
        is_share=True,
    )
    """Share of the steady stretch during which no contact node of a body bears a force, mean over
    bodies. In MuJoCo it says little."""
    clearance: float = metric("m", "smallest gap of struts' axes", total("clearance"), least=True)
    """Least distance, at any time, between strut axes of two bodies. Struts overlap below their
    diameter."""
    tension: float = metric("N", "smallest of any cable", total("least_tension"), least=True)
    """Least tension of any cable at any time. Below 0 the cable would have to push."""
    peak_actuator_force: float = greatest(
        "N", "without the start; a cable can pull a winch backward", total("effort.peak_force")
    )
    """Greatest load of an actuator in the steady stretch: the tension of its cable, without the
    cable's own spring beside an actuator with limits. It exceeds `max_force` of a winch that is
    pulled backward."""
    mean_actuator_force: float = metric("N", "of all driven cables", mean("impulse"), is_cost=True)
    """Mean load of the actuators in the steady stretch."""
    peak_actuator_speed: float = greatest("m/s", "without the start", total("effort.peak_speed"))
    """Greatest speed of an actuator in the steady stretch, winding or paying out: of the free
    length for a winch, otherwise of the cable's length."""
    mean_actuator_speed: float = metric("m/s", "winding or paying out", mean("wound"), is_cost=True)
    """Mean speed of the actuators in the steady stretch."""
    peak_actuator_power: float = greatest("W", "without the start", total("effort.peak_power"))
    """Greatest product of an actuator's load and winding speed in the steady stretch."""
    mean_actuator_power: float = greatest("W", "effort of an actuator", mean("pulled"))
    """Mean positive power of an actuator in the steady stretch."""
    actuator_limited: float = greatest(
        "", "time at a limit of an actuator", mean("limited"), is_share=True, needs=LIMITS
    )
    """Share of the steady stretch during which a limit of an actuator binds, mean over
    actuators."""
