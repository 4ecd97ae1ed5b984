"""The simulation loop: several walks in lanes, each with its own time, step, modes and signals.

All lanes go through the same iteration: forces, prediction of the next mode change, signals, one
step. A lane whose step is rejected repeats it with a shorter one in the next iteration.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from tetra_drake.engines.compiled.block_tridiagonal import BLOCK
from tetra_drake.engines.compiled.dynamics import Forces, compute_forces, move_robot
from tetra_drake.engines.compiled.rosenbrock import Step, larger, take_step
from tetra_drake.physics.compiling import compiled
from tetra_drake.physics.contact import MODE_COLUMNS, update_modes
from tetra_drake.physics.kinematics import interpolate_state
from tetra_drake.physics.lanes import Real, Table, any_lane, by_lane, maximum, minimum, select
from tetra_drake.physics.mode_change import time_to_mode_change
from tetra_drake.physics.oscillator import Network, next_output
from tetra_drake.robot.model import Model

Array = np.ndarray

IDLE, WALKING, DONE, TOO_FAST, STEP_TOO_SMALL, TOO_MANY_EVALUATIONS = range(6)
"""The status of a lane."""

LEAST_STEP = 1e-9  # s
SAFETY, SHRINK, GROW = 0.85, 0.2, 3.0
"""The next step is the one whose error would be the tolerance, times SAFETY, within factors."""

AIM_FACTOR = 1.02
"""A step shall end just after the mode change it aims at, by the error of its prediction and
the settings' `look_ahead`."""

EVALUATIONS = 3
"""Force evaluations of an attempted step."""

STATUS, TIME, STEP, END, MARK, DUE, ACTIVE, SAMPLES, FLAG, TRIED, TAKEN, CLOCK_ROWS = range(12)
"""Rows of `clock`, (CLOCK_ROWS,): status, time, length of the step tried and its end, times of the
next mark and of the next sample to keep (s), whether signals act (0 or 1), number of samples of the
signals that exist, a flag for what comes next, steps tried, steps taken; and their number."""


class Walks(NamedTuple):
    """All that kernels need of several walks, in lanes; constants are tables of one.

    In SI units. The signals are samples at 0, `period`, 2 `period` ..., linear between them; they
    act from `start_up` on.
    """

    robot: Model
    tolerance: Table
    max_step: Table
    look_ahead: Table
    max_speed: Table
    max_evaluations: Table
    inhibition: Table
    """(2n, 2n); this and the next four: the oscillators' constants, see physics.oscillator."""
    tau_a: Table
    tau_b: Table
    self_inhibition_weight: Table
    external_input: Table
    gain: Table
    """Force per unit of an oscillator's output."""
    period: Table
    samples: Table
    """Number of samples of the signals; the last one lasts."""
    start_up: Table
    neurons: Table
    """(2n, NEURON_COLUMNS)."""
    feedback: Table
    """(2n,), zeros."""
    output: Table
    """(n,): the oscillators' latest outputs."""
    clock: Table
    step: Step
    modes: Table
    """(contacts, MODE_COLUMNS)."""
    forces: Forces
    acceleration: Table
    """(6 bodies,)."""
    signals: Table
    """(n,), at the walk's time; `end_signals` at the end of its step."""
    end_signals: Table


class Log(NamedTuple):
    """The course of each walk, a row a lane."""

    marks: Table
    """(W, marks): times (s) at which steps end, ascending; infinite after the last."""
    passed: Table
    """(W,): how many marks there are behind."""
    times: Table
    """(W, samples): times (s) of the samples to keep, likewise."""
    kept: Table
    """(W,): how many samples there are already."""
    states: Table
    """(W, samples, 13 bodies)."""
    modes: Table
    """(W, samples, contacts, MODE_COLUMNS): those of the step."""
    signals: Table
    """(W, samples, n), in N."""
    recent: Table
    """(W, RECENT, n): the latest samples of all signals; see row_of."""


@functools.partial(compiled, nogil=True)
def advance(w: Walks, log: Log, listing: bool, iterations: int) -> None:
    """Lets the lanes walk until one of them ends, or for a number of iterations.

    `listing`: see physics.oscillator.next_output.
    """
    clock, robot, forces = w.clock, w.robot, w.forces
    state, end = w.step.state, w.step.end
    for _ in range(iterations):
        if any_lane((clock[STATUS] == WALKING) & (clock[TIME] >= clock[MARK])):
            produce_signals(w, log, listing, clock[TIME])
            if pass_marks(w, log):
                return
        walks = clock[STATUS] == WALKING
        move_robot(robot, state, forces)
        update_modes(state, forces.nodes, robot.ground, forces.frames, w.modes)
        compute_forces(robot, w.modes, w.signals, True, forces, w.step.force)
        step = select(walks, aim(w), 0.0)
        step_end = select(step == clock[MARK] - clock[TIME], clock[MARK], clock[TIME] + step)
        clock[STEP], clock[END] = step, step_end
        produce_signals(w, log, listing, step_end)
        for lane in range(log.kept.size):
            interpolate(w, log, lane, by_lane(clock)[END, lane], by_lane(w.end_signals))
        error = take_step(robot, w.step, w.modes, forces, w.end_signals, step)

        accepted = walks & (error <= w.tolerance[0])
        if any_lane(accepted & (clock[DUE] <= step_end)):
            clock[FLAG] = select(accepted, 1.0, 0.0)
            keep_samples(w, log)
        for i in range(state.size):
            state[i] = select(accepted, end[i], state[i])
        for k in range(w.signals.size):
            w.signals[k] = select(accepted, w.end_signals[k], w.signals[k])
        clock[TIME] = select(accepted, step_end, clock[TIME])
        clock[TRIED] += select(walks, 1.0, 0.0)
        clock[TAKEN] += select(accepted, 1.0, 0.0)
        clock[STEP] = next_step(error, step, w.tolerance[0], w.max_step[0])
        status = fate(w)
        if any_lane(walks & (status != WALKING)):
            clock[STATUS] = select(walks, status, clock[STATUS])
            return


@compiled
def aim(w: Walks) -> Real:
    """The step (s) to try: at most the planned one, to just after the next mode change if that is
    nearer, and to the next mark or half the way to it if that is near."""
    robot, planned = w.robot, w.clock[STEP]
    per_moment, per_mass = 1.0 / robot.body.moment[0], 1.0 / robot.body.mass[0]
    for body in range(w.acceleration.size // BLOCK):
        for j in range(BLOCK):
            i = BLOCK * body + j
            w.acceleration[i] = w.step.force[i] * (per_moment if j < 3 else per_mass)
    motion, where = (w.step.state, w.acceleration, w.forces.nodes), (robot.ground, w.forces.frames)
    change = time_to_mode_change(*motion, w.modes, *where, planned)
    step = minimum(planned, AIM_FACTOR * change + w.look_ahead[0])
    remaining = w.clock[MARK] - w.clock[TIME]
    halved = select(2.0 * step > remaining, 0.5 * remaining, step)
    return select(step > remaining - LEAST_STEP, remaining, halved)


@compiled
def next_step(error: Real, step: Real, tolerance: Real, max_step: Real) -> Real:
    """The step (s) that a method of order 2 should take after one with this error."""
    factor = SAFETY * math.sqrt(tolerance / maximum(error, 1e-12))
    factor = minimum(GROW, maximum(SHRINK, factor))
    factor = select(error == error, factor, SHRINK)  # NaN
    return minimum(max_step, step * factor)


@compiled
def fate(w: Walks) -> Real:
    """The status of each lane after a step, as if all were walking."""
    state, speed = w.step.state, 0.0
    bodies = state.size // 13
    for body in range(bodies):
        for k in range(3):
            speed = larger(speed, abs(state[7 * bodies + BLOCK * body + 3 + k]))
    too_fast = (speed > w.max_speed[0]) | (speed != speed)
    too_many = EVALUATIONS * w.clock[TRIED] > w.max_evaluations[0]
    status = select(too_fast, 1.0 * TOO_FAST, 1.0 * WALKING)
    status = select(w.clock[STEP] <= LEAST_STEP, 1.0 * STEP_TOO_SMALL, status)
    return select(too_many, 1.0 * TOO_MANY_EVALUATIONS, status)


@compiled
def produce_signals(w: Walks, log: Log, listing: bool, until: Real) -> None:
    """Lets the networks run until every walking lane has the samples around a time (s).

    Others go along as far as there is room, so that few steps are taken for one lane alone.
    """
    clock, period, floats = w.clock, w.period[0], by_lane(w.clock)
    taus, inputs = (w.tau_a[0], w.tau_b[0]), (w.self_inhibition_weight[0], w.external_input[0])
    network = Network(w.inhibition, *taus, *inputs)
    needed, room = until / period + 1.0, clock[TIME] / period + (log.recent.shape[1] - 1.0)
    grows = clock[STATUS] == WALKING
    while any_lane(grows & (clock[SAMPLES] < w.samples[0]) & (clock[SAMPLES] <= needed)):
        goes = grows & (clock[SAMPLES] < w.samples[0]) & (clock[SAMPLES] < room)
        step = select(goes, period, 0.0)
        next_output(network, w.feedback, step, listing, w.neurons, w.output)
        clock[FLAG] = select(goes, 1.0, 0.0)
        for lane in range(log.kept.size):
            if floats[FLAG, lane] != 0.0:
                row = row_of(int(floats[SAMPLES, lane]), log)
                for k in range(w.output.size):
                    signal = by_lane(w.gain)[0, lane] * by_lane(w.output)[k, lane]
                    log.recent[lane, row, k] = signal
        clock[SAMPLES] += clock[FLAG]


@compiled
def interpolate(w: Walks, log: Log, lane: int, time: float, signals: Table) -> None:
    """Writes a lane's `signals`, (n, W) in N, at a time (s)."""
    if by_lane(w.clock)[ACTIVE, lane] == 0.0:
        for k in range(signals.shape[0]):
            signals[k, lane] = 0.0
        return
    place, last = time / by_lane(w.period)[0, lane], int(by_lane(w.samples)[0, lane]) - 1
    i = int(place)
    row, next_row = row_of(min(i, last), log), row_of(min(i + 1, last), log)
    for k in range(signals.shape[0]):
        before, after = log.recent[lane, row, k], log.recent[lane, next_row, k]
        signals[k, lane] = before + (place - i) * (after - before)


@compiled
def row_of(sample: int, log: Log) -> int:
    """Where a sample is among the recent ones: its number modulo theirs, a power of two."""
    return sample & (log.recent.shape[1] - 1)


@compiled
def pass_marks(w: Walks, log: Log) -> bool:
    """Sets the next mark where one is reached, and the signals there; whether a walk is done."""
    clock, done = by_lane(w.clock), False
    for lane in range(log.kept.size):
        if clock[STATUS, lane] != WALKING or clock[TIME, lane] < clock[MARK, lane]:
            continue
        log.passed[lane] += 1
        clock[MARK, lane] = log.marks[lane, log.passed[lane]]
        if clock[MARK, lane] == math.inf:
            clock[STATUS, lane] = DONE
            done = True
        clock[ACTIVE, lane] = 1.0 if clock[TIME, lane] >= by_lane(w.start_up)[0, lane] else 0.0
        interpolate(w, log, lane, clock[TIME, lane], by_lane(w.signals))
    return done


@compiled
def keep_samples(w: Walks, log: Log) -> None:
    """Keeps the samples that are due in the accepted step of each flagged lane."""
    clock, modes, lanes = by_lane(w.clock), by_lane(w.modes), log.kept.size
    signals = np.empty((w.signals.size, lanes))
    for lane in range(lanes):
        while clock[FLAG, lane] != 0.0 and clock[DUE, lane] <= clock[END, lane]:
            i, due, step = log.kept[lane], clock[DUE, lane], clock[STEP, lane]
            part = 1.0 if due == clock[END, lane] else (due - clock[TIME, lane]) / step
            before, after = column(by_lane(w.step.state), lane), column(by_lane(w.step.end), lane)
            state = interpolate_state(before, after, step, part)
            for k in range(state.size):
                log.states[lane, i, k] = state[k]
            for k in range(modes.shape[0]):
                for c in range(MODE_COLUMNS):
                    log.modes[lane, i, k, c] = modes[k, c, lane]
            interpolate(w, log, lane, due, signals)
            for k in range(signals.shape[0]):
                log.signals[lane, i, k] = signals[k, lane]
            log.kept[lane] = i + 1
            clock[DUE, lane] = log.times[lane, i + 1]


@compiled
def column(table: Table, lane: int) -> Array:
    """A copy of a lane of a table (..., W)."""
    copy = np.empty(table.shape[0])
    for k in range(copy.size):
        copy[k] = table[k, lane]
    return copy
