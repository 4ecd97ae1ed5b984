"""The simulation loop: error control, mode changes at step ends, and samples."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from tetra_drake.engines.compiled.dynamics import (
    compute_forces,
    divide_by_mass,
    make_forces,
)
from tetra_drake.engines.compiled.rosenbrock import make_stages, take_step
from tetra_drake.physics.compiling import compiled
from tetra_drake.physics.contact import time_to_mode_change, update_modes
from tetra_drake.physics.kinematics import P_WN, interpolate_state, move_nodes
from tetra_drake.robot.model import Model

Array = np.ndarray

DONE, TOO_FAST, STEP_TOO_SMALL, TOO_MANY_EVALUATIONS = range(4)
"""How a simulation ends."""

EVALUATIONS_A_STEP = 3
LEAST_STEP = 1e-9  # s
SAFETY, SHRINK, GROW = 0.85, 0.2, 3.0
"""The next step is the one whose error would be the tolerance, times SAFETY, within factors."""

AIM_FACTOR = 1.02
"""A step shall end just after the mode change it aims at, by the error of its prediction and
the settings' `look_ahead`."""


class Settings(NamedTuple):
    """How finely to simulate and when to give up; SI units."""

    tolerance: float
    max_step: float
    look_ahead: float
    max_speed: float
    max_evaluations: int


class Actuation(NamedTuple):
    """The signals, piecewise linear, and 0 before `start_up`."""

    samples: Array
    """(samples, signals) in N, at 0, step, 2 step ..."""
    step: float
    start_up: float


class Samples(NamedTuple):
    """A recording; with no rows, nothing is recorded."""

    times: Array
    """(samples,), ascending, from 0 to the end: when to take samples."""
    states: Array
    """(samples, 13 bodies)."""
    modes: Array
    """(samples, contacts, MODE_COLUMNS): those of the step."""
    signals: Array
    """(samples, signals) in N."""


@compiled
def signals_at(actuation: Actuation, time: float, active: bool, signals: Array) -> None:
    """The signals (signals,) at a time (s); zeros unless `active`."""
    if not active:
        signals[:] = 0.0
        return
    place = time / actuation.step
    i = min(int(place), actuation.samples.shape[0] - 2)
    part = place - i
    for k in range(signals.size):
        before, after = actuation.samples[i, k], actuation.samples[i + 1, k]
        signals[k] = before + part * (after - before)


@compiled
def next_step(error: float, step: float, settings: Settings) -> float:
    """The step (s) that a method of order 2 should take after one with this error."""
    factor = SAFETY * math.sqrt(settings.tolerance / max(error, 1e-12))
    return min(settings.max_step, step * min(GROW, max(SHRINK, factor)))


@compiled
def keep(
    samples: Samples,
    kept: int,
    before: Array,
    after: Array,
    modes: Array,
    actuation: Actuation,
    active: bool,
    time: float,
    step: float,
) -> int:
    """Writes the samples due in the step (s) that ends at `time` (s); how many are written now."""
    while kept < samples.times.size and samples.times[kept] <= time:
        due = samples.times[kept]
        part = 1.0 if due == time else (due - (time - step)) / step
        interpolate_state(before, after, step, part, samples.states[kept])
        samples.modes[kept] = modes
        signals_at(actuation, due, active, samples.signals[kept])
        kept += 1
    return kept


@functools.partial(compiled, nogil=True)
def walk(
    robot: Model,
    settings: Settings,
    actuation: Actuation,
    marks: Array,
    state: Array,
    modes: Array,
    positions: Array,
    samples: Samples,
) -> tuple[int, float, int, int]:
    """Simulates the robot from time 0 to the last mark.

    Args:
        marks: (marks,), times in s, ascending, at which steps end, the start-up among them.
        state: (13 bodies,), the start; left at the end.
        modes: (contacts, MODE_COLUMNS), zeros; left at the end.
        positions: (marks, nodes, 3), written: p_WN at the marks.
        samples: written at its times.

    Returns:
        How it ended, when (s), steps taken, force evaluations.
    """
    bodies = state.size // 13
    first = 7 * bodies
    stages = make_stages(robot, bodies)
    forces = make_forces(robot, bodies)
    acceleration = np.empty(6 * bodies)
    signals = np.zeros(actuation.samples.shape[1])
    time, step = 0.0, settings.look_ahead
    steps = evaluations = kept = 0

    move_nodes(state, robot.p_BN, forces.motion)
    update_modes(forces.motion, robot.contacts, robot.ground, modes)
    kept = keep(samples, 0, state, state, modes, actuation, False, 0.0, 0.0)
    for mark in range(marks.size):
        active = time >= actuation.start_up
        while time < marks[mark]:
            signals_at(actuation, time, active, signals)
            compute_forces(robot, state, modes, signals, forces)
            divide_by_mass(robot, forces.generalized_force, acceleration)
            change = time_to_mode_change(
                state,
                acceleration,
                forces.motion,
                modes,
                robot.contacts,
                robot.ground,
                settings.max_step,
            )
            step = min(step, AIM_FACTOR * change + settings.look_ahead)
            evaluations += 1
            error = math.inf
            while not error <= settings.tolerance:
                remaining = marks[mark] - time
                if step > remaining - LEAST_STEP:
                    step = remaining
                elif 2.0 * step > remaining:
                    step = 0.5 * remaining
                signals_at(actuation, time + step, active, signals)
                error = take_step(robot, state, modes, forces, signals, step, stages)
                evaluations += 2
                if evaluations > settings.max_evaluations:
                    return TOO_MANY_EVALUATIONS, time, steps, evaluations
                taken, step = step, next_step(error, step, settings)
                if not step > LEAST_STEP:
                    return STEP_TOO_SMALL, time, steps, evaluations
            steps += 1
            time = marks[mark] if taken == remaining else time + taken
            kept = keep(samples, kept, state, stages.state, modes, actuation, active, time, taken)
            state[:] = stages.state
            for i in range(bodies):
                for k in range(first + 6 * i + 3, first + 6 * i + 6):
                    if not abs(state[k]) <= settings.max_speed:
                        return TOO_FAST, time, steps, evaluations
            move_nodes(state, robot.p_BN, forces.motion)
            update_modes(forces.motion, robot.contacts, robot.ground, modes)
        positions[mark] = forces.motion[:, P_WN : P_WN + 3]
    return DONE, time, steps, evaluations
