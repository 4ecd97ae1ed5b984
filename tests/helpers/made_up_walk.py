"""A walk made up for tests of figures and measures, of which everything is known."""

from typing import Any

import numpy as np
import xarray

from tetra_drake.laws.contact import CONTACT, MODE_COLUMNS
from tetra_drake.results.trajectory import Motion, make_dataset
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario

PERIOD = 2.0  # s
SPEED = 0.01  # m/s
HEIGHT = 0.02  # m, to which a tetrahedron is lifted
LOAD = 0.2  # N, on a contact node that stands


def make_row(bodies: int = 5, changes: dict[str, Any] | None = None) -> Robot:
    """A robot of so many tetrahedra."""
    scenario = load_scenario("thesis").with_changes({"robot.tetrahedra": bodies})
    return Robot.of(scenario.with_changes(changes or {}))


def make_walk(*, bodies: int = 5, duration: float = 9.0) -> xarray.Dataset:
    """Tetrahedra that move on at SPEED; T1, T3 ... are lifted in the first half of each PERIOD
    and T2, T4 ... in the second. The tip of the lead never touches the ground."""
    robot = make_row(bodies)
    structure = robot.structure
    times = np.linspace(0.0, duration, round(duration / 0.01) + 1)
    phase = 2.0 * np.pi * times / PERIOD
    turn = np.where(np.arange(bodies) % 2, -1.0, 1.0)
    lift = HEIGHT * np.maximum(0.0, np.round(np.sin(phase), 12)[:, np.newaxis] * turn)
    states = np.tile(structure.initial_state, (len(times), 1))
    poses = states[:, : 7 * bodies].reshape(-1, bodies, 7)
    poses[..., 4] += SPEED * times[:, np.newaxis]
    poses[..., 6] += lift
    states[:, : 7 * bodies] = poses.reshape(len(times), -1)

    names = np.array(structure.node_names)[structure.contacts]
    stands = (lift[:, structure.contacts // 4] == 0.0) & (names != f"T{bodies} tip")
    normal = np.where(stands, LOAD, 0.0)
    signals = 2.0 * np.sin(phase[:, np.newaxis] - np.arange(structure.signals))
    modes = np.zeros((*stands.shape, MODE_COLUMNS))
    modes[..., CONTACT] = stands
    drives = np.zeros((len(times), 0))
    ground_forces = np.stack([-0.5 * normal, 0.0 * normal, normal], axis=-1)
    walk = make_dataset(robot, Motion(times, states, signals, modes, drives, ground_forces))
    driver = structure.cables["signal"]
    walk.tension[:] = 3.0 + np.where(driver < 0, 0.0, signals[:, driver])
    return walk
