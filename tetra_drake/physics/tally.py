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
    work, roughness, tension = 0.0 * passed, 0.0 * passed, tally.tension[0]
    drive = 0
    for i in range(tally.lengths.size):
        driver = cables.signal[i]
        if driver != PASSIVE:
            force, left = 0.5 * (tally.signals[driver] + signals[driver]), pulls[i, LENGTH]
            limited = 0.0 * passed
            if kind != DIRECT:
                force, limited = pulls[i, TENSION], drives[drive, LIMITED]
                left = drives[drive, DRIVE] if kind == WINCH else left
                drive += 1
            wound = tally.lengths[i] - left
            work += maximum(force * wound, 0.0)
            tally.lengths[i] = left
            add_effort(tally.effort, counts, passed, pulls[i, TENSION], wound, limited)
        tension = minimum(tension, pulls[i, TENSION])
    tally.tension[0] = tension
    for k in range(tally.signals.size):
        change = signals[k] - tally.signals[k]
        roughness += change * change
        tally.signals[k] = signals[k]
    tally.work[0] += select(counts, work, 0.0)
    tally.roughness[0] += select(counts, roughness / passed, 0.0)
    add_lifted(tally, carriers, select(counts, passed, 0.0), pushes)
    tally.time[0] = time


@inlined
def add_effort(
    effort: Table, counts: Truth, passed: Real, tension: Real, wound: Real, limited: Real
) -> None:
    """Adds a step in which an actuator has `wound` some of its cable (m) under a tension (N)."""
    speed = select(counts, wound / passed, 0.0)
    power = tension * speed
    effort[PEAK_FORCE] = maximum(effort[PEAK_FORCE], select(counts, tension, 0.0))
    effort[PEAK_SPEED] = maximum(effort[PEAK_SPEED], speed)
    effort[PEAK_POWER] = maximum(effort[PEAK_POWER], power)
    duration = select(counts, passed, 0.0)
    effort[FORCE] += duration * tension
    effort[SPEED] += duration * abs(speed)
    effort[POWER] += duration * maximum(power, 0.0)
    effort[LIMITED_TIME] += duration * limited


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
