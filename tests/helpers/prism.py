"""A prism of three bars that nine cables tie together, built by hand: no row of tetrahedra."""

import numpy as np
import xarray

from tetra_drake.physics.cable import CABLE, PASSIVE
from tetra_drake.physics.contact import MODE_COLUMNS
from tetra_drake.results.trajectory import Motion, make_dataset
from tetra_drake.robot.actuation import Actuation
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.layout import Layout
from tetra_drake.scenario.load import load_scenario

SPEED = 0.01  # m/s
PERIOD = 2.0  # s, of the signals
RADII = (0.008, 0.005, 0.008, 0.005, 0.008, 0.005)
"""Of the nodes, in m; upper ones are smaller."""

OSCILLATORS = ("first", "second", "third")
NODES = ("n0", "n4", "n1", "n5", "n2", "n3")
"""n0 to n2 are below; a bar has two neighbouring nodes."""

CABLES = {
    "bottom n0 n1": PASSIVE,
    "top n4 n5": PASSIVE,
    "side n4 n1": 0,
    "bottom n0 n2": PASSIVE,
    "top n4 n3": PASSIVE,
    "side n0 n3": 1,
    "bottom n1 n2": PASSIVE,
    "top n5 n3": PASSIVE,
    "side n5 n2": 2,
}
"""The oscillator that drives each cable, pair by pair of bars."""


def make_prism() -> Robot:
    """The prism on flat ground, 0.2 m wide and 0.16 m high, with twisted ends."""
    lower, upper = np.radians([0.0, 120.0, 240.0]), np.radians([150.0, 270.0, 30.0])
    p_WN = np.zeros((6, 3))
    p_WN[::2, :2] = 0.1 * np.column_stack([np.cos(lower), np.sin(lower)])
    p_WN[1::2, :2] = 0.1 * np.column_stack([np.cos(upper), np.sin(upper)])
    p_WN[1::2, 2] = 0.16
    p_WB = (p_WN[::2] + p_WN[1::2]) / 2
    rows, groups = [], []
    for name, driver in CABLES.items():
        group, a, b = name.split()
        rows.append((NODES.index(a), NODES.index(b), driver, 100.0, 0.5, 0.1))
        groups.append(group)
    ends = np.array([row[:2] for row in rows])
    layout = Layout(
        cable_names=tuple(CABLES),
        ends=p_WN[ends],
        bodies=ends // 2,
        oscillators=OSCILLATORS,
        groups=tuple((list(CABLES.values()).index(k),) for k in range(3)),
    )
    structure = Structure(
        bodies=("n0 n4", "n1 n5", "n2 n3"),
        node_names=NODES,
        first_node=np.array([0, 2, 4, 6]),
        p_BN=p_WN - np.repeat(p_WB, 2, axis=0),
        struts=np.array([[0, 1], [2, 3], [4, 5]]),
        strut_radius=np.full(3, 0.004),
        node_radius=np.array(RADII),
        mass=np.full(3, 0.02),
        unit_inertia=np.tile([0.004, 0.004, 0.004, 0.0, 0.0, 0.0], (3, 1)),
        p_WB=p_WB,
        q_WB=np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)),
        cables=np.array(rows, dtype=CABLE),
        cable_groups=tuple(groups),
        actuation=Actuation(layout, reach=None),
        contacts=np.arange(6),
        markers=np.zeros(0, dtype=int),
    )
    return Robot.of(load_scenario("coulomb"), structure)


def slide_prism(robot: Robot, *, duration: float = 8.0) -> xarray.Dataset:
    """The prism as it stands at the start, carried along x at SPEED, with signals of 1 N."""
    times = np.linspace(0.0, duration, round(duration / 0.02) + 1)
    states = np.tile(robot.structure.initial_state, (len(times), 1))
    states[:, [4, 11, 18]] += SPEED * times[:, np.newaxis]
    signals = np.sin(2.0 * np.pi / PERIOD * times[:, np.newaxis] - np.arange(3))
    modes = np.zeros((len(times), 6, MODE_COLUMNS))
    drives = np.zeros((len(times), 0))
    weights = np.array([0.2, 0.0, 0.2, 0.0, 0.2, 0.0])
    ground_forces = np.zeros((len(times), 6, 3))
    ground_forces[..., 2] = weights
    return make_dataset(robot, Motion(times, states, signals, modes, drives, ground_forces))
