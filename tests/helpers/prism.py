"""The shipped prism before it rests, a robot that is no row of tetrahedra, and a motion of it."""

import dataclasses

import numpy as np
import xarray

from helpers.structures import SIDES_ALONE
from tetra_drake.laws.contact import MODE_COLUMNS
from tetra_drake.results.trajectory import Motion, make_dataset
from tetra_drake.robot.robot import Robot, make_model
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.structure_files import read_structure

SPEED = 0.01  # m/s
PERIOD = 2.0  # s, of the signals
RADII = (0.008, 0.005, 0.008, 0.005, 0.008, 0.005)
"""Radii (m) of the nodes; upper ones are smaller."""


def make_prism() -> Robot:
    """The prism on flat ground, 0.2 m wide and 0.16 m high, driven at its sides."""
    tree = read_structure("prism").model_dump() | {"actuated": SIDES_ALONE}
    # Spheres without mass, so that the middle of a bar is its centre of mass.
    spheres = {"node_radius": np.array(RADII), "node_density": np.full(6, 1e-9)}
    blueprint = dataclasses.replace(StructureFile.model_validate(tree).blueprint(), **spheres)
    scenario, structure = load_scenario("coulomb"), Structure.of(blueprint)
    return Robot(scenario, structure, make_model(scenario, structure), np.zeros(3))


def slide_prism(robot: Robot, *, duration: float = 8.0) -> xarray.Dataset:
    """The prism as it stands at the start, carried along x at SPEED, with signals of 1 N."""
    times = np.linspace(0.0, duration, round(duration / 0.02) + 1)
    states = np.tile(robot.structure.initial_state, (len(times), 1))
    states[:, [4, 11, 18]] += SPEED * times[:, np.newaxis]
    signals = np.sin(2.0 * np.pi / PERIOD * times[:, np.newaxis] - np.arange(3))
    modes = np.zeros((len(times), 6, MODE_COLUMNS))
    drives = np.zeros((len(times), 0))
    ground_forces = np.zeros((len(times), 6, 3))
    ground_forces[..., 2] = [0.2, 0.0, 0.2, 0.0, 0.2, 0.0]
    return make_dataset(robot, Motion(times, states, signals, modes, drives, ground_forces))
