"""The simulation loop: several simulations in lanes, each with its own time, step and modes.

All lanes go through the same iteration: forces, prediction of the next mode change, signals, one
step. A lane whose step is rejected repeats it with a shorter one in the next iteration.

The listing's network does not depend on the robot: it runs ahead in steps of its own, and its
signals are interpolated. (A table of them made beforehand, one lane at a time, costs a tenth of the
speed of one lane, and more in several.) A `live` network takes the robot's steps by Heun's method,
which is explicit, as its rates are slow, and what ROS2 is without its matrix: both are of order 2
together.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from tetra_drake.engines.compiled.block_tridiagonal import BLOCK
from tetra_drake.engines.compiled.dynamics import Forces, compute_forces, move_robot
from tetra_drake.engines.compiled.rosenbrock import Step, larger, take_step
from tetra_drake.physics.cable import LENGTH
from tetra_drake.physics.contact import MODE_COLUMNS, update_modes
from tetra_drake.physics.feedback import Senses, sense
from tetra_drake.physics.kinematics import interpolate_state
from tetra_drake.physics.mode_change import time_to_mode_change
from tetra_drake.physics.model import Model
from tetra_drake.physics.oscillator import (
    Network,
    correct_neurons,
    euler_step,
    oscillator_output,
    predict_neurons,
    steered_input,
)
from tetra_drake.physics.tally import Tally, look, observe
from tetra_drake.simd.compiling import compiled, inlined, merged
from tetra_drake.simd.lanes import Real, Table, any_lane, by_lane, maximum, minimum, select

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

ROUND = 32
"""Iterations, some 40 ms of a walk, after which the distances of struts are looked at: enough to
find the least one to within 0.1 mm."""

STATUS, TIME, STEP, END, MARK, DUE, ACTIVE, SAMPLES, FLAG, TRIED, TAKEN, CLOCK_ROWS = range(12)
"""Rows of `clock`, (CLOCK_ROWS,): status, time, length of the step tried and its end, times of the
next mark and of the next sample to keep (s), whether signals act (0 or 1), number of samples of the
signals that exist, a number for what comes next, steps tried, steps taken; and their number."""


class LaneTables(NamedTuple):
    """All that kernels need of several simulations, in lanes; constants are tables of one.

    In SI units. The signals act from `start_up` on.
    """

    robot: Model
    tolerance: Table
    max_step: Table
    look_ahead: Table
    max_speed: Table
    max_evaluations: Table
    network: Network
    external_input: Table
    sides: Table
    """(2n,): by neuron, see Actuation; n oscillators."""
    tonic: Table
    """(2n,): the input without feedback; `inputs` with it."""
    inputs: Table
    senses: Senses
    gains: Table
    """(3,): of feedback."""
    lengths: Table
    """(cables,): what is sensed, as are `normal_forces`, (contacts,)."""
    normal_forces: Table
    gain: Table
    """Force per unit of an oscillator's output."""
    period: Table
    """From one sample of the listing's signals, or of the turns, to the next."""
    samples: Table
    """Number of samples of the listing's signals; the last one lasts."""
    start_up: Table
    neurons: Table
    """(2n, NEURON_COLUMNS)."""
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
    """(n,), at the lane's time; `end_signals` at the end of its step."""
    end_signals: Table
    tally: Tally


class Log(NamedTuple):
    """The course of each simulation, a row a lane."""

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
    """(W, RECENT, n): the latest samples of the listing's signals; see row_of."""
    turns: Table
    """(W, turns): at 0, one `period` ..., linear between them; the last one lasts. One alone is in
    `tonic` already."""


@functools.partial(compiled, nogil=True)
def advance(w: LaneTables, log: Log, live: bool, rounds: int) -> None:
    """Simulates to the end of the round in which one of the lanes ends, or for a number of rounds:
    so each simulation's begin with its own, and lanes may be filled again in between.

    `live`: whether the network is integrated with the robot.
    """
    for _ in range(rounds):
        ended = False
        for _ in range(ROUND):
            ended |= iterate(w, log, live)
        move_robot(w.robot, w.step.state, w.forces)
        look(w.tally, w.forces.nodes)
        if ended:
            return


@merged
def iterate(w: LaneTables, log: Log, live: bool) -> bool:
    """Tries a step in all lanes; whether a simulation has ended."""
    clock, robot, forces = w.clock, w.robot, w.forces
    state, end, ended = w.step.state, w.step.end, False
    if any_lane((clock[STATUS] == WALKING) & (clock[TIME] >= clock[MARK])):
        if not live:
            run_ahead(w, log, clock[TIME])
        ended = pass_marks(w, log, live)
    walks = clock[STATUS] == WALKING
    move_robot(robot, state, forces)
    update_modes(state, forces.nodes, robot.ground, forces.frames, w.modes)
    compute_forces(robot, w.modes, w.signals, True, forces, w.step.force)
    observe(
        w.tally,
        robot.cables,
        robot.ground.contacts,
        clock[TIME],
        w.signals,
        forces.pulls,
        forces.pushes,
    )
    step = select(walks, aim(w), 0.0)
    step_end = select(step == clock[MARK] - clock[TIME], clock[MARK], clock[TIME] + step)
    clock[STEP], clock[END] = step, step_end
    if live:
        feel(w, log, clock[TIME], state)
        predict_neurons(w.network, w.inputs, step, w.neurons)
        drive(w)
    else:
        run_ahead(w, log, step_end)
        for lane in range(log.kept.size):
            interpolate(w, log, lane, by_lane(clock)[END, lane], by_lane(w.end_signals))
    error = take_step(robot, w.step, w.modes, forces, w.end_signals, step, live)

    accepted = walks & (error <= w.tolerance[0])
    if live:
        feel(w, log, step_end, end)
        correct_neurons(w.network, w.inputs, step, accepted, w.neurons)
        drive(w)
    if any_lane(accepted & (clock[DUE] <= step_end)):
        clock[FLAG] = select(accepted, 1.0, 0.0)
        keep_samples(w, log, live)
    for i in range(state.size):
        state[i] = select(accepted, end[i], state[i])
    for k in range(w.signals.size):
        w.signals[k] = select(accepted, w.end_signals[k], w.signals[k])
    clock[TIME] = select(accepted, step_end, clock[TIME])
    clock[TRIED] += select(walks, 1.0, 0.0)
    clock[TAKEN] += select(accepted, 1.0, 0.0)
    clock[STEP] = next_step(error, step, w.tolerance[0], w.max_step[0])
    status = select(walks, fate(w), clock[STATUS])
    ended |= any_lane(status != clock[STATUS])
    clock[STATUS] = status
    return ended


@merged
def aim(w: LaneTables) -> Real:
    """The step (s) to try: at most the planned one, to just after the next mode change if that is
    nearer, and to the next mark or half the way to it if that is near."""
    robot, planned = w.robot, w.clock[STEP]
    per_moment, per_mass = 1.0 / robot.body.moment[0], 1.0 / robot.body.mass[0]
    for body in range(w.acceleration.size // BLOCK):
        for j in range(BLOCK):
            i = BLOCK * body + j
            w.acceleration[i] = w.step.force[i] * (per_moment if j < 3 else per_mass)
    change = time_to_mode_change(
        w.step.state,
        w.acceleration,
        w.forces.nodes,
        w.modes,
        robot.ground,
        w.forces.frames,
        planned,
    )
    step = minimum(planned, AIM_FACTOR * change + w.look_ahead[0])
    remaining = w.clock[MARK] - w.clock[TIME]
    halved = select(2.0 * step > remaining, 0.5 * remaining, step)
    return select(step > remaining - LEAST_STEP, remaining, halved)


@inlined
def next_step(error: Real, step: Real, tolerance: Real, max_step: Real) -> Real:
    """The step (s) that a method of order 2 should take after one with this error."""
    factor = SAFETY * math.sqrt(tolerance / maximum(error, 1e-12))
    factor = minimum(GROW, maximum(SHRINK, factor))
    factor = select(error == error, factor, SHRINK)  # NaN
    return minimum(max_step, step * factor)


@inlined
def fate(w: LaneTables) -> Real:
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


@inlined
def run_ahead(w: LaneTables, log: Log, until: Real) -> None:
    """Lets the listing's networks run until every walking lane has the samples around a time (s).

    Others go along as far as there is room, so that few steps are taken for one lane alone.
    """
    clock, period, floats = w.clock, w.period[0], by_lane(w.clock)
    needed, room = until / period + 1.0, clock[TIME] / period + (log.recent.shape[1] - 1.0)
    grows = clock[STATUS] == WALKING
    while any_lane(grows & (clock[SAMPLES] < w.samples[0]) & (clock[SAMPLES] <= needed)):
        goes = grows & (clock[SAMPLES] < w.samples[0]) & (clock[SAMPLES] < room)
        step = select(goes, period, 0.0)
        steer(w, log, clock[SAMPLES] + 0.5)
        euler_step(w.network, w.tonic, step, w.neurons)
        oscillator_output(w.neurons, w.output)
        clock[FLAG] = select(goes, 1.0, 0.0)
        for lane in range(log.kept.size):
            if floats[FLAG, lane] != 0.0:
                row = row_of(int(floats[SAMPLES, lane]), log)
                for k in range(w.output.size):
                    signal = by_lane(w.gain)[0, lane] * by_lane(w.output)[k, lane]
                    log.recent[lane, row, k] = signal
        clock[SAMPLES] += clock[FLAG]


@inlined
def feel(w: LaneTables, log: Log, time: Real, state: Table) -> None:
    """Writes the inputs of a live network at a time (s), for a state and its forces."""
    steer(w, log, time / w.period[0])
    for i in range(w.lengths.size):
        w.lengths[i] = w.forces.pulls[i, LENGTH]
    for i in range(w.normal_forces.size):
        w.normal_forces[i] = w.forces.pushes[i, 2]
    sense(w.senses, w.gains, state, w.lengths, w.normal_forces, w.inputs)
    for i in range(w.inputs.size):
        w.inputs[i] += w.tonic[i]


@inlined
def steer(w: LaneTables, log: Log, sample: Real) -> None:
    """Writes the tonic input where the turns change; `sample` is a place between two of them."""
    turns, floats = log.turns.shape[1], by_lane(w.clock)
    if turns == 1:
        return
    w.clock[FLAG] = sample
    for lane in range(log.kept.size):
        i = max(0, min(int(floats[FLAG, lane]), turns - 2))
        before, after = log.turns[lane, i], log.turns[lane, i + 1]
        turn = before + (min(floats[FLAG, lane], turns - 1.0) - i) * (after - before)
        for k in range(w.tonic.size):
            external, side = by_lane(w.external_input)[0, lane], by_lane(w.sides)[k, lane]
            by_lane(w.tonic)[k, lane] = steered_input(external, turn, side)


@inlined
def drive(w: LaneTables) -> None:
    """Writes the signals at the end of the step, N, from a live network."""
    oscillator_output(w.neurons, w.output)
    for k in range(w.output.size):
        w.end_signals[k] = select(w.clock[ACTIVE] != 0.0, w.gain[0] * w.output[k], 0.0)


@inlined
def interpolate(w: LaneTables, log: Log, lane: int, time: float, signals: Table) -> None:
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


@inlined
def row_of(sample: int, log: Log) -> int:
    """Where a sample is among the recent ones: its number modulo theirs, a power of two."""
    return sample & (log.recent.shape[1] - 1)


@merged
def pass_marks(w: LaneTables, log: Log, live: bool) -> bool:
    """Sets the next mark where one is reached, and the signals there; whether a simulation
    is done."""
    clock, signals, done = by_lane(w.clock), by_lane(w.signals), False
    oscillator_output(w.neurons, w.output)
    for lane in range(log.kept.size):
        if clock[STATUS, lane] != WALKING or clock[TIME, lane] < clock[MARK, lane]:
            continue
        log.passed[lane] += 1
        clock[MARK, lane] = log.marks[lane, log.passed[lane]]
        if clock[MARK, lane] == math.inf:
            clock[STATUS, lane] = DONE
            done = True
        clock[ACTIVE, lane] = 1.0 if clock[TIME, lane] >= by_lane(w.start_up)[0, lane] else 0.0
        if not live:
            interpolate(w, log, lane, clock[TIME, lane], signals)
            continue
        for k in range(w.output.size):
            force = by_lane(w.gain)[0, lane] * by_lane(w.output)[k, lane]
            signals[k, lane] = clock[ACTIVE, lane] * force
    return done


@merged
def keep_samples(w: LaneTables, log: Log, live: bool) -> None:
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
            if not live:
                interpolate(w, log, lane, due, signals)
            for k in range(signals.shape[0]):
                first, last = by_lane(w.signals)[k, lane], by_lane(w.end_signals)[k, lane]
                between = first + part * (last - first)
                log.signals[lane, i, k] = between if live else signals[k, lane]
            log.kept[lane] = i + 1
            clock[DUE, lane] = log.times[lane, i + 1]


@inlined
def column(table: Table, lane: int) -> Array:
    """A copy of a lane of a table (..., W)."""
    copy = np.empty(table.shape[0])
    for k in range(copy.size):
        copy[k] = table[k, lane]
    return copy
