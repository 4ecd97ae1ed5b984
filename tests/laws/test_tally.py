"""The tally of a walk: work, signals, lifted bodies, tension and rolling of hand-made motions."""

import itertools
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
    assert tally.least_tension[0] == -1.0
    assert tallied(times, lengths=lengths, begins=2.0).effort.work[0] == 3.0
    # What is seen twice counts once: a step that was rejected.
    twice = np.repeat(np.arange(6), 2)
    assert tallied(times[twice], lengths=lengths[twice]).effort.work[0] == 5.0


def test_a_body_is_lifted_while_none_of_its_contacts_bears():
    loads = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 1, 1], [0, 0, 0.5], [0, 0, 0]])
    times = np.array([0.0, 1.0, 3.0, 6.0, 10.0, 15.0])  # a step is as its end
    tally = tallied(times, loads=loads)
    assert tally.lifted.tolist() == [3.0 - 1.0 + 10.0 - 6.0 + 5.0, 1.0 + 2.0 + 5.0]


EFFORT = {
    "times": np.array([0.0, 1.0, 3.0, 4.0]),
    "tensions": np.array([[9.0, 50.0], [2.0, 50.0], [3.0, 50.0], [4.0, 50.0]]),
}
"""Three steps; the tension of the cable that is not driven is 50 N."""

WOUND = np.array([1.0, 0.9, 0.5, 0.7])
"""0.1 m in 1 s, 0.4 m in 2 s, then 0.2 m paid out."""

PEAKS = [4.0, 0.2, 3.0 * 0.2]
"""Of force (N), speed (m/s) and power (W) of an actuator, without the 9 N of the first instant."""

SUMS = [1 * 2.0 + 2 * 3.0 + 1 * 4.0, 0.1 + 0.4 + 0.2, 2.0 * 0.1 + 3.0 * 0.4]
"""Of force by time (N s), of lengths wound (m), and of the work on them (J), without what is paid
out."""


def effort_of(tally: Tally) -> list[float]:
    """Peaks, sums, and the time at a limit."""
    names = ["peak_force", "peak_speed", "peak_power", "impulse", "wound", "pulled", "limited"]
    return [getattr(tally.effort, name)[0] for name in names]


@pytest.mark.parametrize("kind", [DIRECT, TENSION_MOTOR])
def test_actuators_without_a_winch_wind_what_their_cables_shorten(kind):
    drives = np.zeros((4, int(kind != DIRECT), DRIVE_COLUMNS))
    tally = tallied(lengths=WOUND, kind=kind, drives=drives, **EFFORT)
    assert effort_of(tally) == pytest.approx([*PEAKS, *SUMS, 0.0])


def test_winches_wind_their_free_length_and_are_limited_for_a_time():
    drives = np.zeros((4, 1, DRIVE_COLUMNS))
    drives[:, 0, DRIVE], drives[:, 0, LIMITED] = WOUND, [1.0, 0.0, 1.0, 1.0]
    tally = tallied(lengths=np.linspace(1.0, 9.0, 4), kind=WINCH, drives=drives, **EFFORT)
    assert effort_of(tally) == pytest.approx([*PEAKS, *SUMS, 2.0 + 1.0])
    assert tally.effort.work[0] == pytest.approx(1.4), "of the tension"


def test_nothing_counts_before_the_steady_stretch():
    tally = tallied(lengths=WOUND, begins=3.0, **EFFORT)
    # The last step, in which 0.2 m are paid out at 4 N.
    assert effort_of(tally) == pytest.approx([4.0, 0.2, 0.0, 4.0, 0.2, 0.0, 0.0])
    # Neither does a force that jumps as the stretch begins: at once, and for less than 1 ms.
    jump = {"times": np.array([0.0, 3.0, 3.0, 3.0009, 4.0])}
    jump |= {"tensions": np.array([[5.0, 0.0], [5.0, 0.0], [99.0, 0.0], [50.0, 0.0], [6.0, 0.0]])}
    jump |= {"lengths": np.array([1.0, 1.0, 1.0, 0.9, 0.8])}
    speed = 0.1 / 0.9991
    peaks = effort_of(tallied(begins=3.0, **jump))[:3]
    assert peaks == pytest.approx([6.0, speed, 6.0 * speed])


@pytest.mark.parametrize(
    ("lengths", "peaks"),
    [(WOUND[::-1], [4.0, 0.2, 0.4]), (np.array([0.0, 0.1, 0.2, 0.9]), [4.0, 0.7, 0.0])],
)
def test_a_peak_of_speed_counts_in_either_direction(lengths, peaks):
    assert effort_of(tallied(lengths=lengths, **EFFORT))[:3] == pytest.approx(peaks)


TIMES = np.linspace(0.0, 2.0, 401)

SHAPE = np.array([[0.3, 0.1, 0.0], [-0.2, 0.4, 0.1], [0.0, -0.5, 0.2], [0.1, 0.2, -0.6]])
"""Four nodes without symmetry."""


def turned(points, angle):
    """Points (..., 3) turned about y by angles (...)."""
    (x, y, z), c, s = np.moveaxis(points, -1, 0), np.cos(angle), np.sin(angle)
    return np.stack([c * x + s * z, y + 0.0 * c, c * z - s * x], axis=-1)


def wheel(rate):
    """A wheel of radius 0.4 m that rolls at a rate (rad/s)."""
    return lambda time: turned(SHAPE, rate * time) + np.array([5.0 + 0.4 * rate * time, -7.0, 0.4])


def bars(rate, other, apart=0.0):
    """Two bars along x that turn at rates (rad/s), at `apart` (m) on either side along y."""
    bar, beside = np.outer([-1.0, 1.0], [1.0, 0.0, 0.0]), np.array([0.0, apart, 0.0])
    return lambda time: np.vstack(
        [turned(bar, rate * time) - beside, turned(bar, other * time) + beside]
    )


LINE = np.array([-1.0, 0.0, 2.0])
STRETCH = 0.1 * np.array([[0.3, 0.2, -0.4], [0.2, -0.1, 0.1], [-0.4, 0.1, 0.2]])
"""The nodes of a cube stretch and shear without rotation: v = A r with a symmetric A."""
CUBE = np.array(list(itertools.product((-1, 1), repeat=3)))


@pytest.mark.parametrize(
    ("position", "angle"),
    [
        # Whole turns count, and those before the steady stretch.
        *((wheel(rate), 2.0 * rate) for rate in (1.5, 9.0, -9.0)),
        (lambda time: turned(SHAPE, 3.0 * time**2), 12.0),  # a rate that changes
        (lambda time: turned(SHAPE[:, [1, 2, 0]], 4.0 * time)[:, [2, 0, 1]], 0.0),  # about z
        (lambda time: np.outer(LINE, [0.0, 0.3, 0.0]) + np.array([time, 0.0, 0.0]), 0.0),
        (lambda time: turned(np.outer(LINE, [0.3, 0.0, 0.1]), 2.5 * time), 5.0),  # a line of nodes
        (lambda time: CUBE @ (np.eye(3) + time * STRETCH), 0.0),
        (bars(0.5, -0.5, apart=0.5), 0.0),  # as struts of a robot that folds
        (bars(1.0, 3.0), 4.0),  # by their mean
    ],
)
def test_a_robot_has_rolled_by_the_rotation_of_the_whole_about_y(position, angle):
    # In 2 s, beside a fixed node.
    nodes, step = np.zeros((TIMES.size, len(position(0.0)) + 1, NODE_COLUMNS)), 1e-5
    nodes[:, -1, P_WN] = 9.0
    for k, time in enumerate(TIMES):
        rates = (position(time + step) - position(time - step)) / (2.0 * step)
        nodes[k, :-1, P_WN : P_WN + 3], nodes[k, :-1, V_WN : V_WN + 3] = position(time), rates
    tally = tallied(TIMES, nodes=nodes, begins=1.0)
    assert tally.rolled[0] == pytest.approx(angle, rel=1e-6, abs=1e-7)
