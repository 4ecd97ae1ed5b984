"""The simulation loop: error control, mode changes at step ends, and samples."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from tetra_drake.engines.compiled.dynamics import compute_forces
from tetra_drake.engines.compiled.rosenbrock import take_step
from tetra_drake.physics.compiling import compiled
from tetra_drake.physics.contact import MODE_COLUMNS, time_to_mode_change, update_modes
from tetra_drake.physics.kinematics import interpolate_state, move_nodes
from tetra_drake.robot.model import Model

Array = np.ndarray

DONE, TOO_FAST, STEP_TOO_SMALL, TOO_MANY_EVALUATIONS = range(4)
"""How a simulation ends."""

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
    """A recording."""

    states: Array
    """(samples, 13 bodies)."""
    modes: Array
    """(samples, contacts, MODE_COLUMNS): those of the step."""
    signals: Array
    """(samples, signals) in N."""


@compiled
def signals_at(actuation: Actuation, time: float, active: bool) -> Array:
    """The signals (signals,) at a time (s); zeros unless `active`."""
    signals = np.zeros(actuation.samples.shape[1])
    if active:
        place = time / actuation.step
        i = min(int(place), actuation.samples.shape[0] - 2)
        for k in range(signals.size):
            before, after = actuation.samples[i, k], actuation.samples[i + 1, k]
            signals[k] = before + (place - i) * (after - before)
    return signals


@compiled
def next_step(error: float, step: float, settings: Settings) -> float:
    """The step (s) that a method of order 2 should take after one with this error."""
    factor = SAFETY * math.sqrt(settings.tolerance / max(error, 1e-12))
    return min(settings.max_step, step * min(GROW, max(SHRINK, factor)))


@functools.partial(compiled, nogil=True)
def walk(
    robot: Model, settings: Settings, actuation: Actuation, state: Array, marks: Array, times: Array
) -> tuple[int, float, int, int, Samples]:
    """Simulates the robot from `state`, (13 bodies,), at time 0 to the last mark.

    `marks`, (marks,), are the times (s) at which steps end, the start-up among them; `times`,
    (samples,), those of samples, of which the first is 0. Both ascend.

    Returns how it ended, when (s), steps taken, force evaluations, and the samples.
    """
    bodies, contacts = state.size // 13, robot.contacts.size
    samples = Samples(
        np.empty((times.size, state.size)),
        np.empty((times.size, contacts, MODE_COLUMNS)),
        np.zeros((times.size, actuation.samples.shape[1])),
    )
    modes = np.zeros((contacts, MODE_COLUMNS))
    nodes = move_nodes(state, robot.p_BN)
    update_modes(nodes, robot.contacts, robot.ground, modes)
    samples.states[0], samples.modes[0] = state, modes
    time, step, kept = 0.0, settings.look_ahead, 1
    steps = evaluations = 0
    for mark in marks:
        active = time >= actuation.start_up
        while time < mark:
            forces = compute_forces(robot, nodes, modes, signals_at(actuation, time, active))
            acceleration = forces.generalized / robot.inertia
            change = time_to_mode_change(
                state, acceleration, nodes, modes, robot.contacts, robot.ground, settings.max_step
            )
            step = min(step, AIM_FACTOR * change + settings.look_ahead)
            evaluations += 1
            error = math.inf
            while not error <= settings.tolerance:
                remaining = mark - time
                if step > remaining - LEAST_STEP:
                    step = remaining
                elif 2.0 * step > remaining:
                    step = 0.5 * remaining
                signals = signals_at(actuation, time + step, active)
                end, error = take_step(robot, state, modes, forces, signals, step)
                evaluations += 2
                if evaluations > settings.max_evaluations:
                    return TOO_MANY_EVALUATIONS, time, steps, evaluations, samples
                taken, step = step, next_step(error, step, settings)
                if not step > LEAST_STEP:
                    return STEP_TOO_SMALL, time, steps, evaluations, samples
            steps += 1
            time = mark if taken == remaining else time + taken
            while kept < times.size and times[kept] <= time:
                due = times[kept]
                part = 1.0 if due == time else (due - (time - taken)) / taken
                samples.states[kept] = interpolate_state(state, end, taken, part)
                samples.modes[kept] = modes
                samples.signals[kept] = signals_at(actuation, due, active)
                kept += 1
            state = end
            speeds = np.abs(state[7 * bodies :].reshape((bodies, 6))[:, 3:])
            if not speeds.max() <= settings.max_speed:
                return TOO_FAST, time, steps, evaluations, samples
            nodes = move_nodes(state, robot.p_BN)
            update_modes(nodes, robot.contacts, robot.ground, modes)
    return DONE, time, steps, evaluations, samples
