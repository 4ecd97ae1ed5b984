"""The tally of a walk: what its metrics need of every step.

A part of the tally is a NamedTuple of tables with a kernel `add`, which adds a step to them. All
engines call it for each part of `Tally`, and scenario.metrics makes metrics of the tables.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, Self

from tetra_drake.physics import actuator, cable
from tetra_drake.physics.clearance import least_strut_distance
from tetra_drake.physics.contact import NORMAL
from tetra_drake.physics.forces import Forces, sizes_of
from tetra_drake.physics.model import Model
from tetra_drake.simd.allocation import allocate
from tetra_drake.simd.compiling import inlined
from tetra_drake.simd.lanes import Real, Table, Truth, maximum, minimum, select
from tetra_drake.simd.unrolling import for_each


class Step(NamedTuple):
    """A step of a walk, with the state, signals and forces at its end. The first one takes no time;
    nor does one that is seen again."""

    robot: Model
    state: Table
    """(13 bodies,)."""
    signals: Table
    """(signals,): in N; `signals_before` are those at its start."""
    signals_before: Table
    forces: Forces
    duration: Real
    """s."""
    takes_time: Truth
    counts: Truth
    """True if it is in the steady stretch, over which sums are taken, and takes time."""
    counted: Real
    """Its duration (s) if it counts, or else 0."""


class Effort(NamedTuple):
    """The effort of the actuators; integrals are summed over all of them."""

    left: Annotated[Table, "cables"]
    """What actuators have left to wind at the latest step, in m: free lengths if they wind, or else
    lengths of the driven cables."""
    peak_force: Annotated[Table, 1]
    """N; peaks are of all steps."""
    peak_speed: Annotated[Table, 1]
    """m/s, in either direction."""
    peak_power: Annotated[Table, 1]
    """W."""
    impulse: Annotated[Table, 1]
    """The integral of the tension, in N s."""
    wound: Annotated[Table, 1]
    """m, in either direction."""
    pulled: Annotated[Table, 1]
    """The integral of the positive power of the tension, in J."""
    work: Annotated[Table, 1]
    """The integral of max(0, -S dl/dt), in J. S is the signal, or the tension if actuators have
    drives."""
    limited: Annotated[Table, 1]
    """Time at a limit, in s."""

    @inlined
    def add(self, step: Step) -> None:
        """Adds a step."""
        signal, cable_forces = step.robot.cables.signal, step.forces.cable_forces
        per_time, work = select(step.takes_time, 1.0 / step.duration, 0.0), 0.0 * step.duration
        drive = 0
        for i in range(self.left.size):
            if signal[i] == cable.PASSIVE:
                continue
            tension = cable_forces[i, cable.TENSION]
            pull, left, limited = winding(step, i, drive)
            drive += 1
            wound = select(step.takes_time, self.left[i] - left, 0.0)
            self.left[i] = left
            speed = wound * per_time
            self.peak_force[0] = maximum(self.peak_force[0], tension)
            self.peak_speed[0] = maximum(self.peak_speed[0], abs(speed))
            self.peak_power[0] = maximum(self.peak_power[0], tension * speed)
            wound = select(step.counts, wound, 0.0)
            work += maximum(pull * wound, 0.0)
            self.impulse[0] += step.counted * tension
            self.wound[0] += abs(wound)
            self.pulled[0] += maximum(tension * wound, 0.0)
            self.limited[0] += step.counted * limited
        self.work[0] += work


@inlined
def winding(step: Step, i: int, drive: int) -> tuple[Real, Real, Real]:
    """How an actuator winds cable `i`: the force (N) of its work, what it has left to wind (m), and
    1 where a limit binds, or else 0."""
    length, of_robot = step.forces.cable_forces[i, cable.LENGTH], step.robot.actuator
    if not actuator.has_drive(of_robot):
        k = step.robot.cables.signal[i]
        return 0.5 * (step.signals_before[k] + step.signals[k]), length, 0.0 * length
    drives, tension = step.forces.drives, step.forces.cable_forces[i, cable.TENSION]
    left = actuator.wound(of_robot, drives[drive, actuator.DRIVE], length)
    return tension, left, drives[drive, actuator.LIMITED]


class Roughness(NamedTuple):
    """How fast signals change."""

    total: Annotated[Table, 1]
    """The integral of (dS/dt)² of all signals, in N²/s."""

    @inlined
    def add(self, step: Step) -> None:
        """Adds a step."""
        square = 0.0 * step.duration
        for k in range(step.signals.size):
            change = step.signals[k] - step.signals_before[k]
            square += change * change
        self.total[0] += select(step.counts, square / step.duration, 0.0)


class Lifted(NamedTuple):
    """How long bodies are off the ground."""

    time: Annotated[Table, "bodies"]
    """The time in which no contact node of a body bears a normal force, in s."""

    @inlined
    def add(self, step: Step) -> None:
        """Adds a step."""
        carriers, i = step.robot.ground.carriers, 0
        for body in range(self.time.size):
            load = 0.0 * step.counted
            while i < carriers.size and carriers[i] == body:
                load += step.forces.ground_forces[i, NORMAL]
                i += 1
            self.time[body] += select(load == 0.0, step.counted, 0.0)


class LeastTension(NamedTuple):
    """The least tension of all steps."""

    of_all: Annotated[Table, 1, math.inf]
    """Of all cables, in N."""

    @inlined
    def add(self, step: Step) -> None:
        """Adds a step."""
        least = self.of_all[0]
        for i in range(step.forces.cable_forces.shape[0]):
            least = minimum(least, step.forces.cable_forces[i, cable.TENSION])
        self.of_all[0] = least


class Tally(NamedTuple):
    """What is tallied of a walk, part by part."""

    begins: Annotated[Table, 1]
    """Time (s) at which the steady stretch begins."""
    time: Annotated[Table, 1]
    """Time (s) at the end of the latest step."""
    signals: Annotated[Table, "signals"]
    """Signals (N) then."""
    clearance: Annotated[Table, 1, math.inf]
    """The least distance between struts, in m; see look()."""
    effort: Effort
    roughness: Roughness
    lifted: Lifted
    tension: LeastTension

    @classmethod
    def of(cls, robot: Model, *, signals: int, begins: float) -> Self:
        """The tally of a walk at its start, whose steady stretch `begins` at a time (s)."""
        tally = allocate(cls, sizes_of(robot) | {"signals": signals})
        tally.begins[0] = begins
        return tally


add_to_each = for_each("add")


@inlined
def observe(
    tally: Tally, robot: Model, time: Real, state: Table, signals: Table, forces: Forces
) -> None:
    """Adds the step that ends at a time (s) with this state, these signals and forces."""
    duration = time - tally.time[0]
    takes_time = duration > 0.0
    counts = takes_time & (tally.time[0] >= tally.begins[0])
    step = Step(
        robot=robot,
        state=state,
        signals=signals,
        signals_before=tally.signals,
        forces=forces,
        duration=duration,
        takes_time=takes_time,
        counts=counts,
        counted=select(counts, duration, 0.0),
    )
    add_to_each(tally, step)
    for k in range(signals.size):
        tally.signals[k] = signals[k]
    tally.time[0] = time


@inlined
def look(tally: Tally, robot: Model, state: Table, nodes: Table) -> None:
    """Notes the clearance of struts at a state (13 bodies,), which costs too much for every step;
    `nodes` are those of kinematics."""
    radius, first_node, least = robot.bodies.radius, robot.first_node, tally.clearance[0]
    least = least_strut_distance(robot.struts, radius, first_node, state, nodes, least)
    tally.clearance[0] = least
