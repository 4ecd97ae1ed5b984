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

from tetra_drake.engines.compiled.block_sparse import BLOCK
from tetra_drake.engines.compiled.dynamics import Solver, accelerate
from tetra_drake.engines.compiled.rosenbrock import Step, larger, take_step
from tetra_drake.errors import MAX_SPEED
from tetra_drake.physics.actuator import DRIVE, RATE
from tetra_drake.physics.cable import LENGTH
from tetra_drake.physics.contact import MODE_COLUMNS, NORMAL, update_modes
from tetra_drake.physics.feedback import Senses, sense
from tetra_drake.physics.forces import Forces, compute_forces, move_robot
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
from tetra_drake.simd.lanes import Real, Table, Truth, any_lane, by_lane, maximum, minimum, select

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

STATUS, TIME, PLANNED, STEP, END, MARK, DUE, ACTIVE, SAMPLES, TRIED, TAKEN = range(11)
"""Rows of `clock`: status, time, length of the step planned next, length of the one tried and its
end, times of the next mark and of the next sample to keep (s), whether signals act (0 or 1), number
of samples of the signals that exist, steps tried, steps taken."""

CLOCK_ROWS = 11

ACCEPTED, GOES, PLACE = range(3)
"""Rows of `asked`: whether the step is accepted, whether the network takes a step (0 or 1), and a
place among the turns."""

ASKED_ROWS = 3


class Constants(NamedTuple):
    """Constants of several simulations, in lanes: tables of one where nothing else is said, in
    SI units."""

    robot: Model
    solver: Solver
    network: Network
    senses: Senses
    sides: Table
    """(2n,): by neuron, see Actuation; n oscillators."""
    external_input: Table
    gains: Table
    """(3,): of feedback."""
    gain: Table
    """Force per unit of an oscillator's output."""
    period: Table
    """Time (s) between samples of the listing's signals, or of the turns."""
    samples: Table
    """Number of samples of the listing's signals; the last one lasts."""
    start_up: Table
    """Time from which the signals act."""
    tolerance: Table
    max_step: Table
    look_ahead: Table
    max_evaluations: Table


class Walk(NamedTuple):
    """The state of several simulations, in lanes, and what is computed on the way."""

    clock: Table
    """(CLOCK_ROWS,)."""
    asked: Table
    """(ASKED_ROWS,): what has just been computed for all lanes, and is then read lane by lane."""
    step: Step
    forces: Forces
    modes: Table
    """(contacts, MODE_COLUMNS)."""
    acceleration: Table
    """(6 bodies,)."""
    signals: Table
    """(n,), at the lane's time; `end_signals` at the end of its step."""
    end_signals: Table
    drives: Table
    """(drives, DRIVE_COLUMNS), at the lane's time."""
    end_drives: Table
    """(drives,): free lengths or tensions at the end of the lane's step."""
    neurons: Table
    """(2n, NEURON_COLUMNS)."""
    output: Table
    """(n,): the oscillators' latest outputs."""
    tonic: Table
    """(2n,): the input without feedback; `inputs` with it."""
    inputs: Table
    lengths: Table
    """(cables,): what is sensed, as are `normal_forces`, (contacts,)."""
    normal_forces: Table
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
    drives: Table
    """(W, samples, drives)."""
    recent: Table
    """(W, RECENT, n): the latest samples of the listing's signals; see row_of."""
    turns: Table
    """(W, turns): at 0, one `period` ..., linear between them; the last one lasts. One alone is in
    `tonic` already."""


@functools.partial(compiled, nogil=True)
def advance(constants: Constants, walk: Walk, log: Log, live: bool, rounds: int) -> None:
    """Simulates to the end of the round in which one of the lanes ends, or for a number of rounds:
    so each simulation's begin with its own, and lanes may be filled again in between.

    `live`: whether the network is integrated with the robot.
    """
    for _ in range(rounds):
        ended = False
        for _ in range(ROUND):
            ended |= iterate(constants, walk, log, live)
        robot, state = constants.robot, walk.step.state
        move_robot(robot, state, walk.forces)
        look(walk.tally, robot, state, walk.forces.nodes)
        if ended:
            return


@merged
def iterate(constants: Constants, walk: Walk, log: Log, live: bool) -> bool:
    """Tries a step in all lanes; whether a simulation has ended."""
    clock, ended = walk.clock, False
    if any_lane((clock[STATUS] == WALKING) & (clock[TIME] >= clock[MARK])):
        if not live:
            run_ahead(constants, walk, log, clock[TIME])
        ended = pass_marks(constants, walk, log, live)
    walks = clock[STATUS] == WALKING

    arrive(constants, walk)
    step = select(walks, aim(constants, walk), 0.0)
    step_end = select(step == clock[MARK] - clock[TIME], clock[MARK], clock[TIME] + step)
    clock[STEP], clock[END] = step, step_end
    foresee_signals(constants, walk, log, live)
    foresee_drives(walk)
    error = take_step(
        constants.robot,
        constants.solver,
        walk.step,
        walk.modes,
        walk.forces,
        walk.end_signals,
        step,
        live,
    )
    correct_drives(walk)

    accepted = walks & (error <= constants.tolerance[0])
    if live:
        feel(constants, walk, log, step_end, walk.step.end)
        correct_neurons(constants.network, walk.inputs, step, accepted, walk.neurons)
        drive(constants, walk)
    if any_lane(accepted & (clock[DUE] <= step_end)):
        walk.asked[ACCEPTED] = select(accepted, 1.0, 0.0)
        keep_samples(constants, walk, log, live)
    move_on(walk, walks, accepted)
    clock[PLANNED] = next_step(error, step, constants.tolerance[0], constants.max_step[0])

    status = select(walks, fate(constants, walk), clock[STATUS])
    ended |= any_lane(status != clock[STATUS])
    clock[STATUS] = status
    return ended


@inlined
def arrive(constants: Constants, walk: Walk) -> None:
    """Brings the modes up to date with the state, computes its forces and tallies them."""
    robot, forces, state = constants.robot, walk.forces, walk.step.state
    move_robot(robot, state, forces)
    for i in range(walk.drives.shape[0]):
        forces.drives[i, DRIVE] = walk.drives[i, DRIVE]
    update_modes(state, forces.nodes, robot.ground, forces.frames, walk.modes)
    compute_forces(robot, state, walk.modes, walk.signals, True, forces, walk.step.force)
    observe(walk.tally, robot, walk.clock[TIME], walk.signals, forces)


@inlined
def foresee_signals(constants: Constants, walk: Walk, log: Log, live: bool) -> None:
    """Writes the signals at the end of the step: the listing's, or a prediction of a live
    network's."""
    clock = walk.clock
    if live:
        feel(constants, walk, log, clock[TIME], walk.step.state)
        predict_neurons(constants.network, walk.inputs, clock[STEP], walk.neurons)
        drive(constants, walk)
        return
    run_ahead(constants, walk, log, clock[END])
    for lane in range(log.kept.size):
        end = by_lane(clock)[END, lane]
        interpolate(constants, walk, log, lane, end, by_lane(walk.end_signals))


@inlined
def foresee_drives(walk: Walk) -> None:
    """Notes the drives and their rates at the state, and moves them to the end of the step."""
    drives = walk.forces.drives
    for i in range(drives.shape[0]):
        walk.drives[i, RATE] = drives[i, RATE]
        drives[i, DRIVE] = walk.drives[i, DRIVE] + walk.clock[STEP] * drives[i, RATE]


@inlined
def correct_drives(walk: Walk) -> None:
    """Writes the drives at the end of the step, by the mean of the rates at both ends."""
    for i in range(walk.drives.shape[0]):
        rate = 0.5 * (walk.drives[i, RATE] + walk.forces.drives[i, RATE])
        walk.end_drives[i] = walk.drives[i, DRIVE] + walk.clock[STEP] * rate


@inlined
def move_on(walk: Walk, walks: Truth, accepted: Truth) -> None:
    """Makes the end of the step the state where it is accepted."""
    clock, state = walk.clock, walk.step.state
    for i in range(state.size):
        state[i] = select(accepted, walk.step.end[i], state[i])
    for k in range(walk.signals.size):
        walk.signals[k] = select(accepted, walk.end_signals[k], walk.signals[k])
    for i in range(walk.drives.shape[0]):
        walk.drives[i, DRIVE] = select(accepted, walk.end_drives[i], walk.drives[i, DRIVE])
    clock[TIME] = select(accepted, clock[END], clock[TIME])
    clock[TRIED] += select(walks, 1.0, 0.0)
    clock[TAKEN] += select(accepted, 1.0, 0.0)


@merged
def aim(constants: Constants, walk: Walk) -> Real:
    """The step (s) to try: at most the planned one, to just after the next mode change if that is
    nearer, and to the next mark or half the way to it if that is near."""
    robot, clock = constants.robot, walk.clock
    accelerate(robot, walk.forces.inertia, walk.step.force, walk.acceleration)
    planned = clock[PLANNED]
    change = time_to_mode_change(
        robot, walk.step.state, walk.acceleration, walk.modes, walk.forces, planned
    )
    step = minimum(planned, AIM_FACTOR * change + constants.look_ahead[0])
    remaining = clock[MARK] - clock[TIME]
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
def fate(constants: Constants, walk: Walk) -> Real:
    """The status of each lane after a step, as if all were walking."""
    state, speed = walk.step.state, 0.0
    bodies = state.size // 13
    for body in range(bodies):
        for k in range(3):
            speed = larger(speed, abs(state[7 * bodies + BLOCK * body + 3 + k]))
    too_fast = (speed > MAX_SPEED) | (speed != speed)
    too_many = EVALUATIONS * walk.clock[TRIED] > constants.max_evaluations[0]
    status = select(too_fast, 1.0 * TOO_FAST, 1.0 * WALKING)
    status = select(walk.clock[PLANNED] <= LEAST_STEP, 1.0 * STEP_TOO_SMALL, status)
    return select(too_many, 1.0 * TOO_MANY_EVALUATIONS, status)


@inlined
def run_ahead(constants: Constants, walk: Walk, log: Log, until: Real) -> None:
    """Lets the listing's networks run until every walking lane has the samples around a time (s).

    Others go along as far as there is room, so that few steps are taken for one lane alone.
    """
    clock, period = walk.clock, constants.period[0]
    gain, output, asked = by_lane(constants.gain), by_lane(walk.output), by_lane(walk.asked)
    needed, room = until / period + 1.0, clock[TIME] / period + (log.recent.shape[1] - 1.0)
    grows = clock[STATUS] == WALKING
    while any_lane(grows & (clock[SAMPLES] < constants.samples[0]) & (clock[SAMPLES] <= needed)):
        goes = grows & (clock[SAMPLES] < constants.samples[0]) & (clock[SAMPLES] < room)
        step = select(goes, period, 0.0)
        steer(constants, walk, log, clock[SAMPLES] + 0.5)
        euler_step(constants.network, walk.tonic, step, walk.neurons)
        oscillator_output(walk.neurons, walk.output)
        walk.asked[GOES] = select(goes, 1.0, 0.0)
        for lane in range(log.kept.size):
            if asked[GOES, lane] != 0.0:
                row = row_of(int(by_lane(clock)[SAMPLES, lane]), log)
                for k in range(walk.output.size):
                    log.recent[lane, row, k] = gain[0, lane] * output[k, lane]
        clock[SAMPLES] += walk.asked[GOES]


@inlined
def feel(constants: Constants, walk: Walk, log: Log, time: Real, state: Table) -> None:
    """Writes the inputs of a live network at a time (s), for a state and its forces."""
    steer(constants, walk, log, time / constants.period[0])
    for i in range(walk.lengths.size):
        walk.lengths[i] = walk.forces.cable_forces[i, LENGTH]
    for i in range(walk.normal_forces.size):
        walk.normal_forces[i] = walk.forces.ground_forces[i, NORMAL]
    sense(constants.senses, constants.gains, state, walk.lengths, walk.normal_forces, walk.inputs)
    for i in range(walk.inputs.size):
        walk.inputs[i] += walk.tonic[i]


@inlined
def steer(constants: Constants, walk: Walk, log: Log, sample: Real) -> None:
    """Writes the tonic input where the turns change; `sample` is a place between two of them."""
    turns = log.turns.shape[1]
    if turns == 1:
        return
    walk.asked[PLACE] = sample
    places, sides, tonic = by_lane(walk.asked), by_lane(constants.sides), by_lane(walk.tonic)
    for lane in range(log.kept.size):
        place, external = places[PLACE, lane], by_lane(constants.external_input)[0, lane]
        i = max(0, min(int(place), turns - 2))
        before, after = log.turns[lane, i], log.turns[lane, i + 1]
        turn = before + (min(place, turns - 1.0) - i) * (after - before)
        for k in range(walk.tonic.size):
            tonic[k, lane] = steered_input(external, turn, sides[k, lane])


@inlined
def drive(constants: Constants, walk: Walk) -> None:
    """Writes the signals at the end of the step, N, from a live network."""
    oscillator_output(walk.neurons, walk.output)
    active, gain = walk.clock[ACTIVE] != 0.0, constants.gain[0]
    for k in range(walk.output.size):
        walk.end_signals[k] = select(active, gain * walk.output[k], 0.0)


@inlined
def interpolate(
    constants: Constants, walk: Walk, log: Log, lane: int, time: float, signals: Table
) -> None:
    """Writes a lane's `signals`, (n, W) in N, at a time (s)."""
    if by_lane(walk.clock)[ACTIVE, lane] == 0.0:
        for k in range(signals.shape[0]):
            signals[k, lane] = 0.0
        return
    place = time / by_lane(constants.period)[0, lane]
    last = int(by_lane(constants.samples)[0, lane]) - 1
    i = int(place)
    row, next_row = row_of(min(i, last), log), row_of(min(i + 1, last), log)
    for k in range(signals.shape[0]):
        before, after = log.recent[lane, row, k], log.recent[lane, next_row, k]
        signals[k, lane] = before + (place - i) * (after - before)


@inlined
def row_of(sample: int, log: Log) -> int:
    """Row of a sample among the recent ones: its number modulo theirs, a power of two."""
    return sample & (log.recent.shape[1] - 1)


@merged
def pass_marks(constants: Constants, walk: Walk, log: Log, live: bool) -> bool:
    """Sets the next mark where one is reached, and the signals there; whether a simulation
    is done."""
    clock, signals, done = by_lane(walk.clock), by_lane(walk.signals), False
    oscillator_output(walk.neurons, walk.output)
    for lane in range(log.kept.size):
        if clock[STATUS, lane] != WALKING or clock[TIME, lane] < clock[MARK, lane]:
            continue
        log.passed[lane] += 1
        clock[MARK, lane] = log.marks[lane, log.passed[lane]]
        if clock[MARK, lane] == math.inf:
            clock[STATUS, lane] = DONE
            done = True
        start_up = by_lane(constants.start_up)[0, lane]
        clock[ACTIVE, lane] = 1.0 if clock[TIME, lane] >= start_up else 0.0
        if not live:
            interpolate(constants, walk, log, lane, clock[TIME, lane], signals)
            continue
        for k in range(walk.output.size):
            force = by_lane(constants.gain)[0, lane] * by_lane(walk.output)[k, lane]
            signals[k, lane] = clock[ACTIVE, lane] * force
    return done


@merged
def keep_samples(constants: Constants, walk: Walk, log: Log, live: bool) -> None:
    """Keeps the samples that are due in the accepted step of each lane that has one."""
    clock, modes, accepted = by_lane(walk.clock), by_lane(walk.modes), by_lane(walk.asked)
    signals = np.empty((walk.signals.size, log.kept.size))
    for lane in range(log.kept.size):
        while accepted[ACCEPTED, lane] != 0.0 and clock[DUE, lane] <= clock[END, lane]:
            i, due, step = log.kept[lane], clock[DUE, lane], clock[STEP, lane]
            part = 1.0 if due == clock[END, lane] else (due - clock[TIME, lane]) / step
            before = column(by_lane(walk.step.state), lane)
            after = column(by_lane(walk.step.end), lane)
            state = interpolate_state(before, after, step, part)
            for k in range(state.size):
                log.states[lane, i, k] = state[k]
            for k in range(modes.shape[0]):
                for c in range(MODE_COLUMNS):
                    log.modes[lane, i, k, c] = modes[k, c, lane]
            if not live:
                interpolate(constants, walk, log, lane, due, signals)
            for k in range(signals.shape[0]):
                first, last = by_lane(walk.signals)[k, lane], by_lane(walk.end_signals)[k, lane]
                between = first + part * (last - first)
                log.signals[lane, i, k] = between if live else signals[k, lane]
            drives, end_drives = by_lane(walk.drives), by_lane(walk.end_drives)
            for k in range(walk.drives.shape[0]):
                first, last = drives[k, DRIVE, lane], end_drives[k, lane]
                log.drives[lane, i, k] = first + part * (last - first)
            log.kept[lane] = i + 1
            clock[DUE, lane] = log.times[lane, i + 1]


@inlined
def column(table: Table, lane: int) -> Array:
    """A copy of a lane of a table (..., W)."""
    copy = np.empty(table.shape[0])
    for k in range(copy.size):
        copy[k] = table[k, lane]
    return copy
