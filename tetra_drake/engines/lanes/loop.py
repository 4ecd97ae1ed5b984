"""Simulation loop: several simulations in lanes, each with its own time, step and modes.

All lanes do the same iteration: forces, prediction of the next mode change, signals, one step. If
the step of a lane is rejected, the lane repeats it with a shorter step in the next iteration.

The network of the thesis's listing does not depend on the robot. It runs ahead in its own steps,
and its signals are interpolated. (If signals were computed beforehand, one lane at a time, one lane
would be slower by a tenth, and eight lanes by a fifth.) A `live` network takes the same steps as
the robot, by Heun's method. An explicit method is enough because the network is slow. ROS2 without
its matrix is Heun's method, so both together are of order 2.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from tetra_drake.engines.lanes.dynamics import Solver, StepMemory, accelerate
from tetra_drake.engines.lanes.ros2 import larger, take_step
from tetra_drake.kernels.compiling import inlined, merged
from tetra_drake.kernels.lanes import (
    Real,
    Table,
    Truth,
    any_lane,
    by_lane,
    maximum,
    minimum,
    select,
)
from tetra_drake.laws import actuator, contact, oscillator
from tetra_drake.laws.capsules import time_to_pass
from tetra_drake.laws.feedback import Senses, sense
from tetra_drake.laws.forces import Forces, compute_forces, move_robot
from tetra_drake.laws.kinematics import interpolate_state
from tetra_drake.laws.mode_change import time_to_mode_change
from tetra_drake.laws.model import Model
from tetra_drake.laws.sparse import BLOCK
from tetra_drake.laws.tally import Tally, observe

IDLE, RUNNING, DONE, TOO_FAST, STEP_TOO_SMALL, TOO_MANY_EVALUATIONS = range(6)
"""Values of a lane's status. DONE: the robot has reached its pause. The last three are failures."""

LEAST_STEP = 1e-9  # s
SAFETY, SHRINK, GROW = 0.85, 0.2, 3.0
"""Constants of the step control. The next step is the length with an error equal to the tolerance,
times SAFETY. It is SHRINK to GROW times as long as the last step."""
AIM_FACTOR = 1.02
"""Factor on the predicted time to a mode change. A step ends just after the change: the factor
covers the error of the prediction, and the setting `look_ahead` is added."""
EVALUATIONS = 3
"""Number of force evaluations per attempted step."""
STATUS, TIME, PLANNED, STEP, END, MARK, DUE, ACTIVE, SAMPLES, TRIED, TAKEN, CLOCK_ROWS = range(12)
"""Rows of `clock`, and their number. Times and lengths of steps are in s.

STATUS, TIME: status of the lane and its time. PLANNED: length of the next step. STEP, END: length
and end of the step that is tried. MARK: next time at which a step must end. DUE: time of the next
sample. ACTIVE: 1 if signals act, 0 before the start-up time. SAMPLES: number of computed samples of
the signals. TRIED, TAKEN: numbers of steps.
"""

ACCEPTED, NETWORK_STEPS, TURN_INDEX, SCRATCH_ROWS = range(4)
"""Rows of `scratch`, and their number: 1 if the step is accepted, 1 if the network takes a step,
position in the steering table `turns` (an index with a fraction)."""


class Constants(NamedTuple):
    """Constants of the simulations in the lanes, in SI units: each lane has its own. Tables without
    a shape have one number per lane."""

    robot: Model
    solver: Solver
    oscillators: oscillator.Oscillators
    senses: Senses
    sides: Table
    """Side of each input (2n,) of n oscillators: 1 left, -1 right, 0 neither."""
    tonic_input: Table
    """Tonic input without steering."""
    gain: Table
    """Force (N) per unit of an oscillator's output."""
    period: Table
    """Time (s) between samples of the signals of the thesis's listing, or of the steering."""
    samples: Table
    """Number of samples of the listing's signals, or of a command. The last sample holds for ever.
    A controller adds samples during the simulation."""
    start_up: Table
    """Start-up time: signals act from then on."""
    tolerance: Table
    max_step: Table
    look_ahead: Table
    max_evaluations: Table
    max_speed: Table
    """Speed limit of the bodies."""
    is_live: bool
    """True if the network is integrated together with the robots; otherwise signals are
    interpolated between samples."""


class LaneState(NamedTuple):
    """State of the simulations in the lanes, with scratch memory.

    The fields from `clock` to `tally`, and `step.state`, the bodies' state, are the whole state of
    a simulation. Only they are kept while a robot waits for a lane; see places.Places.
    """

    clock: Annotated[Table, CLOCK_ROWS]
    modes: Annotated[Table, "contacts", contact.MODE_COLUMNS]
    signals: Annotated[Table, "signals"]
    """Actuator signals (N) at the present time of each lane."""
    drives: Annotated[Table, "drives", actuator.DRIVE_COLUMNS]
    """States of the actuators at the present time of each lane."""
    oscillators: Annotated[Table, "states", oscillator.STATE_COLUMNS]
    """Table `states` of the oscillators."""
    tonic: Annotated[Table, "2 * signals"]
    """Tonic inputs of the oscillators: their inputs without the feedback."""
    tally: Tally
    step: StepMemory
    scratch: Annotated[Table, SCRATCH_ROWS]
    """Numbers that are computed for all lanes and then read lane by lane."""
    forces: Forces
    acceleration: Annotated[Table, "6 * bodies"]
    end_drives: Annotated[Table, "drives"]
    """States of the actuators at the end of the lane's step."""
    output: Annotated[Table, "signals"]
    """Latest outputs of the oscillators."""
    inputs: Annotated[Table, "2 * signals"]
    """Total inputs of the oscillators: tonic inputs and feedback."""


class Log(NamedTuple):
    """Times at which each simulation stops or is sampled, and its samples; a row per place of the
    batch, which is a robot's index there."""

    place: Annotated[Table, "lanes", int]
    """Row of these tables for the robot in each lane; see `places`."""
    marks: Annotated[Table, "places", "marks"]
    """Marks: times (s) at which a step must end, ascending; infinite after the last."""
    passed: Annotated[Table, "places", int]
    """Number of entries of `marks` that have passed."""
    until: Annotated[Table, "places"]
    """Times (s) at which simulations pause, at the latest their ends."""
    change_ends: Annotated[Table, "places"]
    """Times (s) at which the latest changes of a controller's signals end."""
    times: Annotated[Table, "places", "times"]
    """Times (s) of the samples, ascending; infinite after the last."""
    kept: Annotated[Table, "places", int]
    """Number of recorded samples."""
    states: Annotated[Table, "places", "samples", "13 * bodies"]
    modes: Annotated[Table, "places", "samples", "contacts", contact.MODE_COLUMNS]
    """Contact modes during the step that contains the sample."""
    signals: Annotated[Table, "places", "samples", "signals"]
    """Signals in N."""
    drives: Annotated[Table, "places", "samples", "drives"]
    recent: Annotated[Table, "places", "recent", "signals"]
    """Ring buffer of the listing's signals; see row_of()."""
    turns: Annotated[Table, "places", "turns"]
    """Steering, -1 to 1, at multiples of `period`, linear in between. The last value holds for
    ever. A single value is in `tonic` from the start."""


@merged
def iterate(constants: Constants, lanes: LaneState, log: Log) -> bool:
    """Tries one step in each lane, with a length of its own. A lane whose error is too large stays
    where it is, and plans a shorter step. Changes the tables of `lanes` and `log` in place.

    Returns True if a simulation has ended: at the time up to which it was to run, or by a failure.
    Samples of motions that are recorded go to `log`.
    """
    clock, ended = lanes.clock, False
    if any_lane((clock[STATUS] == RUNNING) & (clock[TIME] >= clock[MARK])):
        if not constants.is_live:
            run_ahead(constants, lanes, log, clock[TIME])
        ended = pass_marks(constants, lanes, log)
    is_running = clock[STATUS] == RUNNING

    # Modes and forces at the beginning of the step.
    robot, forces, state = constants.robot, lanes.forces, lanes.step.state
    move_robot(robot, state, forces)
    for i in range(lanes.drives.shape[0]):
        forces.drives[i, actuator.DRIVE] = lanes.drives[i, actuator.DRIVE]
    contact.update_modes(state, forces.nodes, robot.ground, forces.frames, lanes.modes)
    compute_forces(robot, state, lanes.modes, lanes.signals, True, forces, lanes.step.force)
    observe(lanes.tally, robot, clock[TIME], lanes.signals, forces)

    step = select(is_running, aim(constants, lanes), 0.0)
    step_end = select(step == clock[MARK] - clock[TIME], clock[MARK], clock[TIME] + step)
    clock[STEP], clock[END] = step, step_end
    foresee_signals(constants, lanes, log)
    drives, at_end = lanes.drives, forces.drives
    for i in range(drives.shape[0]):  # predicted, for the forces at the end of the step
        drives[i, actuator.RATE] = at_end[i, actuator.RATE]
        at_end[i, actuator.DRIVE] = drives[i, actuator.DRIVE] + step * drives[i, actuator.RATE]
    solver, is_live = constants.solver, constants.is_live
    error = take_step(robot, solver, lanes.step, lanes.modes, forces, step, is_live)
    for i in range(drives.shape[0]):  # corrected, with the mean of the rates at both ends
        rate = 0.5 * (drives[i, actuator.RATE] + at_end[i, actuator.RATE])
        lanes.end_drives[i] = drives[i, actuator.DRIVE] + step * rate

    accepted = is_running & (error <= constants.tolerance[0])
    if is_live:
        feel(constants, lanes, log, step_end, lanes.step.end)
        network, states = constants.oscillators, lanes.oscillators
        oscillator.correct_states(network, lanes.inputs, step, accepted, states)
        drive(constants, lanes, lanes.step.end_signals)
    if any_lane(accepted & (clock[DUE] <= step_end)):
        lanes.scratch[ACCEPTED] = select(accepted, 1.0, 0.0)
        keep_samples(constants, lanes, log)
    move_on(lanes, is_running, accepted)

    factor = SAFETY * math.sqrt(constants.tolerance[0] / maximum(error, 1e-12))
    factor = minimum(GROW, maximum(SHRINK, factor))
    factor = select(error == error, factor, SHRINK)  # error is NaN
    planned = minimum(constants.max_step[0], step * factor)
    clock[PLANNED] = select(is_running, planned, clock[PLANNED])
    status = select(is_running, fate(constants, lanes), clock[STATUS])
    ended |= any_lane(status != clock[STATUS])
    clock[STATUS] = status
    return ended


@inlined
def foresee_signals(constants: Constants, lanes: LaneState, log: Log) -> None:
    """Writes the signals (N) at the end of the step to `lanes.step.end_signals`. The signals of a
    live network are a prediction, corrected at the end of the step."""
    clock = lanes.clock
    if constants.is_live:
        feel(constants, lanes, log, clock[TIME], lanes.step.state)
        states = lanes.oscillators
        oscillator.euler_step(constants.oscillators, lanes.inputs, clock[STEP], states)
        drive(constants, lanes, lanes.step.end_signals)
        return
    run_ahead(constants, lanes, log, clock[END])
    for lane in range(log.place.size):
        end = by_lane(clock)[END, lane]
        interpolate(constants, lanes, log, lane, end, by_lane(lanes.step.end_signals))


@inlined
def move_on(lanes: LaneState, is_running: Truth, accepted: Truth) -> None:
    """Copies the end of the step to the state in `lanes`, where the mask `accepted` is true. Counts
    the tried steps of lanes where `is_running` is true, and the taken steps of lanes that
    accept."""
    clock, state = lanes.clock, lanes.step.state
    for i in range(state.size):
        state[i] = select(accepted, lanes.step.end[i], state[i])
    for k in range(lanes.signals.size):
        lanes.signals[k] = select(accepted, lanes.step.end_signals[k], lanes.signals[k])
    for i in range(lanes.drives.shape[0]):
        now = lanes.drives[i, actuator.DRIVE]
        lanes.drives[i, actuator.DRIVE] = select(accepted, lanes.end_drives[i], now)
    clock[TIME] = select(accepted, clock[END], clock[TIME])
    clock[TRIED] += select(is_running, 1.0, 0.0)
    clock[TAKEN] += select(accepted, 1.0, 0.0)


@merged
def aim(constants: Constants, lanes: LaneState) -> Real:
    """Length (s) of the step to try: as planned from the error of the last step, or less. A near
    mode change or mark (a time at which a step must end) shortens it: the step ends just after the
    mode change, at the mark, or halfway to the mark. Near struts that approach shorten it so that
    they cannot pass through each other."""
    robot, clock = constants.robot, lanes.clock
    accelerate(robot, lanes.forces.inertia, lanes.step.force, lanes.acceleration)
    planned = clock[PLANNED]
    change = time_to_mode_change(
        robot, lanes.step.state, lanes.acceleration, lanes.modes, lanes.forces, planned
    )
    step = minimum(planned, AIM_FACTOR * change + constants.look_ahead[0])
    law, nodes, near = robot.strut_contact, lanes.forces.nodes, lanes.forces.near_struts
    step = time_to_pass(robot.struts, law, nodes, near, step)
    remaining = clock[MARK] - clock[TIME]
    halved = select(2.0 * step > remaining, 0.5 * remaining, step)
    return select(step > remaining - LEAST_STEP, remaining, halved)


@inlined
def fate(constants: Constants, lanes: LaneState) -> Real:
    """Status of each lane after a step: RUNNING (1), or the number of its failure: TOO_FAST,
    STEP_TOO_SMALL or TOO_MANY_EVALUATIONS. It has no meaning in lanes that do not run."""
    state, speed = lanes.step.state, 0.0
    bodies = state.size // 13
    for body in range(bodies):
        for k in range(3):
            speed = larger(speed, abs(state[7 * bodies + BLOCK * body + 3 + k]))
    too_fast = (speed > constants.max_speed[0]) | (speed != speed)
    too_many = EVALUATIONS * lanes.clock[TRIED] > constants.max_evaluations[0]
    status = select(too_fast, 1.0 * TOO_FAST, 1.0 * RUNNING)
    status = select(lanes.clock[PLANNED] <= LEAST_STEP, 1.0 * STEP_TOO_SMALL, status)
    return select(too_many, 1.0 * TOO_MANY_EVALUATIONS, status)


@inlined
def run_ahead(constants: Constants, lanes: LaneState, log: Log, until: Real) -> None:
    """Integrates networks that do not depend on the robots, as in the thesis's listing, ahead of
    the robots: until every running lane has the samples of its signals before and after the time
    `until` (s), a time per lane. Writes the samples (N) to the ring buffers `log.recent`.

    Other lanes run too, as far as their ring buffers allow. So steps for a single lane are rare.
    """
    clock, period, is_running = lanes.clock, constants.period[0], lanes.clock[STATUS] == RUNNING
    last_needed = until / period + 1.0
    end_of_buffer = clock[TIME] / period + (log.recent.shape[1] - 1.0)
    is_unfinished = is_running & (clock[SAMPLES] < constants.samples[0])
    while any_lane(is_unfinished & (clock[SAMPLES] <= last_needed)):
        takes_step = is_unfinished & (clock[SAMPLES] < end_of_buffer)
        steer(constants, lanes, log, clock[SAMPLES] + 0.5)
        step = select(takes_step, period, 0.0)
        oscillator.euler_step(constants.oscillators, lanes.tonic, step, lanes.oscillators)
        oscillator.outputs_of(constants.oscillators, lanes.oscillators, lanes.output)
        lanes.scratch[NETWORK_STEPS] = select(takes_step, 1.0, 0.0)
        samples, steps = by_lane(clock), by_lane(lanes.scratch)
        gain, output = by_lane(constants.gain), by_lane(lanes.output)
        for lane in range(log.place.size):
            if steps[NETWORK_STEPS, lane] != 0.0:
                place, row = log.place[lane], row_of(int(samples[SAMPLES, lane]), log)
                for k in range(lanes.output.size):
                    log.recent[place, row, k] = gain[0, lane] * output[k, lane]
        clock[SAMPLES] += lanes.scratch[NETWORK_STEPS]
        is_unfinished = is_running & (clock[SAMPLES] < constants.samples[0])


@inlined
def feel(constants: Constants, lanes: LaneState, log: Log, time: Real, state: Table) -> None:
    """Writes the inputs of the oscillators of a live network, tonic input plus feedback, to
    `lanes.inputs`. They are for the robot's `state` (13*bodies,) at a time (s). A live network is
    integrated together with the robot."""
    steer(constants, lanes, log, time / constants.period[0])
    gains = constants.oscillators.gains
    sense(constants.senses, gains, state, lanes.modes, lanes.forces, lanes.inputs)
    for i in range(lanes.inputs.size):
        lanes.inputs[i] += lanes.tonic[i]


@inlined
def steer(constants: Constants, lanes: LaneState, log: Log, sample: Real) -> None:
    """Writes the tonic input of the oscillators to `lanes.tonic`, for the turn at `sample`. Does
    nothing if the turn is constant.

    `sample` is a position, in each lane, in the lane's row of `log.turns`, the turns (-1 to 1) over
    time: an index with a fraction.
    """
    turns = log.turns.shape[1]
    if turns == 1:
        return
    lanes.scratch[TURN_INDEX] = sample
    scratch, sides, tonic = by_lane(lanes.scratch), by_lane(constants.sides), by_lane(lanes.tonic)
    for lane in range(log.place.size):
        position, unsteered = scratch[TURN_INDEX, lane], by_lane(constants.tonic_input)[0, lane]
        i = max(0, min(int(position), turns - 2))
        place = log.place[lane]
        before, after = log.turns[place, i], log.turns[place, i + 1]
        turn = before + (min(position, turns - 1.0) - i) * (after - before)
        for k in range(lanes.tonic.size):
            tonic[k, lane] = oscillator.steered_input(unsteered, turn, sides[k, lane])


@inlined
def drive(constants: Constants, lanes: LaneState, signals: Table) -> None:
    """Writes the signals (N) of a live network to `signals` (m,), at the time of the table
    `lanes.oscillators`: the gain times the oscillators' outputs, but 0 before the start-up time."""
    oscillator.outputs_of(constants.oscillators, lanes.oscillators, lanes.output)
    active, gain = lanes.clock[ACTIVE] != 0.0, constants.gain[0]
    for k in range(lanes.output.size):
        signals[k] = select(active, gain * lanes.output[k], 0.0)


@inlined
def interpolate(
    constants: Constants, lanes: LaneState, log: Log, lane: int, time: float, signals: Table
) -> None:
    """Writes the signals (N) of lane number `lane` at a time (s) to its column of `signals` (m, W),
    where W is the number of lanes.

    They are linear between the samples in `log.recent`, which come from a network that does not
    depend on the robot, a command or a controller. They are 0 before the start-up time.
    """
    if by_lane(lanes.clock)[ACTIVE, lane] == 0.0:
        for k in range(signals.shape[0]):
            signals[k, lane] = 0.0
        return
    position = time / by_lane(constants.period)[0, lane]
    known = max(by_lane(constants.samples)[0, lane], by_lane(lanes.clock)[SAMPLES, lane])
    last = int(known) - 1
    i = int(position)
    row, next_row = row_of(min(i, last), log), row_of(min(i + 1, last), log)
    place = log.place[lane]
    for k in range(signals.shape[0]):
        before, after = log.recent[place, row, k], log.recent[place, next_row, k]
        signals[k, lane] = before + (position - i) * (after - before)


@inlined
def row_of(sample: int, log: Log) -> int:
    """Row of sample number `sample` of the signals in a robot's ring buffer in `log.recent`: the
    number modulo the number of rows, which is a power of two."""
    return sample & (log.recent.shape[1] - 1)


@merged
def pass_marks(constants: Constants, lanes: LaneState, log: Log) -> bool:
    """Sets the next mark and the present signals in `lanes`, for lanes that have reached their
    mark. A mark is a time at which a step must end.

    A lane that has reached its pause gets the status DONE. Returns True if there is one.
    """
    clock, signals, done = by_lane(lanes.clock), by_lane(lanes.signals), False
    for lane in range(log.place.size):
        if clock[STATUS, lane] != RUNNING or clock[TIME, lane] < clock[MARK, lane]:
            continue
        place = log.place[lane]
        if clock[TIME, lane] >= log.marks[place, log.passed[place]]:
            log.passed[place] += 1
        clock[MARK, lane] = next_mark(log, place, clock[TIME, lane])
        if clock[TIME, lane] >= log.until[place]:
            clock[STATUS, lane] = DONE
            done = True
        start_up = by_lane(constants.start_up)[0, lane]
        clock[ACTIVE, lane] = 1.0 if clock[TIME, lane] >= start_up else 0.0
        if not constants.is_live:
            interpolate(constants, lanes, log, lane, clock[TIME, lane], signals)
    if constants.is_live:
        drive(constants, lanes, lanes.signals)
    return done


@inlined
def next_mark(log: Log, place: int, time: float) -> float:
    """Next time (s), after `time` (s), at which a step of the robot in row `place` of `log` must
    end: the next entry of `log.marks`, its pause, or the end of a change of its controller's
    signals."""
    mark = min(log.marks[place, log.passed[place]], log.until[place])
    if log.change_ends[place] > time:
        mark = min(mark, log.change_ends[place])
    return mark


@merged
def keep_samples(constants: Constants, lanes: LaneState, log: Log) -> None:
    """Writes the samples of the motion that are due within the step to the tables of `log`, for
    lanes that accept the step. Contact modes are the ones during the step; all else is
    interpolated."""
    clock, modes, accepted = by_lane(lanes.clock), by_lane(lanes.modes), by_lane(lanes.scratch)
    signals = np.empty((lanes.signals.size, log.place.size))
    starts, ends = by_lane(lanes.signals), by_lane(lanes.step.end_signals)
    for lane in range(log.place.size):
        place = log.place[lane]
        while accepted[ACCEPTED, lane] != 0.0 and clock[DUE, lane] <= clock[END, lane]:
            i, due, step = log.kept[place], clock[DUE, lane], clock[STEP, lane]
            part = 1.0 if due == clock[END, lane] else (due - clock[TIME, lane]) / step
            before = column(by_lane(lanes.step.state), lane)
            after = column(by_lane(lanes.step.end), lane)
            state = interpolate_state(before, after, step, part)
            for k in range(state.size):
                log.states[place, i, k] = state[k]
            for k in range(modes.shape[0]):
                for c in range(contact.MODE_COLUMNS):
                    log.modes[place, i, k, c] = modes[k, c, lane]
            if not constants.is_live:
                interpolate(constants, lanes, log, lane, due, signals)
            for k in range(signals.shape[0]):
                first, last = starts[k, lane], ends[k, lane]
                between = first + part * (last - first)
                log.signals[place, i, k] = between if constants.is_live else signals[k, lane]
            drives, end_drives = by_lane(lanes.drives), by_lane(lanes.end_drives)
            for k in range(lanes.drives.shape[0]):
                first, last = drives[k, actuator.DRIVE, lane], end_drives[k, lane]
                log.drives[place, i, k] = first + part * (last - first)
            log.kept[place] = i + 1
            clock[DUE, lane] = log.times[place, i + 1]


@inlined
def column(table: Table, lane: int) -> np.ndarray:
    """Copy (size,) of the numbers of lane number `lane` of a table (size, W), with W lanes."""
    copy = np.empty(table.shape[0])
    for k in range(copy.size):
        copy[k] = table[k, lane]
    return copy
