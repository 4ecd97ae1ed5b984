"""What `structure` prints, and the page that shows a robot at rest."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from tetra_drake.analysis.rest import RestStudy
from tetra_drake.engines.mujoco import make_mjcf
from tetra_drake.files import write_whole
from tetra_drake.formatting import Table, fixed
from tetra_drake.physics.contact import CONTACT, MODE_COLUMNS, NORMAL
from tetra_drake.results.trajectory import Motion, make_dataset
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.engine_kinds import Mujoco
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.structure_files import read_structure
from tetra_drake.scenario.units import INCH, POUND_FORCE
from tetra_drake.visualization.replay import save_replay

_FREQUENCIES = 5
"""Number of natural frequencies that are printed."""


_SURROUNDINGS = "prism"
"""The shipped scenario whose ground and friction a structure file gets."""


def robot_of_file(name_or_file: str, *, unit: str | None = None) -> Robot:
    """The robot of a structure file, or a file of NTRT with a `unit` of length, on flat ground with
    Coulomb friction. Raises InputError that names file and key."""
    structure = read_structure(name_or_file, unit=unit)
    name = Path(name_or_file).stem
    scenario = load_scenario(_SURROUNDINGS).with_sections(name=name, robot=structure)
    return Robot.of(scenario)


def save_mjcf(robot: Robot, path: Path) -> None:
    """Writes a robot as a model for MuJoCo; raises InputError if it cannot be written."""
    scenario = robot.scenario.with_sections(engine=Mujoco())
    write_whole(path, make_mjcf(dataclasses.replace(robot, scenario=scenario)))


def structure_text(study: RestStudy) -> str:
    """What a robot is, and how it rests: tables in g, in and lbf."""
    robot, statics = study.robot, study.statics
    structure = robot.structure
    lowest = ", ".join(f"{frequency:.3g}" for frequency in study.frequencies[:_FREQUENCIES])
    count = f"{len(structure.bodies)} bodies, {len(structure.node_names)} nodes"
    lines = [
        f"{robot.scenario.name}: {count}, {len(structure.cables)} cables, "
        f"{structure.signals} oscillators, {1e3 * structure.mass.sum():.4g} g",
        f"Without weight: self-stress states {len(statics.self_stresses)}, "
        f"infinitesimal mechanisms {statics.mechanisms}.",
        f"Lowest natural frequencies on the ground, undamped: {lowest or 'none'} Hz.",
        "At rest, without actuation:",
        _bodies_table(study).text(),
        _cables_table(study).text(),
    ]
    return "\n\n".join(lines)


def _bodies_table(study: RestStudy) -> Table:
    structure, rows = study.robot.structure, []
    for body, mass in zip(structure.bodies, structure.mass, strict=True):
        nodes = study.nodes[study.nodes["body"] == body]
        heights = f"{fixed(nodes['z'].min() / INCH)} to {fixed(nodes['z'].max() / INCH)}"
        load = fixed(nodes["load"].sum() / POUND_FORCE, 4)
        rows.append([body, f"{1e3 * mass:.4g}", heights, load])
    return Table(["body", "mass (g)", "heights of nodes (in)", "on the ground (lbf)"], rows)


def _cables_table(study: RestStudy) -> Table:
    rows = []
    for group, cables in study.cables.groupby("group", sort=False):
        length, tension = cables["length"] / INCH, cables["tension"] / POUND_FORCE
        lengths = f"{fixed(length.min())} to {fixed(length.max())}"
        tensions = f"{fixed(tension.min(), 3)} to {fixed(tension.max(), 3)}"
        free = fixed(cables["free_length"].mean() / INCH)
        rows.append([str(group), str(len(cables)), free, lengths, tensions])
    headings = ["cables", "number", "free length (in)", "length (in)", "tension (lbf)"]
    return Table(headings, rows)


def save_structure_page(study: RestStudy, path: Path) -> None:
    """Writes a page that shows the robot at rest; raises InputError if that cannot be written."""
    robot = study.robot
    loads = study.nodes["load"].to_numpy()[robot.structure.contacts]
    modes = np.zeros((2, len(loads), MODE_COLUMNS))
    modes[:, :, CONTACT] = loads > 0.0
    pushes = np.zeros((2, len(loads), 3))
    pushes[:, :, NORMAL] = loads
    motion = Motion(
        times=np.array([0.0, 1.0]),
        states=np.tile(robot.rest.state, (2, 1)),
        signals=np.zeros((2, robot.structure.signals)),
        modes=modes,
        pushes=pushes,
    )
    title = f"{robot.scenario.name} at rest"
    save_replay(path, robot=robot, trajectory=make_dataset(robot, motion), title=title)
