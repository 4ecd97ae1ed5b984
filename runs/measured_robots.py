"""Simplex, spine and jumper of the page of measured robots: their shapes, forces, frequencies and
jumps, without a fitted constant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas
from script import read_settings

from tetra_drake.engines.simulate import simulate
from tetra_drake.lab.fit.fit import Fit, fit
from tetra_drake.lab.fit.measurements import Rest
from tetra_drake.lab.predict.variates import variates_of
from tetra_drake.lab.study.equilibrium import study_equilibrium
from tetra_drake.robot.command import Command
from tetra_drake.robot.equilibrium import Unactuated
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.settling import axial_forces
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.tolerances import Tolerance
from tetra_drake.settings.section import value_at

HERE = Path(__file__).parent / "measured"

SIMPLEX, SPINE, JUMPER = read_settings(HERE / "robots.yaml").values()
"""What is known of the robots, see the file."""
SELF_STRESSES = dict(pandas.read_csv(HERE / "simplex_frequencies.csv").to_numpy().tolist())
"""Measured first frequency (Hz) of the simplex by its self-stress (kN)."""
UPPER = ("n3", "n4", "n5")
"""Upper nodes of the simplex, which are loaded."""
AXES = {"x": ("x_m", 1e-3), "y": ("y_m", 1e-3), "angle": ("rad", math.radians(1.0))}
"""Columns of the measured poses, and their units (mm, degrees) on the page."""
LENGTHS = ["l1_m", "l2_m", "l3_m", "l4_m"]
"""Columns of the cable lengths."""


def on_its_own(name: str, **changes: str) -> Scenario:
    """Scenario of a structure of HERE whose struts do not touch, with changes."""
    changes = {"name": name, "robot": f"!Structure {{file: {HERE / name}.yaml}}", **changes}
    return load_scenario("prism").with_changes({**changes, "strut_contact": "!Nothing {}"})


def in_the_air(name: str) -> Scenario:
    """Scenario of a structure of HERE without ground."""
    return on_its_own(name, terrain="!Nothing {}")


def structure_of(scenario: Scenario) -> StructureFile:
    """Structure of a scenario that has one."""
    structure = scenario.robot
    assert isinstance(structure, StructureFile)
    return structure


def at_rest(robot: Robot) -> dict[str, np.ndarray]:
    """Positions of the nodes at rest, in m."""
    p_WN = node_positions(robot.structure, robot.structure.initial_state)
    return dict(zip(robot.structure.node_names, p_WN, strict=True))


# The simplex


def lengthened(scenario: Scenario, lengthening: float, *, struts: int = 3) -> Scenario:
    """A simplex with its first struts lengthened, in m. Its supports keep their places."""
    tree, changes = scenario.model_dump(), dict[str, object]()
    by_one_metre = {"robot.struts.tube.length": Tolerance(size="1 m", each=True)}
    for variate in variates_of(tree, by_one_metre)[:struts]:
        for key, moved in variate.deviations.items():
            changes[key] = f"{value_at(tree, key) + lengthening * moved!r} m"
    return scenario.with_changes(changes)


def compression(robot: Robot) -> float:
    """Mean compression (N) of the struts of a simplex at rest."""
    forces = axial_forces(robot.structure, Unactuated(robot.model), robot.equilibrium.state)
    return float(-forces.mean())


def stressed(
    bare: Scenario, self_stress: float, *, first: float = 0.0, within: float = 0.1
) -> tuple[Scenario, float]:
    """A simplex whose struts bear a self-stress (N, to `within`) at rest, the effect of weight
    included, and how much longer they are for that, in m; the search begins at `first`."""
    lengthening, scenario = first, lengthened(bare, first)
    found = compression(Robot.of(scenario)) if first else 0.0
    while abs(self_stress - found) > within:
        lengthening += SIMPLEX["softness"] * (self_stress - found)
        scenario = lengthened(bare, lengthening)
        found = compression(Robot.of(scenario))
    return scenario, lengthening


def simplex(self_stress: float) -> Scenario:
    """The simplex with a self-stress (kN) in its struts."""
    return stressed(in_the_air("simplex"), 1e3 * self_stress)[0]


def load_on_simplex(load: float) -> dict[str, list[str]]:
    """Changes of a simplex to a load (kN) per upper node."""
    return {f"robot.loads.{node}": ["0 N", "0 N", f"{-1e3 * float(load)!r} N"] for node in UPPER}


def load_steps(file: str = "simplex_loading.csv") -> list[tuple[float, pandas.DataFrame]]:
    """Loads (kN) per upper node in a test of the simplex, with the heights and forces measured at
    each. Column "kind": H, or the kind of cables or struts."""
    measured = pandas.read_csv(HERE / file)
    measured["kind"] = measured["element"].str[:-1]
    steps = measured[measured["quantity"] != "angle"].groupby("step")
    return [(max(0.0, of_step["x"].mean()), of_step) for _, of_step in steps]


def simplex_under_load() -> pandas.DataFrame:
    """Heights (mm) of the upper nodes and forces (kN) of the simplex by the load (kN) per upper
    node: predicted and measured means, with the measured least and greatest."""
    stressed, rows = simplex(1.5), []
    groups = {"CB": "bottom", "CT": "top", "CV": "vertical"}
    for load, of_step in load_steps():
        study = study_equilibrium(Robot.of(stressed.with_changes(load_on_simplex(load))))
        tension = study.cables.groupby("group")["tension"].mean() / 1e3
        predicted = {"H": 1e3 * study.nodes.loc[[*UPPER], "z"].mean()}
        row = {"load": load}
        predicted |= {kind: tension[name] for kind, name in groups.items()}
        for kind, value in predicted.items():
            values = of_step[of_step["kind"] == kind]["value"]
            row |= {kind: value, f"{kind} measured": values.mean()}
            row |= {f"{kind} least": values.min(), f"{kind} greatest": values.max()}
        rows.append(row)
    return pandas.DataFrame(rows)


def simplex_heights(most_load: float = 1.01) -> list[Rest]:
    """Measured mean heights of the upper nodes, up to a load (kN) per node, for a fit."""
    heights = [of_step[of_step["kind"] == "H"] for _, of_step in load_steps()]
    means = [(max(0.0, each["x"].mean()), each["value"].mean()) for each in heights]
    return [
        Rest(
            changes=load_on_simplex(load),
            positions={f"{node} z": height / 1e3 for node in UPPER},
            position_uncertainty=SIMPLEX["height_uncertainty"],
        )
        for load, height in means
        if load <= most_load
    ]


def fitted_free_lengths(*groups: str) -> Fit:
    """Free lengths of groups of the simplex's cables, fitted to its measured heights."""
    bounds = {f"robot.cables.{group}.free_length": ("2035 mm", "2050 mm") for group in groups}
    return fit(simplex(1.5), simplex_heights(), bounds)


def vibrating(scenario: Scenario) -> Scenario:
    """A simplex with the masses of the tests of its frequency."""
    structure = structure_of(scenario)
    tube = structure.struts["tube"]
    density = SIMPLEX["tube"] / (math.pi * (tube.diameter / 2) ** 2 * structure.size)
    changes = {"robot.struts.tube.density": f"{density!r} kg/m^3"}
    for node, weight in SIMPLEX["vibrating"].items():
        mass = weight / SIMPLEX["gravity"] - SIMPLEX["tube"] / 2
        changes[f"robot.masses.{node}"] = f"{mass!r} kg"
    return scenario.with_changes(changes)


def simplex_frequency(self_stress: float) -> float:
    """First natural frequency (Hz) of the simplex. The self-stress is in kN."""
    return float(study_equilibrium(vibrating(simplex(self_stress))).frequencies[0])


# The spine


def pose(spine: Scenario, lengths: Sequence[float]) -> list[float]:
    """Pose of the spine's vertebra at rest, with these cable lengths (m): x and y in m, and the
    angle in rad."""
    named = zip(SPINE["cables"], lengths, strict=True)
    changes = {f"robot.cables.{cable}.free_length": f"{float(x)!r} m" for cable, x in named}
    nodes = at_rest(Robot.of(spine.with_changes(changes)))
    along = nodes["f"] - nodes["c"]
    origin = nodes["c"] + SPINE["behind"] * along / np.linalg.norm(along)
    return [origin[0], origin[2] - SPINE["origin"], math.atan2(along[2], along[0])]


def spine_poses() -> pandas.DataFrame:
    """Poses of the spine's vertebra for each measured set of cable lengths: predicted ones, wanted
    ones by the authors' statics, and ones that their camera measured; in m and rad."""
    table, scenario = pandas.read_csv(HERE / "spine_poses.csv"), in_the_air("spine")
    poses = [pose(scenario, lengths) for lengths in table[LENGTHS].to_numpy()]
    table[["predicted_x_m", "predicted_y_m", "predicted_rad"]] = poses
    return table


# The jumper


def jumper(damping: float) -> Scenario:
    """The jumper, whose springs are damped by this much (N s/m)."""
    scenario = load_scenario(HERE / "jump.yaml")
    return scenario.with_changes({"robot.cables.spring.damping": f"{damping} N*s/m"})


def jump(scenario: Scenario, share: float) -> tuple[float, float]:
    """Rise (m) of the jumper's centre, and the least distance (m) of two rods' axes. The actuators
    are wound up slowly by a share of their free length and let go at once."""
    result = simulate(scenario, command=wound_up(scenario, share), record=True)
    height, begin = result.trajectory.p_WB.sel(axis="z").mean("body"), JUMPER["hold"]
    rise = height.sel(time=slice(begin, None)).max() - height.sel(time=begin, method="nearest")
    return float(rise), result.metrics.clearance


def wound_up(scenario: Scenario, share: float) -> Command:
    """Command that winds the actuators up by a share of their free length and releases them."""
    times = np.arange(0.0, scenario.simulation.duration, 0.01)
    wound = JUMPER["unwound"] * (1.0 - share * np.minimum(times / JUMPER["wind"], 1.0))
    free_length = np.where(times < JUMPER["hold"], wound, JUMPER["released"])
    return Command("wound up and released", 0.01, np.tile(free_length[:, np.newaxis], 3))
