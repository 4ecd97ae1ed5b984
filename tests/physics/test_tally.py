"""The tally of a walk: work, signals, lifted bodies and tension of hand-made motions."""

import math

import numpy as np
import pytest

from tetra_drake.physics.actuator import DIRECT, DRIVE_COLUMNS
from tetra_drake.physics.cable import LENGTH, PASSIVE, PULL_COLUMNS, TENSION, Cables
from tetra_drake.physics.tally import EFFORT_COLUMNS, Tally, observe

CABLES = Cables([3, 3], [4, 5], [0, PASSIVE], [1.0, 1.0], [0.0, 0.0], [0.0, 0.0])
"""The first is driven."""

NO_DRIVES = np.zeros((0, DRIVE_COLUMNS))

CARRIERS = np.array([0, 0, 1])
"""Two contacts of the first body and one of the second."""


def tallied(times, *, lengths, signals, tensions=None, loads=None, begins=0.0) -> Tally:
    """The tally of the motion of both cables' length (k,), their tension and the contacts' loads
    (k, 3) at times (k,)."""
    columns = [np.zeros(1) for _ in Tally._fields]
    tally = Tally(*columns)._replace(
        begins=np.array([begins]), lengths=np.zeros(2), lifted=np.zeros(2), tension=np.full(1, 99.0)
    )
    tally = tally._replace(effort=np.zeros(EFFORT_COLUMNS))
    pulls, pushes = np.zeros((2, PULL_COLUMNS)), np.zeros((3, 3))
    for k, time in enumerate(times):
        pulls[:, LENGTH] = lengths[k]
        pulls[:, TENSION] = 1.0 if tensions is None else tensions[k]
        pushes[:, 2] = 0.0 if loads is None else loads[k]
        # The rate of signals is 0 / 0 where no time has passed, which counts for nothing.
        with np.errstate(divide="ignore", invalid="ignore"):
            signal = np.array([signals[k]])
            observe(tally, CABLES, CARRIERS, DIRECT, time, signal, NO_DRIVES, pulls, pushes)
    return tally


TIMES = np.linspace(0.0, 2.0 * math.pi, 1001)


def test_a_constant_pull_works_along_the_way_by_which_its_cable_shortens():
    # 1 + 0.1 sin t shortens by 0.2 m in a period; an actuator takes no work back, and the cable
    # that is not driven does not count.
    tally = tallied(TIMES, lengths=1.0 + 0.1 * np.sin(TIMES), signals=np.full(1001, 2.0))
    assert tally.work[0] == pytest.approx(2.0 * 0.2, rel=1e-5)
    pushes = tallied(TIMES, lengths=1.0 + 0.1 * np.sin(TIMES), signals=np.full(1001, -2.0))
    assert pushes.work[0] == pytest.approx(2.0 * 0.2, rel=1e-5)


def test_a_pull_in_phase_with_the_shortening_does_the_work_of_its_circle():
    # S = 2 cos t and -dl/dt = 0.1 cos t: the integral of 0.2 cos² over a period.
    tally = tallied(TIMES, lengths=1.0 - 0.1 * np.sin(TIMES), signals=2.0 * np.cos(TIMES))
    assert tally.work[0] == pytest.approx(0.2 * math.pi, rel=1e-4)
    # A quarter of a period apart, 0.2 sin t cos t is positive half of the time: twice 0.2 / 2.
    apart = tallied(TIMES, lengths=1.0 - 0.1 * np.sin(TIMES), signals=2.0 * np.sin(TIMES))
    assert apart.work[0] == pytest.approx(0.2, rel=1e-4)


def test_the_rate_of_signals_is_integrated_as_its_square():
    tally = tallied(TIMES, lengths=np.ones(1001), signals=2.0 * np.sin(TIMES))
    assert tally.roughness[0] == pytest.approx(4.0 * math.pi, rel=1e-4)


def test_sums_begin_with_the_first_step_that_is_whole_and_least_values_at_once():
    times, lengths = np.arange(6.0), np.array([5.0, 4.0, 3.0, 2.0, 1.0, 0.0])
    signals, tensions = np.ones(6), np.array([3.0, -1.0, 2.0, 1.0, 1.0, 1.0])
    tally = tallied(times, lengths=lengths, signals=signals, tensions=tensions, begins=1.5)
    assert (tally.work[0], tally.tension[0]) == (3.0, -1.0), "the steps from 2 s on work"
    assert tallied(times, lengths=lengths, signals=signals, begins=2.0).work[0] == 3.0
    # What is seen twice counts once: a step that was rejected.
    twice = np.repeat(np.arange(6), 2)
    tally = tallied(times[twice], lengths=lengths[twice], signals=signals[twice])
    assert tally.work[0] == 5.0


def test_a_body_is_lifted_while_none_of_its_contacts_bears():
    loads = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 1, 1], [0, 0, 0.5], [0, 0, 0]])
    times = np.array([0.0, 1.0, 3.0, 6.0, 10.0, 15.0])  # a step is as its end
    tally = tallied(times, lengths=np.ones(6), signals=np.ones(6), loads=loads)
    assert tally.lifted.tolist() == [3.0 - 1.0 + 10.0 - 6.0 + 5.0, 1.0 + 2.0 + 5.0]
