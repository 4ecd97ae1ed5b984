"""Robot in equilibrium on flat ground without actuation: statics, tensions, node positions,
natural frequencies."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas
from scipy import linalg

from tetra_drake.errors import InputError
from tetra_drake.formatting import TextTable, fixed, listed, render, rounded, sentence
from tetra_drake.lab.bridges.formats import format_of
from tetra_drake.lab.differences import derivatives
from tetra_drake.lab.study.statics import Statics, find_statics
from tetra_drake.laws.actuator import Force
from tetra_drake.laws.cable import TENSION
from tetra_drake.laws.capsules import NoStrutContact
from tetra_drake.laws.contact import CONTACT, MODE_COLUMNS, NORMAL
from tetra_drake.laws.kinematics import FORCE
from tetra_drake.laws.terrain import Flat, Nothing
from tetra_drake.on_demand import loaded
from tetra_drake.results.trajectory import Motion, make_dataset
from tetra_drake.robot.equilibrium import (
    Unactuated,
    displace,
    force_at_rest,
    free_motions,
    mass_matrix,
    stiffness_at_rest,
)
from tetra_drake.robot.ground import START_DEPTH
from tetra_drake.robot.remarks import BEARS, overload_remark, sinking_remark, yielding_remark
from tetra_drake.robot.robot import Robot, equilibrium_of
from tetra_drake.robot.settling import axial_forces, elastic_struts, elongated
from tetra_drake.robot.structure import Structure, node_motions, node_positions
from tetra_drake.robot.struts import MEETING, overlaps
from tetra_drake.scenario.engine_kinds import Mujoco
from tetra_drake.scenario.load import GivenScenario, given_scenario, load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.shipped import shipped_scenarios, structure_names
from tetra_drake.scenario.structure_files import read_structure
from tetra_drake.settings.refusals import no_such
from tetra_drake.visualization.replay import FRAMES_PER_SECOND, Replay

_LARGE = 50
"""Number of bodies from which modes are not computed."""
_FREQUENCIES = 5
"""Number of natural frequencies that are printed."""
_SWING, _AMPLITUDE = 75, 0.12
"""Number of frames of a mode on the page; greatest displacement of a node, as a share of the size
of the robot."""
_NOISE = 1e-9
"""Forces of anchors, and negative squares of frequencies, up to this share of the greatest are
rounding errors."""

_ELONGATION = 1e-6
"""Elongation of a strut for finite differences, as a share of its length."""

_SURROUNDINGS = "prism"
"""Shipped scenario with the ground and friction for structure files."""


@dataclass(frozen=True)
class EquilibriumStudy:
    """Results of study_equilibrium(): statics, nodes, cables, natural frequencies and mode shapes
    of a robot at rest without actuation; SI units."""

    robot: Robot
    nodes: pandas.DataFrame
    """A row per node, by its name: body, x, y, z, load (normal force of the ground), and the force
    of its anchor on the structure, anchor_x, anchor_y, anchor_z."""
    cables: pandas.DataFrame
    """A row per cable, by its name: group, length, free_length, tension, force_density (tension per
    length)."""

    @functools.cached_property
    def statics(self) -> Statics:
        """Statics of the robot without weight and loads, away from the ground. Raises InputError if
        it has no equilibrium there."""
        scenario, structure = self.robot.scenario, self.robot.structure
        nowhere, no_load = np.array([], dtype=np.int64), np.zeros_like(structure.node_load)
        lifted = dataclasses.replace(structure, contacts=nowhere, node_load=no_load)
        weightless = scenario.with_numbers({"robot.gravity": 0.0})
        alone = equilibrium_of(weightless, lifted, self.robot.equilibrium.state)
        return find_statics(structure, node_positions(lifted, alone.state))

    @functools.cached_property
    def frequencies(self) -> np.ndarray:
        """Natural frequencies without damping (modes,) in Hz, ascending. Feet slide freely. Raises
        InputError if a motion grows in place of swinging."""
        stiffness, mass, count = _vibration(self.robot, Unactuated(self.robot.model))
        squares = linalg.eigvalsh(stiffness, mass)
        if squares.min(initial=0.0) < -_NOISE * np.abs(squares).max(initial=0.0):
            problem = f"its rest is not stable: a motion grows by {math.sqrt(-squares[0]):.3g} 1/s"
            raise InputError(self.robot.scenario.name, "robot", problem)
        return np.asarray(np.sqrt(np.maximum(squares[:count], 0.0)) / (2.0 * math.pi))

    @functools.cached_property
    def modes(self) -> np.ndarray:
        """Mode shapes (frequencies, nodes, 3): displacements of the nodes in the world frame,
        scaled so that the node that moves farthest moves by 1. Order as in `frequencies`."""
        return self._modes[0]

    @functools.cached_property
    def _modes(self) -> tuple[np.ndarray, np.ndarray]:
        """Mode shapes, and the motions of the bodies (frequencies, bodies, 6) that make them: a
        rotation vector, then a translation, in the world frame."""
        structure, unactuated = self.robot.structure, Unactuated(self.robot.model)
        stiffness, mass, count = _vibration(self.robot, unactuated)
        motions = linalg.eigh(stiffness, mass)[1][:, :count]
        by_body = motions.reshape(len(structure.bodies), 6, -1)
        by_body[:, :3] /= unactuated.radius
        of_bodies = by_body.transpose(2, 0, 1)
        modes = node_motions(structure, self.robot.equilibrium.state, of_bodies)
        farthest = np.linalg.norm(modes, axis=2).max(axis=1)[:, np.newaxis, np.newaxis]
        return modes / farthest, of_bodies / farthest

    @functools.cached_property
    def damped(self) -> Any:
        """Modes with damping, as DampedModes. Nodes on the ground stick by their friction; see
        linearize()."""
        linearize = loaded("tetra_drake.lab.linearization.linearization:linearize")
        return linearize(self.robot, self.robot.equilibrium.state).modes()


def study_equilibrium(given: Robot | GivenScenario) -> EquilibriumStudy:
    """Statics, node positions, tensions and natural frequencies of a robot in equilibrium.

        >>> study = td.study_equilibrium("prism")
        >>> study.frequencies.round(1)[:3]
        array([12.9, 12.9, 17.4])
        >>> tensions, heights = study.cables.tension, study.nodes.z

    Args:
        given: a scenario, its name or file, or a run; a structure file (see robot_of_structure());
            or a robot.

    Raises:
        InputError: if the robot has no equilibrium.
    """
    is_file = isinstance(given, (str, Path)) and os.path.isfile(given)
    if isinstance(given, Robot):
        robot = given
    elif is_file and format_of(str(given)) != "scenario":
        robot = robot_of_structure(read_structure(str(given)), str(given))
    else:
        robot = Robot.of(given_scenario(given))
    structure, equilibrium = robot.structure, robot.equilibrium
    unactuated, p_WN = Unactuated(robot.model), node_positions(structure, equilibrium.state)
    force_at_rest(unactuated, equilibrium.state)
    nodes = pandas.DataFrame(p_WN, list(structure.node_names), ["x", "y", "z"])
    nodes.insert(0, "body", structure.body_of_node)
    nodes["load"] = 0.0
    nodes.iloc[structure.contacts, -1] = unactuated.forces.ground_forces[:, NORMAL]
    fixed, anchors, forces = structure.first_node[-1], structure.anchors, np.zeros_like(p_WN)
    forces[fixed:] = -unactuated.forces.nodes[fixed : len(p_WN), FORCE : FORCE + 3]
    forces[anchors.nodes] = anchors.stiffness * (anchors.places - p_WN[anchors.nodes])
    nodes[[f"anchor_{axis}" for axis in "xyz"]] = forces
    cables = {
        "group": structure.cable_groups,
        "length": equilibrium.lengths,
        "free_length": structure.cables["free_length"],
        "tension": unactuated.forces.cable_forces[:, TENSION],
        "force_density": unactuated.forces.cable_forces[:, TENSION] / equilibrium.lengths,
    }
    table = pandas.DataFrame(cables, index=list(structure.cable_names))
    return EquilibriumStudy(robot=robot, nodes=nodes, cables=table)


def _vibration(robot: Robot, unactuated: Unactuated) -> tuple[np.ndarray, np.ndarray, int]:
    """Stiffness matrix K and mass matrix M of small motions M x'' = -K x about the equilibrium,
    without damping. x has six coordinates per body in m, in the world frame: a rotation vector
    times `unactuated.radius`, then a translation. Motions that no force resists are the fastest
    ones here. Returns K, M, and the number of the others. The forces of `unactuated` are
    overwritten."""
    state = robot.equilibrium.state
    force_at_rest(unactuated, state)
    rigid = stiffness_at_rest(unactuated).toarray()
    free, mass = free_motions(unactuated, state), mass_matrix(unactuated)
    stiffness, momenta = _condensed(rigid, robot.structure, unactuated, state), mass @ free
    above = 2.0 * np.trace(np.linalg.solve(mass, stiffness))  # twice the sum of all squares
    lift = above * momenta @ np.linalg.solve(free.T @ momenta, momenta.T)
    return stiffness + lift, mass, len(mass) - free.shape[1]


def robot_of_file(name_or_file: str, *, unit: str | None = None) -> Robot:
    """Robot of a structure file or of a scenario, on flat ground, so that MuJoCo can simulate it:
    each actuator is an ideal force. For a structure see robot_of_structure(); `unit` is the unit of
    its bare coordinates. Raises InputError that names file and key.
    """
    known = [*dict.fromkeys([*structure_names(), *shipped_scenarios()])]
    if name_or_file not in known and not os.path.exists(name_or_file):
        problem = no_such("structure or scenario", name_or_file, known)
        raise InputError(name_or_file, "", problem)
    if format_of(name_or_file) != "scenario":
        return robot_of_structure(read_structure(name_or_file, unit=unit), name_or_file)
    given = load_scenario(name_or_file)
    ground = Flat() if given.terrain.is_ground else given.terrain
    given = given.with_sections(terrain=ground, actuation=Force())
    return _at_rest(given, name_or_file)


def robot_of_structure(structure: StructureFile, source: str) -> Robot:
    """Robot of a structure on flat ground, under Coulomb friction.

    It stands on the ground of the scenario `prism`, or on a stiffer one if it is too heavy for it.
    Without weight it floats, and there is no ground. Struts may overlap in the file, as they do in
    some of NTRT's; in equilibrium they touch. If the axes of two struts meet, as in plane models,
    all struts pass through each other. Raises InputError that names `source`, the file, and key.
    """
    name = Path(source).stem
    given = load_scenario(_SURROUNDINGS).with_sections(name=name, robot=structure)
    if not structure.gravity:  # else rounding decides which nodes touch the ground
        given = given.with_sections(terrain=Nothing())
    placed = Structure.of(structure.blueprint())
    crossing = overlaps(given, placed, placed.initial_state).values()
    if any(distance <= MEETING for _, distance in crossing):
        given = given.with_sections(strut_contact=NoStrutContact())
    robot = _at_rest(given, source, within="robot.")
    p_WN = node_positions(robot.structure, robot.structure.initial_state)
    # With this stiffness, a single node bears the weight.
    least = robot.weight / (BEARS * float(np.ptp(p_WN, axis=0).max()))
    if least <= given.ground.stiffness:
        return robot
    damping = given.ground.damping * least / given.ground.stiffness
    firm = {"ground.stiffness": least, "ground.damping": damping}
    return _at_rest(given.with_numbers(firm), source, within="robot.")


def _at_rest(given: Scenario, source: str, *, within: str = "") -> Robot:
    """Robot of a scenario, at its equilibrium, without what MuJoCo lacks. Errors name `source`, and
    the key `within` a section."""
    friction = given.friction.without_bristles()
    try:
        return Robot.of(given.with_sections(friction=friction, engine=Mujoco()), at_rest=True)
    except InputError as error:
        raise InputError(source, error.key.removeprefix(within), error.problem) from error


def structure_text(study: EquilibriumStudy) -> str:
    """Text for the terminal about a robot and its equilibrium, with tables. Masses are in g,
    lengths and forces in the units of the robot's scenario."""
    robot, structure, units = study.robot, study.robot.structure, study.robot.scenario.units
    length, force = units.length_name, units.force_name
    rows, height = [], functools.partial(fixed, digits=units.decimals + 1)
    for body, mass in zip(structure.bodies, structure.mass, strict=True):
        nodes = study.nodes[study.nodes["body"] == body]
        load = rounded(nodes["load"].sum() / units.force)
        heights = _range(nodes["z"] / units.length, height)
        rows.append([body, rounded(1e3 * mass, 4), heights, load])
    headings = ["body", "mass (g)", f"heights of nodes ({length})", f"load on the ground ({force})"]
    tables = [TextTable(headings, rows)]
    rows = []
    for group, cables in study.cables.groupby("group", sort=False):
        lengths = (_range(cables[name] / units.length) for name in ("free_length", "length"))
        tension = _range(cables["tension"] / units.force)
        rows.append([str(group), str(len(cables)), *lengths, tension])
    names = [f"free length ({length})", f"length ({length})", f"tension ({force})"]
    tables.append(TextTable(["cables", "number", *names], rows))
    forces = study.nodes.loc[structure.held.any(axis=1), "anchor_x":"anchor_z"]
    forces = forces.where(forces.abs() > _NOISE * forces.abs().to_numpy().max(initial=0.0), 0.0)
    rows = [[str(node), *map(rounded, row / units.force)] for node, row in forces.iterrows()]
    names = [f"force along {axis} ({force})" for axis in "xyz"]
    tables.append(TextTable(["anchor", *names], rows))
    modes = None
    if len(structure.bodies) < _LARGE:
        lowest_damped = enumerate(zip(*study.damped[:2], strict=True), start=1)
        rows = [[str(i), rounded(hertz), fixed(ratio, 4)] for i, (hertz, ratio) in lowest_damped]
        modes = TextTable(["mode", "frequency (Hz)", "damping ratio"], rows[:_FREQUENCIES])
    stiffness = units.shown(robot.scenario.ground.stiffness, "N/m")
    return render(
        "lab/study/structure.txt.jinja",
        study=study,
        mass=1e3 * structure.mass.sum(),
        lowest=study.frequencies[:_FREQUENCIES].tolist(),
        ground=stiffness if structure.contacts.size else "",
        tables=tables,
        modes=modes,
        faults=_faults(study),
    )


def _faults(study: EquilibriumStudy) -> list[str]:
    """Warnings about a robot at rest: that it starts otherwise, what gives way, such as its ground,
    nodes below ground that cannot touch it, and struts that overlap."""
    robot, structure, units = study.robot, study.robot.structure, study.robot.scenario.units
    allowed = START_DEPTH * structure.scale + robot.weight / robot.scenario.ground.stiffness
    remarks = [sinking_remark(robot), yielding_remark(robot)]
    remarks.append(overload_remark(robot, study.cables["tension"].to_numpy()))
    lines = ["Its `start` is not at rest."] if structure.start else []
    if structure.rubbing:
        lines.append("Friction at rings and in joints is left out: it holds robots near this pose.")
    lines += [sentence(told) for told in remarks if told]
    low = study.nodes["z"][study.nodes["z"] < -allowed]
    if structure.contacts.size and len(low):
        depths = [f"{node} ({units.shown(-z, 'm')})" for node, z in low.items()]
        lines.append(f"Below the ground, which does not touch them: {listed(depths)}.")
    through = overlaps(robot.scenario, structure, robot.equilibrium.state)
    if through:
        pairs = [f"{a} | {b} ({units.shown(depth, 'm')})" for (a, b), (depth, _) in through.items()]
        lines.append(f"Struts that pass through each other: {listed(pairs)}.")
    return lines


def _range(values: pandas.Series, write: Callable[[float], str] = rounded) -> str:
    low, high = write(values.min()), write(values.max())
    return low if low == high else f"{low} to {high}"


def save_structure_page(study: EquilibriumStudy, path: Path, *, mode: int | None = None) -> None:
    """Writes an HTML page that shows the robot in equilibrium in 3D, the text of structure_text(),
    and the lowest modes, one after the other, slowed down and enlarged.

    Args:
        study: the robot at rest.
        path: the file to write.
        mode: number of a mode with damping, from 1 on, in place of the modes without damping. It is
            shown without its decay.

    Raises:
        InputError: if the file cannot be written, or there is no such mode.
    """
    robot = study.robot
    title, frequencies, motions = _shown_modes(study, mode)
    states = _swinging(study, motions)
    loads = study.nodes["load"].to_numpy()[robot.structure.contacts]
    modes = np.zeros((len(states), len(loads), MODE_COLUMNS))
    modes[:, :, CONTACT] = loads > 0.0
    motion = Motion(
        times=np.arange(len(states)) / FRAMES_PER_SECOND,
        states=states,
        signals=np.zeros((len(states), robot.structure.signals)),
        modes=modes,
        drives=np.tile(robot.starting_drives(), (len(states), 1)),
    )
    trajectory = make_dataset(robot, motion)
    for name in ("tension", "normal_force", "friction_force"):  # not of the enlarged motion
        trajectory[name][:] = trajectory[name].values[-1]
    frames = frequencies.repeat(_SWING)
    shown = {"what": "mode at", "unit": " Hz", "digits": 2, "values": [*frames, *frames[-1:]]}
    progress = shown if frames.size else None
    Replay(robot, trajectory, title, progress, text=structure_text(study)).save(path)


def _shown_modes(study: EquilibriumStudy, mode: int | None) -> tuple[str, np.ndarray, np.ndarray]:
    """Title of the page, frequencies (Hz) of the modes to show, and the motions (modes, bodies, 6)
    of the bodies: the mode with damping of number `mode`, complex, or the lowest ones without
    damping. Finding the latter takes long for many bodies; then there are none."""
    name = study.robot.scenario.name
    if mode is None:
        if len(study.robot.structure.bodies) >= _LARGE:
            return f"{name} at rest", np.zeros(0), np.zeros((0, 1, 6))
        lowest = study.frequencies[:_FREQUENCIES], study._modes[1][:_FREQUENCIES]
        return f"{name} at rest", *lowest
    damped = study.damped
    if not 1 <= mode <= (count := len(damped.frequencies)):
        raise InputError(name, "mode", f"found {mode}, expected one of {count} modes with damping")
    title = f"{name}: mode {mode}, damping ratio {fixed(damped.damping_ratios[mode - 1], 4)}"
    return title, damped.frequencies[mode - 1 : mode], damped.motions[mode - 1 : mode]


def _swinging(study: EquilibriumStudy, motions: np.ndarray) -> np.ndarray:
    """States (frames, 13 * bodies) of a robot that swings in modes with these motions of its bodies
    (modes, bodies, 6), twice in each, in _SWING frames each, and rests in the end. The node that
    moves farthest moves by the share _AMPLITUDE of the robot's size. A robot without modes rests
    for two frames."""
    rest = study.robot.equilibrium.state
    states = np.tile(rest, (max(len(motions) * _SWING, 1) + 1, 1))
    size = float(np.ptp(study.nodes[["x", "y", "z"]].to_numpy(), axis=0).max())
    swing = -1j * np.exp(4j * math.pi * np.arange(_SWING) / _SWING)  # begins at rest if real
    moved = _AMPLITUDE * size * (motions[:, np.newaxis] * swing[:, np.newaxis, np.newaxis]).real
    for frame, motion in zip(states, itertools.chain(*moved), strict=False):
        displace(rest, motion.ravel(), frame)
    return states


def _condensed(
    stiffness: np.ndarray, structure: Structure, unactuated: Unactuated, state: np.ndarray
) -> np.ndarray:
    """Stiffness matrix (6*n, 6*n) in N/m with the compliance of the elastic struts (static
    condensation). `unactuated` is the same robot with its arrays of forces.

    `stiffness` is the matrix of the n bodies as if rigid, from stiffness_at_rest(), in the
    equilibrium `state` (13*n,). The elongations of the struts have no inertia: they follow the
    displacements of the bodies at once.
    """
    elastic = elastic_struts(structure)
    if not elastic.size:
        return stiffness
    lengths = structure.strut_table.length

    def forces_released(elongation: np.ndarray) -> np.ndarray:
        of_all = np.zeros(len(lengths))
        of_all[elastic] = elongation
        longer = Unactuated(unactuated.model._replace(p_BN=elongated(structure, of_all)))
        axial = axial_forces(structure, longer, state)[elastic]
        return -np.append(force_at_rest(longer, state), axial)

    found = derivatives(forces_released, _ELONGATION * lengths[elastic])
    coupling, own = np.split(found, [len(stiffness)])
    own += np.diag(structure.strut_stiffness[elastic])
    return np.asarray(stiffness - coupling @ np.linalg.solve(own, coupling.T))
