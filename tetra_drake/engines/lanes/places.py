"""Tables of robots that take turns in the lanes of the simulation loop.

A place is a row of the tables. A lane simulates a robot until its pause, or its failure. Then the
robot goes back to its place, its readings are written, and the lane takes the next one that waits.
So no lane waits for the slowest.
"""

from __future__ import annotations

import functools
import math
from typing import Annotated, NamedTuple, TypeAlias

from tetra_drake.engines.lanes import loop
from tetra_drake.engines.lanes.loop import Constants, LaneState, Log
from tetra_drake.kernels.compiling import compiled, inlined
from tetra_drake.kernels.lanes import Table, any_lane, by_lane, floor, select
from tetra_drake.kernels.packed import Packed, unpacked
from tetra_drake.laws import cable, contact, kinematics
from tetra_drake.laws.forces import move_robot
from tetra_drake.laws.tally import update_clearance
from tetra_drake.robot.readings import Readings

ROUND = 32
"""Steps of a robot (about 40 ms of motion) between two computations of the clearance. They find the
least clearance to within 0.1 mm."""

NEXT, LAST = range(2)
"""Entries of `queue`: index of the next robot in `waiting`, and number of robots there."""


class Places(NamedTuple):
    """State and constants of each robot of a batch, and the queue of robots that wait for a lane. A
    row of a table is a place, the index of a robot in the batch."""

    states: Annotated[Table, "places", "numbers"]
    """The numbers of LaneState before `step.end`."""
    constants: Annotated[Table, "places", "constants"]
    """The numbers of Constants."""
    waiting: Annotated[Table, "places", int]
    """Places of the robots that wait for a lane, in their order."""
    queue: Annotated[Table, 2, int]
    signals: Annotated[Table, "places", "signals"]
    """Actuator signals (N) that controllers set and hold."""
    holds: Annotated[Table, "places", int]
    """1 for a robot that gets new signals when it takes a lane, otherwise 0."""


class Memory(NamedTuple):
    """Memory of the tables of all lanes, for copies from and to Places: (numbers, W), a column for
    each of W lanes, with its numbers in the order of a row of `Places`."""

    states: Table
    constants: Table


LaneParts: TypeAlias = Packed[tuple[Constants, LaneState, Log, Memory, Places, Readings]]
"""The simulations, packed for kernels that Python calls often."""


@functools.partial(compiled, nogil=True)
def advance(parts: LaneParts, rounds: int) -> None:
    """Simulates the robots in the lanes for a number of rounds. A round is ROUND (32) tried steps
    per lane; then the clearance, the least distance between struts, is due.

    Returns earlier if no robot is left, or after a round if a robot has ended and no robot waits. A
    robot has ended at its pause, or if it has failed. The robots that wait at first begin together
    with a round, so that their clearances are due together.
    """
    constants, lanes, log, _, places, readings = unpacked(parts)
    clock, robot, state = lanes.clock, constants.robot, lanes.step.state
    exchange(parts)
    for _ in range(rounds):
        ended = False
        for _ in range(ROUND):
            has_ended = loop.iterate(constants, lanes, log)
            if has_ended:
                read_paused(lanes, log, readings)

            # The clearance is due after each ROUND steps, and at the end of a motion.
            rounds = clock[loop.TRIED] * (1.0 / ROUND)
            is_due = (clock[loop.STATUS] == loop.RUNNING) & (rounds == floor(rounds))
            is_due |= (clock[loop.STATUS] == loop.DONE) & (clock[loop.DUE] == math.inf)
            if any_lane(is_due):
                before = lanes.tally.clearance[0]
                move_robot(robot, state, lanes.forces)
                update_clearance(lanes.tally, robot, state, lanes.forces.nodes)
                lanes.tally.clearance[0] = select(is_due, lanes.tally.clearance[0], before)

            if has_ended:
                ended = True
                exchange(parts)
                if not any_lane(lanes.clock[loop.STATUS] == loop.RUNNING):
                    return
        if ended and places.queue[NEXT] == places.queue[LAST]:
            return


@functools.partial(compiled, nogil=True)
def exchange(parts: LaneParts) -> None:
    """Copies the states of robots that have ended from their lanes back to their rows of the tables
    of Places, and puts waiting robots from the tables into idle lanes."""
    constants, lanes, log, memory, places, _ = unpacked(parts)
    clock, held, queue = by_lane(lanes.clock), by_lane(lanes.signals), places.queue
    searched = by_lane(lanes.forces.near_struts.p_WN)
    for lane in range(log.place.size):
        if clock[loop.STATUS, lane] == loop.RUNNING:
            continue
        if clock[loop.STATUS, lane] != loop.IDLE:
            for i in range(places.states.shape[1]):
                places.states[log.place[lane], i] = memory.states[i, lane]
            clock[loop.STATUS, lane] = loop.IDLE
        if queue[NEXT] < queue[LAST]:
            place = places.waiting[queue[NEXT]]
            queue[NEXT] += 1
            log.place[lane] = place
            for i in range(places.states.shape[1]):
                memory.states[i, lane] = places.states[place, i]
            for i in range(places.constants.shape[1]):
                memory.constants[i, lane] = places.constants[place, i]
            clock[loop.MARK, lane] = loop.next_mark(log, place, clock[loop.TIME, lane])
            clock[loop.STATUS, lane] = loop.RUNNING
            for node in range(searched.shape[0]):
                searched[node, 0, lane] = math.inf  # so that near struts are searched
            if places.holds[place] == 0:
                continue
            # New signals become samples. The robot is at a multiple of the listing's step. As in a
            # whole command, the signals change linearly within the next step.
            now = int(clock[loop.TIME, lane] / by_lane(constants.period)[0, lane] + 0.5)
            for k in range(held.shape[0]):
                log.recent[place, loop.row_of(now - 1, log), k] = held[k, lane]
                log.recent[place, loop.row_of(now, log), k] = held[k, lane]
                log.recent[place, loop.row_of(now + 1, log), k] = places.signals[place, k]
            clock[loop.SAMPLES, lane] = now + 2.0
            places.holds[place] = 0


@inlined
def read_paused(lanes: LaneState, log: Log, to: Readings) -> None:
    """Writes the readings of robots that have reached their pause to `to`, each in the row of its
    place, the robot's index in the batch.

    Call it before the clearance is computed. For this the nodes' positions are computed again in
    all lanes, which changes their last digits.
    """
    clock = by_lane(lanes.clock)
    state, nodes = by_lane(lanes.step.state), by_lane(lanes.forces.nodes)
    cables, loads = by_lane(lanes.forces.cable_forces), by_lane(lanes.forces.ground_forces)
    bodies = to.q_WB.shape[1]
    for lane in range(log.place.size):
        if clock[loop.STATUS, lane] != loop.DONE:
            continue
        place = log.place[lane]
        to.time[place] = clock[loop.TIME, lane]
        for i in range(to.lengths.shape[1]):
            to.lengths[place, i] = cables[i, cable.LENGTH, lane]
            to.rates[place, i] = cables[i, cable.RATE, lane]
            to.tensions[place, i] = cables[i, cable.TENSION, lane]
        for i in range(to.normal_forces.shape[1]):
            to.normal_forces[place, i] = loads[i, contact.NORMAL, lane]
        for body in range(bodies):
            for k in range(4):
                to.q_WB[place, body, k] = state[7 * body + k, lane]
            for k in range(3):
                to.w_WB[place, body, k] = state[7 * bodies + 6 * body + k, lane]
        for node in range(to.p_WN.shape[1]):
            for k in range(3):
                to.p_WN[place, node, k] = nodes[node, kinematics.P_WN + k, lane]
                to.v_WN[place, node, k] = nodes[node, kinematics.V_WN + k, lane]
