"""Structures in motion, and the independent simulation's in tests/data/structures.json."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

from tetra_drake.engines.engine import engine_of
from tetra_drake.engines.lanes.batch import LaneBatch
from tetra_drake.results.result import SimulationResult
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.structure_files import read_structure
from tetra_drake.systems.diagram import MakeTensegrityDiagram


def thrown(robot: Robot, v_WB: np.ndarray) -> Robot:
    """The robot whose bodies move at t = 0, with angular velocities (rad/s) and velocities (m/s)
    (bodies, 6)."""
    return dataclasses.replace(robot, structure=dataclasses.replace(robot.structure, v_WB=v_WB))


def motion_of(robot: Robot, *, seed: int = 0) -> xarray.Dataset:
    """The trajectory of a robot that walks by a seeded gait on the engine of its scenario."""
    walk = DrivenRobot.of(robot, seeded_gait(robot.scenario, seed))
    return engine_of(robot.scenario).simulate(walk, record=True).trajectory


def simulated(robot: Robot, *, seed: int = 1) -> tuple[SimulationResult, Motion]:
    """Result and motion of a robot that walks by a seeded gait on the compiled engine."""
    walk = DrivenRobot.of(robot, seeded_gait(robot.scenario, seed))
    batch = LaneBatch(walk, record=True)
    batch.advance()
    return batch.result(0), batch.motion(0)


def end_on_diagram(robot: Robot) -> np.ndarray:
    """Poses (bodies, 7) at the end of a simulation on the diagram, with small errors. The robot may
    be thrown."""
    diagram = MakeTensegrityDiagram(robot, seeded_gait(robot.scenario))
    simulator = Simulator(diagram)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 1e-3).set_target_accuracy(1e-9)
    simulator.get_mutable_context().SetContinuousState(robot.structure.initial_state)
    simulator.AdvanceTo(robot.scenario.simulation.duration)
    state = diagram.GetOutputPort("state").Eval(simulator.get_context())
    return poses_of(state[np.newaxis])[0]


def poses_of(states: np.ndarray) -> np.ndarray:
    """Quaternions and positions (times, bodies, 7) in states (times, 13 bodies)."""
    bodies = states.shape[1] // 13
    return states[:, : 7 * bodies].reshape(-1, bodies, 7)


def unit_inertias(structure: Structure) -> np.ndarray:
    """Inertias divided by the masses (m²), in the frames of the bodies: (bodies, 3, 3)."""
    xx, yy, zz, xy, xz, yz = structure.unit_inertia.T
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)


SIDES_ALONE = {"first": ["side n0 n3"], "second": ["side n1 n4"], "third": ["side n2 n5"]}
"""`actuated` of a prism whose bottom cables are passive."""


def driven_as_recorded(name: str) -> StructureFile:
    """A shipped structure whose ends are points, driven at the cables where the independent
    simulation pulls."""
    tree = read_structure(name).model_dump()
    for group in tree["struts"].values():
        group["contact_radius"] = 0.0
    if name == "prism":
        tree["actuated"] = SIDES_ALONE
    return StructureFile.model_validate(tree)


def recorded_structure(data: Path, name: str) -> dict[str, Any]:
    """A structure of the independent simulation; its nodes are those of the shipped structure."""
    recorded = json.loads((data / "structures.json").read_text())["structures"]
    structure: dict[str, Any] = recorded[name.replace("_", "-")]
    return structure
