"""The tally of a walk: sums and least values that its metrics need of every step."""

from __future__ import annotations

from typing import NamedTuple

from tetra_drake.physics.actuator import DRIVE, LIMITED, has_drive, wound
from tetra_drake.physics.cable import LENGTH, PASSIVE, TENSION
from tetra_drake.physics.clearance import least_strut_distance
from tetra_drake.physics.contact import NORMAL
from tetra_drake.physics.forces import Forces
from tetra_drake.physics.model import Model
from tetra_drake.simd.compiling import inlined
from tetra_drake.simd.lanes import Real, Table, maximum, minimum, select

FORCE, SPEED, POWER, LIMITED_TIME = range(4)
"""Places in the tally's `peaks` and `sums` of actuators."""


class Tally(NamedTuple):
    """Sums over the steps that begin at `begins` or later; least values and peaks of all steps."""

    begins: Table
    """(1,): time in s."""
    time: Table
    """(1,): time of the latest observation, in s."""
    signals: Table
    """(signals,): signals at the latest observation, in N."""
    lengths: Table
    """(cables,): what actuators have left to wind at the latest observation, in m: free lengths if
    they wind, or else lengths of the driven cables."""
    work: Table
    """(1,): the integral of max(0, -S dl/dt) of the driven cables, in J. S is the signal, or the
    tension if actuators have drives."""
    peaks: Table
    """(3,): greatest tension (N), speed of either sign (m/s) and power (W) of an actuator."""
    sums: Table
    """(4,): integrals, summed over all actuators, of tension, of winding speed of either sign and
    of positive power; and the time at a limit."""
    roughness: Table
    """(1,): the integral of (dS/dt)² of all signals, in N²/s."""
    lifted: Table
    """(bodies,): the time in which no contact node of a body bears a normal force, in s."""
    tension: Table
    """(1,): the least tension of a cable, in N."""
    clearance: Table
    """(1,): the least distance between struts, in m; see physics.clearance."""


@inlined
def observe(tally: Tally, robot: Model, time: Real, signals: Table, forces: Forces) -> None:
    """Adds the step that ends at a time (s) with these signals and forces. A second observation of
    the same time adds nothing."""
    cables, drives, cable_forces = robot.cables, forces.drives, forces.cable_forces
    passed = time - tally.time[0]
    moves = passed > 0.0
    counts, per_time = moves & (tally.time[0] >= tally.begins[0]), select(moves, 1.0 / passed, 0.0)
    counted = select(counts, passed, 0.0)
    work, roughness, tension = 0.0 * passed, 0.0 * passed, tally.tension[0]
    drive = 0
    for i in range(tally.lengths.size):
        driver = cables.signal[i]
        if driver != PASSIVE:
            force, left = 0.5 * (tally.signals[driver] + signals[driver]), cable_forces[i, LENGTH]
            if has_drive(robot.actuator):
                force = cable_forces[i, TENSION]
                left = wound(robot.actuator, drives[drive, DRIVE], left)
                tally.sums[LIMITED_TIME] += counted * drives[drive, LIMITED]
                drive += 1
            way = select(moves, tally.lengths[i] - left, 0.0)
            tally.lengths[i] = left
            note_peaks(tally.peaks, cable_forces[i, TENSION], way * per_time)
            way = select(counts, way, 0.0)
            work += maximum(force * way, 0.0)
            add_actuator(tally.sums, cable_forces[i, TENSION], way, counted)
        tension = minimum(tension, cable_forces[i, TENSION])
    tally.tension[0] = tension
    for k in range(tally.signals.size):
        change = signals[k] - tally.signals[k]
        roughness += change * change
        tally.signals[k] = signals[k]
    tally.work[0] += work
    tally.roughness[0] += select(counts, roughness / passed, 0.0)
    add_lifted(tally, robot.ground.carriers, counted, forces.ground_forces)
    tally.time[0] = time


@inlined
def note_peaks(peaks: Table, tension: Real, speed: Real) -> None:
    """Notes the tension (N) and the winding speed (m/s) of an actuator where they are peaks; the
    speed counts in either direction."""
    peaks[FORCE] = maximum(peaks[FORCE], tension)
    peaks[SPEED] = maximum(peaks[SPEED], abs(speed))
    peaks[POWER] = maximum(peaks[POWER], tension * speed)


@inlined
def add_actuator(sums: Table, tension: Real, wound: Real, passed: Real) -> None:
    """Adds an actuator that has `wound` some of its cable (m) under a tension (N) in the time that
    has passed (s); all but the tension is 0 where a step does not count."""
    sums[FORCE] += passed * tension
    sums[SPEED] += abs(wound)
    sums[POWER] += maximum(tension * wound, 0.0)


@inlined
def add_lifted(tally: Tally, carriers: Table, passed: Real, ground_forces: Table) -> None:
    """Adds the time (s) that has passed to each lifted body; `carriers` are a Ground's."""
    i = 0
    for body in range(tally.lifted.size):
        load = 0.0 * passed
        while i < carriers.size and carriers[i] == body:
            load += ground_forces[i, NORMAL]
            i += 1
        tally.lifted[body] += select(load == 0.0, passed, 0.0)


@inlined
def look(tally: Tally, robot: Model, state: Table, nodes: Table) -> None:
    """Notes the clearance of struts at a state (13 bodies,); `nodes` are those of kinematics."""
    radius, first_node, least = robot.bodies.radius, robot.first_node, tally.clearance[0]
    least = least_strut_distance(robot.struts, radius, first_node, state, nodes, least)
    tally.clearance[0] = least
