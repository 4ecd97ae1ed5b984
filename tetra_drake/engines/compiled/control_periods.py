"""Kernels that simulate in control periods: a sample of a command, then a pause at its end.

A control period ends at a mark of the loop. There a lane waits until hold() gives it the next
sample and the next marks.
"""

from __future__ import annotations

import functools
import math

from tetra_drake.engines.compiled import loop
from tetra_drake.physics import cable, contact, kinematics
from tetra_drake.robot.readings import Readings
from tetra_drake.simd.compiling import compiled
from tetra_drake.simd.lanes import Table, by_lane
from tetra_drake.simd.packed import Packed, unpacked


@functools.partial(compiled, nogil=True)
def hold(parts: loop.Parts, signals: Table, marks: Table) -> None:
    """Appends a sample to the command of each of the first lanes, and sets the next marks.

    A lane without marks stays as it is. The signals change within a step of the listing, which
    begins now; the signals of a whole command change in the same way.

    Args:
        parts: the simulations, each at a multiple of the listing's step.
        signals: the sample (lanes, m) in N.
        marks: times (lanes, marks) in s, ascending; infinite after the last.
    """
    constants, lanes, log, _ = unpacked(parts)
    clock, held = by_lane(lanes.clock), by_lane(lanes.signals)
    samples, period = by_lane(constants.samples), by_lane(constants.period)
    for lane in range(marks.shape[0]):
        if marks[lane, 0] == math.inf:
            continue
        now = int(clock[loop.TIME, lane] / period[0, lane] + 0.5)
        for k in range(signals.shape[1]):
            log.recent[lane, loop.row_of(now - 1, log), k] = held[k, lane]
            log.recent[lane, loop.row_of(now, log), k] = held[k, lane]
            log.recent[lane, loop.row_of(now + 1, log), k] = signals[lane, k]
        samples[0, lane] = clock[loop.SAMPLES, lane] = now + 2.0
        for i in range(marks.shape[1]):
            log.marks[lane, i] = marks[lane, i]
        log.passed[lane] = 0
        clock[loop.MARK, lane] = marks[lane, 0]
        clock[loop.STATUS, lane] = loop.RUNNING


@functools.partial(compiled, nogil=True)
def read(parts: loop.Parts, readings: Packed[Readings]) -> None:
    """Writes the readings of the simulations, a row for each of the first lanes."""
    _, lanes, _, _ = unpacked(parts)
    to = unpacked(readings)
    clock, state, nodes = (
        by_lane(lanes.clock),
        by_lane(lanes.step.state),
        by_lane(lanes.forces.nodes),
    )
    cables, loads = by_lane(lanes.forces.cable_forces), by_lane(lanes.forces.ground_forces)
    bodies = to.q_WB.shape[1]
    for lane in range(to.time.size):
        to.time[lane] = clock[loop.TIME, lane]
        for i in range(to.lengths.shape[1]):
            to.lengths[lane, i] = cables[i, cable.LENGTH, lane]
            to.rates[lane, i] = cables[i, cable.RATE, lane]
            to.tensions[lane, i] = cables[i, cable.TENSION, lane]
        for i in range(to.normal_forces.shape[1]):
            to.normal_forces[lane, i] = loads[i, contact.NORMAL, lane]
        for body in range(bodies):
            for k in range(4):
                to.q_WB[lane, body, k] = state[7 * body + k, lane]
            for k in range(3):
                to.w_WB[lane, body, k] = state[7 * bodies + 6 * body + k, lane]
        for node in range(to.p_WN.shape[1]):
            for k in range(3):
                to.p_WN[lane, node, k] = nodes[node, kinematics.P_WN + k, lane]
                to.v_WN[lane, node, k] = nodes[node, kinematics.V_WN + k, lane]
