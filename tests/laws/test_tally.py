"""The tally of a walk: work, signals, lifted bodies, tension and rolling of hand-made motions."""

from types import SimpleNamespace

import numpy as np
import pytest

from tetra_drake.kernels.packed import allocate
from tetra_drake.laws.actuator import DIRECT, DRIVE, DRIVE_COLUMNS, LIMITED, TENSION_MOTOR, WINCH
from tetra_drake.laws.cable import CABLE_FORCE_COLUMNS, LENGTH, PASSIVE, TENSION
from tetra_drake.laws.kinematics import NODE_COLUMNS, P_WN, V_WN
from tetra_drake.laws.tally import Tally, observe

CABLES = SimpleNamespace(signal=[0, PASSIVE])
"""The first is driven."""

CARRIERS = np.array([0, 0, 1])
"""Two contacts of the first body and one of the second."""

NODES = np.zeros((3, NODE_COLUMNS))
"""Two nodes at rest, and a fixed node."""
NODES[:, P_WN] = [-1.0, 1.0, 9.0]


ALWAYS = {"lengths": 1.0, "signals": 1.0, "tensions": 1.0, "loads": 0.0}
ALWAYS |= {"drives": np.zeros((0, DRIVE_COLUMNS)), "nodes": NODES}


def tallied(times, *, begins=0.0, kind=DIRECT, **series) -> Tally:
    """The tally of what is so at times (k,), ALWAYS where no series is given: both cables' length
    (k,), the signal (k,), the tensions (k, 2), the contacts' loads (k, 3), the nodes (k, nodes,
    NODE_COLUMNS), of which the last is fixed, and the drives (k, drives, DRIVE_COLUMNS) of
    actuators of a kind."""
    tally = allocate(Tally, {"signals": 1, "cables": 2, "bodies": 2})
    tally.begins[0] = begins
    cable_forces, ground_forces = np.zeros((2, CABLE_FORCE_COLUMNS)), np.zeros((3, 3))
    forces = SimpleNamespace(cable_forces=cable_forces, ground_forces=ground_forces)
    ground, actuator = SimpleNamespace(carriers=CARRIERS), SimpleNamespace(kind=kind)
    robot = SimpleNamespace(cables=CABLES, ground=ground, actuator=actuator)
    for k, time in enumerate(times):
        now = ALWAYS | {name: values[k] for name, values in series.items()}
        cable_forces[:, LENGTH], cable_forces[:, TENSION] = now["lengths"], now["tensions"]
        ground_forces[:, 2] = now["loads"]
        forces.nodes, forces.drives = now["nodes"], now["drives"]
        robot.first_node = np.array([0, len(forces.nodes) - 1])
        # The rate of signals is 0 / 0 where no time has passed, which counts for nothing.
        with np.errstate(divide="ignore", invalid="ignore"):
            observe(tally, robot, time, np.array([now["signals"]]), forces)
    return tally


def test_sums_begin_with_the_first_step_that_is_whole_and_least_values_at_once():
    times, lengths = np.arange(6.0), np.array([5.0, 4.0, 3.0, 2.0, 1.0, 0.0])
    tensions = [3.0, -1.0, 2.0, 1.0, 1.0, 1.0]
    tally = tallied(times, lengths=lengths, tensions=tensions, begins=1.5)
    assert tally.effort.work[0] == 3.0, "the steps from 2 s on work"
    assert tally.tension.of_all[0] == -1.0
    assert tallied(times, lengths=lengths, begins=2.0).effort.work[0] == 3.0
    # What is seen twice counts once: a step that was rejected.
    twice = np.repeat(np.arange(6), 2)
    assert tallied(times[twice], lengths=lengths[twice]).effort.work[0] == 5.0


def test_a_body_is_lifted_while_none_of_its_contacts_bears():
    loads = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 1, 1], [0, 0, 0.5], [0, 0, 0]])
    times = np.array([0.0, 1.0, 3.0, 6.0, 10.0, 15.0])  # a step is as its end
    tally = tallied(times, loads=loads)
    assert tally.lifted.time.tolist() == [3.0 - 1.0 + 10.0 - 6.0 + 5.0, 1.0 + 2.0 + 5.0]


EFFORT = {
    "times": np.array([0.0, 1.0, 3.0, 4.0]),
    "tensions": np.array([[9.0, 50.0], [2.0, 50.0], [3.0, 50.0], [4.0, 50.0]]),
}
"""Three steps; the tension of the cable that is not driven is 50 N."""

WOUND = np.array([1.0, 0.9, 0.5, 0.7])
"""0.1 m in 1 s, 0.4 m in 2 s, then 0.2 m paid out."""

# 9 N, 0.2 m/s, 3 N * 0.2 m/s
PEAKS = pytest.approx([9.0, 0.2, 0.6])
# 1 * 2 + 2 * 3 + 1 * 4 N s, 0.1 + 0.4 + 0.2 m, 2 N * 0.1 m + 3 N * 0.4 m, without what is paid out
SUMS = pytest.approx([12.0, 0.7, 1.4])


def peaks(tally: Tally) -> list[float]:
    """Of force, speed and power."""
    effort = tally.effort
    return [effort.peak_force[0], effort.peak_speed[0], effort.peak_power[0]]


def sums(tally: Tally) -> list[float]:
    """Of force by time, of lengths wound, and of the work on them."""
    return [tally.effort.impulse[0], tally.effort.wound[0], tally.effort.pulled[0]]


@pytest.mark.parametrize("kind", [DIRECT, TENSION_MOTOR])
def test_actuators_without_a_winch_wind_what_their_cables_shorten(kind):
    drives = np.zeros((4, int(kind != DIRECT), DRIVE_COLUMNS))
    tally = tallied(lengths=WOUND, kind=kind, drives=drives, **EFFORT)
    assert (peaks(tally), sums(tally), tally.effort.limited[0]) == (PEAKS, SUMS, 0.0)


def test_winches_wind_their_free_length_and_are_limited_for_a_time():
    drives = np.zeros((4, 1, DRIVE_COLUMNS))
    drives[:, 0, DRIVE], drives[:, 0, LIMITED] = WOUND, [1.0, 0.0, 1.0, 1.0]
    tally = tallied(lengths=np.linspace(1.0, 9.0, 4), kind=WINCH, drives=drives, **EFFORT)
    assert (peaks(tally), sums(tally), tally.effort.limited[0]) == (PEAKS, SUMS, 2.0 + 1.0)
    assert tally.effort.work[0] == pytest.approx(1.4), "of the tension"


def test_only_peaks_count_before_the_steady_stretch():
    tally = tallied(lengths=WOUND, begins=3.0, **EFFORT)
    # The last step, in which 0.2 m are paid out at 4 N.
    assert sums(tally) == pytest.approx([4.0, 0.2, 0.0])
    assert peaks(tally) == PEAKS


def test_a_peak_of_speed_counts_in_either_direction():
    tally = tallied(lengths=WOUND[::-1], **EFFORT)
    assert peaks(tally) == pytest.approx([9.0, 0.2, 0.4])
    paid_out = tallied(lengths=np.array([0.0, 0.1, 0.2, 0.9]), **EFFORT)
    assert peaks(paid_out) == pytest.approx([9.0, 0.7, 0.0])


TIMES = np.linspace(0.0, 2.0, 401)

SHAPE = np.array([[0.3, 0.1, 0.0], [-0.2, 0.4, 0.1], [0.0, -0.5, 0.2], [0.1, 0.2, -0.6]])
"""Four nodes without symmetry."""


def turned(points, angle):
    """Points (..., 3) turned about y by angles (...)."""
    (x, y, z), c, s = np.moveaxis(points, -1, 0), np.cos(angle), np.sin(angle)
    return np.stack([c * x + s * z, y + 0.0 * c, c * z - s * x], axis=-1)


def rolled(position, *, begins=0.0) -> float:
    """Angle by which nodes at the positions (nodes, 3) of a time have rolled after 2 s, beside a
    fixed node."""
    nodes, step = np.zeros((TIMES.size, len(position(0.0)) + 1, NODE_COLUMNS)), 1e-5
    nodes[:, -1, P_WN] = 9.0
    for k, time in enumerate(TIMES):
        rates = (position(time + step) - position(time - step)) / (2.0 * step)
        nodes[k, :-1, P_WN : P_WN + 3], nodes[k, :-1, V_WN : V_WN + 3] = position(time), rates
    return tallied(TIMES, nodes=nodes, begins=begins).rolled.angle[0]


def test_a_rigid_body_that_rolls_on_has_rolled_by_its_angle():
    # Like a wheel of radius 0.4 m: whole turns count, and those before the steady stretch.
    for rate in (1.5, 9.0, -9.0):

        def wheel(time, rate=rate):
            return turned(SHAPE, rate * time) + np.array([5.0 + 0.4 * rate * time, -7.0, 0.4])

        assert rolled(wheel, begins=1.0) == pytest.approx(2.0 * rate, rel=1e-7)
    # At a rate that changes: 3 t² rad, by the trapezoidal rule.
    assert rolled(lambda time: turned(SHAPE, 3.0 * time**2)) == pytest.approx(12.0, rel=1e-7)


def test_what_turns_about_another_axis_has_not_rolled():
    def spun(time):
        return turned(SHAPE[:, [1, 2, 0]], 4.0 * time)[:, [2, 0, 1]]  # z is where y was

    assert np.abs(spun(1.0)[:, 2] - SHAPE[:, 2]).max() < 1e-12 < np.ptp(spun(1.0) - SHAPE)
    assert rolled(spun) == pytest.approx(0.0, abs=1e-7)
    line = np.outer([-1.0, 0.0, 2.0], [0.0, 0.3, 0.0])
    assert rolled(lambda time: line + np.array([time, 0.0, 0.0])) == 0.0


def test_a_line_of_nodes_rolls_across_its_direction():
    line = np.outer([-1.0, 0.0, 2.0], [0.3, 0.0, 0.1])
    assert rolled(lambda time: turned(line, 2.5 * time)) == pytest.approx(5.0, rel=1e-6)


def test_a_change_of_shape_is_no_rotation():
    # The nodes stretch and shear without rotation: v = A r with a symmetric A.
    stretch = np.array([[0.3, 0.2, -0.4], [0.2, -0.1, 0.1], [-0.4, 0.1, 0.2]])
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])

    def shears(time):
        return cube @ (np.eye(3) + 0.1 * time * stretch)

    assert rolled(shears) == pytest.approx(0.0, abs=1e-9)
    # Two bars that turn against each other, as struts of a robot that folds.
    bar = np.outer([-1.0, 1.0], [1.0, 0.0, 0.0])

    def folds(time):
        apart = np.array([0.0, 0.5, 0.0])
        return np.vstack([turned(bar, 0.5 * time) - apart, turned(bar, -0.5 * time) + apart])

    assert rolled(folds) == pytest.approx(0.0, abs=1e-9)
    # Bars that turn by different angles roll by their mean.
    assert rolled(lambda time: np.vstack([turned(bar, time), turned(bar, 3.0 * time)])) == (
        pytest.approx(4.0, rel=1e-6)
    )
