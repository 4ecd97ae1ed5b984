"""The tally of a walk: sums and least values that its metrics need of every step."""

from __future__ import annotations

from typing import NamedTuple

from tetra_drake.physics.actuator import DIRECT, DRIVE, LIMITED, WINCH
from tetra_drake.physics.cable import LENGTH, PASSIVE, TENSION, Cables
from tetra_drake.physics.clearance import least_strut_distance
from tetra_drake.physics.contact import NORMAL
from tetra_drake.physics.model import Model
from tetra_drake.simd.compiling import inlined
from tetra_drake.simd.lanes import Real, Table, Truth, maximum, minimum, select

PEAK_FORCE, FORCE, PEAK_SPEED, SPEED, PEAK_POWER, POWER, LIMITED_TIME, EFFORT_COLUMNS = range(8)
"""Places in `effort`: the greatest tension (N), winding speed (m/s) and power (W) of an actuator;
the integrals of tension, winding speed of either sign and positive power, and the time at a limit,
sums over all actuators; and their number."""


class Tally(NamedTuple):
    """Sums over the steps that begin at `begins` or later, and least values of all steps."""

    begins: Table
    """(1,): time in s."""
    time: Table
    """(1,): time of the latest observation, in s."""
    signals: Table
    """(signals,): signals at the latest observation, in N."""
    lengths: Table
    """(cables,): what actuators have left to wind at the latest observation, in m: free lengths of
    cables with winches, lengths of other driven cables."""
    work: Table
    """(1,): the integral of max(0, -S dl/dt) of the driven cables, in J. With winches and tension
    motors, S is the tension."""
    effort: Table
    """(EFFORT_COLUMNS,): what the actuators do."""
    roughness: Table
    """(1,): the integral of (dS/dt)² of all signals, in N²/s."""
    lifted: Table
    """(bodies,): the time in which no contact node of a body bears a normal force, in s."""
    tension: Table
    """(1,): the least tension of a cable, in N."""
    clearance: Table
    """(1,): the least distance between struts, in m; see physics.clearance."""


class Effort(NamedTuple):
    """What actuators do in a step: the most of one, and sums over all."""

    most_force: Real
    """N."""
    most_wound: Real
    """Length wound, m."""
    most_work: Real
    """J."""
    force: Real
    way: Real
    """Length wound or paid out, m."""
    work: Real
    """Positive work, J."""
    limited: Real
    """How many are at a limit."""


@inlined
def observe(
    tally: Tally,
    cables: Cables,
    carriers: Table,
    kind: int,
    time: Real,
    signals: Table,
    drives: Table,
    pulls: Table,
    pushes: Table,
) -> None:
    """Adds the step that ends at a time (s), with the `drives` of actuators of a kind, the `pulls`
    of cables and the `pushes` of the ground there. A second observation of the same time adds
    nothing."""
    passed = time - tally.time[0]
    counts = (passed > 0.0) & (tally.time[0] >= tally.begins[0])
    zero = 0.0 * passed
    work, roughness, tension = zero, zero, tally.tension[0]
    effort = Effort(zero, zero, zero, zero, zero, zero, zero)
    drive = 0
    for i in range(tally.lengths.size):
        driver = cables.signal[i]
        if driver != PASSIVE:
            force, left = 0.5 * (tally.signals[driver] + signals[driver]), pulls[i, LENGTH]
            limited = zero
            if kind != DIRECT:
                force, limited = pulls[i, TENSION], drives[drive, LIMITED]
                left = drives[drive, DRIVE] if kind == WINCH else left
                drive += 1
            wound = tally.lengths[i] - left
            work += maximum(force * wound, 0.0)
            tally.lengths[i] = left
            effort = with_actuator(effort, pulls[i, TENSION], wound, limited)
        tension = minimum(tension, pulls[i, TENSION])
    tally.tension[0] = tension
    for k in range(tally.signals.size):
        change = signals[k] - tally.signals[k]
        roughness += change * change
        tally.signals[k] = signals[k]
    tally.work[0] += select(counts, work, 0.0)
    tally.roughness[0] += select(counts, roughness / passed, 0.0)
    add_effort(tally.effort, effort, counts, passed)
    add_lifted(tally, carriers, select(counts, passed, 0.0), pushes)
    tally.time[0] = time


@inlined
def with_actuator(effort: Effort, tension: Real, wound: Real, limited: Real) -> Effort:
    """The effort of a step with another actuator, which has `wound` some of its cable (m) under a
    tension (N)."""
    work = tension * wound
    return Effort(
        most_force=maximum(effort.most_force, tension),
        most_wound=maximum(effort.most_wound, wound),
        most_work=maximum(effort.most_work, work),
        force=effort.force + tension,
        way=effort.way + abs(wound),
        work=effort.work + maximum(work, 0.0),
        limited=effort.limited + limited,
    )


@inlined
def add_effort(sums: Table, effort: Effort, counts: Truth, passed: Real) -> None:
    """Adds the effort of a step that has taken some time (s) if it counts."""
    per_time = 1.0 / passed
    speed, power = effort.most_wound * per_time, effort.most_work * per_time
    sums[PEAK_FORCE] = maximum(sums[PEAK_FORCE], select(counts, effort.most_force, 0.0))
    sums[PEAK_SPEED] = maximum(sums[PEAK_SPEED], select(counts, speed, 0.0))
    sums[PEAK_POWER] = maximum(sums[PEAK_POWER], select(counts, power, 0.0))
    sums[FORCE] += select(counts, passed * effort.force, 0.0)
    sums[SPEED] += select(counts, effort.way, 0.0)
    sums[POWER] += select(counts, effort.work, 0.0)
    sums[LIMITED_TIME] += select(counts, passed * effort.limited, 0.0)


@inlined
def add_lifted(tally: Tally, carriers: Table, passed: Real, pushes: Table) -> None:
    """Adds the time (s) that has passed to each lifted body; `carriers` are a Ground's."""
    i = 0
    for body in range(tally.lifted.size):
        load = 0.0 * passed
        while i < carriers.size and carriers[i] == body:
            load += pushes[i, NORMAL]
            i += 1
        tally.lifted[body] += select(load == 0.0, passed, 0.0)


@inlined
def look(tally: Tally, robot: Model, state: Table, nodes: Table) -> None:
    """Notes the clearance of struts at a state (13 bodies,); `nodes` are those of kinematics."""
    radius, first_node, least = robot.bodies.radius, robot.first_node, tally.clearance[0]
    least = least_strut_distance(robot.struts, radius, first_node, state, nodes, least)
    tally.clearance[0] = least
