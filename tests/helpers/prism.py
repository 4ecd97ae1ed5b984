"""A prism of three bars that nine cables tie together, built by hand: no row of tetrahedra."""

import dataclasses

import numpy as np
import xarray

from tetra_drake.physics.cable import PASSIVE
from tetra_drake.physics.contact import MODE_COLUMNS
from tetra_drake.results.trajectory import Motion, make_dataset
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile

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


BAR = {"diameter": 0.008, "density": 1200.0, "node_diameter": 0.0, "contact_radius": 0.0}
CABLE = {"stiffness": 100.0, "damping": 0.5, "free_length": 0.1}


def make_prism() -> Robot:
    """The prism on flat ground, 0.2 m wide and 0.16 m high, with twisted ends."""
    lower, upper = np.radians([0.0, 120.0, 240.0]), np.radians([150.0, 270.0, 30.0])
    p_WN = np.zeros((6, 3))
    p_WN[::2, :2] = 0.1 * np.column_stack([np.cos(lower), np.sin(lower)])
    p_WN[1::2, :2] = 0.1 * np.column_stack([np.cos(upper), np.sin(upper)])
    p_WN[1::2, 2] = 0.16
    kind = StructureFile.model_validate(
        {
            "nodes": dict(zip(NODES, p_WN.tolist(), strict=True)),
            "struts": {"bar": BAR | {"pairs": [NODES[:2], NODES[2:4], NODES[4:]]}},
            "cables": {
                group: CABLE | {"pairs": [name.split()[1:] for name in CABLES if group in name]}
                for group in ("bottom", "top", "side")
            },
            "actuated": {
                oscillator: [name for name, driver in CABLES.items() if driver == number]
                for number, oscillator in enumerate(OSCILLATORS)
            },
        }
    )
    # Spheres without mass, so that the middle of a bar is its centre of mass.
    spheres = {"node_radius": np.array(RADII), "node_density": np.full(6, 1e-9)}
    blueprint = dataclasses.replace(kind.blueprint(), **spheres)
    return Robot.of(load_scenario("coulomb"), Structure.of(blueprint))


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
