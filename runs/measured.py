"""Predictions beside measurements of three real structures; their constants are not fitted.

    python runs/measured.py [OUT]

Writes the page README.md and its pictures into the folder OUT, by default measured/. The structures
and the measurements are files in measured/, with their sources.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
import pandas
from matplotlib.figure import Figure

from tetra_drake.engines.simulate import simulate
from tetra_drake.figures.style import save_figure
from tetra_drake.files import write_whole
from tetra_drake.formatting import TextTable, fixed
from tetra_drake.robot.command import Command
from tetra_drake.robot.equilibrium import Unactuated
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.robot.struts import axial_forces
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.study.equilibrium import study_equilibrium
from tetra_drake.study.fit import Fit, fit_values
from tetra_drake.study.measurements import Rest

HERE = Path(__file__).parent / "measured"

SOFTNESS = 0.717e-3 / 1.5e3
"""Lengthening (m) of the simplex's struts per self-stress (N), as published; nearly linear."""
SELF_STRESSES = {1.5: 2.54, 2.5: 3.04}
"""Measured first frequency (Hz) of the simplex by its self-stress (kN)."""
TUBE, GRAVITY = 2.63, 9.81
"""Mass (kg) of a strut of the simplex, and acceleration of gravity (m/s²)."""
VIBRATING = {"n0": 45.7, "n1": 45.7, "n2": 45.7, "n3": 50.3, "n4": 50.3, "n5": 50.3}
"""Weights (N) at the nodes of the simplex in the tests of its frequency, half a strut included."""

UPPER = ("n3", "n4", "n5")
"""Upper nodes of the simplex, which are loaded."""
HEIGHT_UNCERTAINTY = 2e-4
"""Standard deviation (m) of a measured height."""

SADDLE = ("horizontal_bottom", "horizontal_top", "saddle_bottom", "saddle_top")
"""Cables of the spine, in the order of its measurements."""
CENTRE = 0.0291
"""Distance (m) of the spine's node c behind the origin of its pose."""
FLOOR = 0.3
"""Height (m) of the origin of the spine's poses in spine.yaml."""

UNWOUND, RELEASED = 0.5816, 0.75
"""Free lengths (m) of the jumper's actuators before it is wound up, and after the release."""
WIND, HOLD = 5.5, 6.0
"""Times (s) at which the jumper is wound up, and released."""
SPRING_DAMPINGS = (2.0, 0.5)
"""Damping of the jumper's springs in N s/m: NTRT's, and a quarter of it."""
JUMPS = {0.2: "0.28 to 0.36", 0.3: "0.45 to 0.52", 0.4: "0.61 to 0.98", 0.46: "1.06 to 1.14"}
"""Measured rise (m) of the jumper's centre by the share of UNWOUND that is wound up."""


def in_the_air(name: str) -> Scenario:
    """Scenario of a structure of HERE without ground."""
    changes = {
        "name": name,
        "robot": f"!Structure {{file: {HERE / name}.yaml}}",
        "terrain": "!Nothing {}",
        "strut_contact": "!Nothing {}",
    }
    return load_scenario("prism").with_changes(changes)


def at_rest(robot: Robot) -> dict[str, np.ndarray]:
    """Positions of the nodes at rest, in m."""
    p_WN = node_positions(robot.structure, robot.structure.initial_state)
    return dict(zip(robot.structure.node_names, p_WN, strict=True))


# The simplex


def lengthened_simplex(lengthening: float) -> Scenario:
    """The simplex with its struts lengthened, in m."""
    scenario = in_the_air("simplex")
    structure = scenario.robot
    assert isinstance(structure, StructureFile)
    changes: dict[str, object] = {}
    for a, b in structure.struts["tube"].pairs:
        start, end = np.array(structure.nodes[a]), np.array(structure.nodes[b])
        shift = 0.5 * lengthening * (end - start) / np.linalg.norm(end - start)
        for node, place in ((a, start - shift), (b, end + shift)):
            changes[f"robot.nodes.{node}"] = [f"{x!r} m" for x in place.tolist()]
    return scenario.with_changes(changes)


def simplex(self_stress: float) -> Scenario:
    """The simplex whose struts bear a self-stress (kN) at rest, the effect of weight included."""
    lengthening, wanted = 0.0, 1e3 * self_stress
    compression = 0.0
    while abs(wanted - compression) > 0.1:
        lengthening += SOFTNESS * (wanted - compression)
        scenario = lengthened_simplex(lengthening)
        robot = Robot.of(scenario)
        forces = axial_forces(robot.structure, Unactuated(robot.model), robot.equilibrium.state)
        compression = -forces.mean()
    return scenario


def simplex_under_load() -> pandas.DataFrame:
    """Heights (mm) of the upper nodes and forces (kN) of the simplex by the load (kN) per upper
    node: predicted and measured means, with the measured least and greatest."""
    measured = pandas.read_csv(HERE / "simplex_loading.csv")
    stressed = simplex(1.5)
    measured["kind"] = measured["element"].str[:-1].where(measured["quantity"] != "height", "H")
    rows = []
    for _, of_step in measured[measured["quantity"] != "angle"].groupby("step"):
        load = max(0.0, of_step["x"].mean())
        force = ["0 N", "0 N", f"{-1e3 * load} N"]
        loads = {f"robot.loads.{node}": force for node in UPPER}
        robot = Robot.of(stressed.with_changes(loads))
        study = study_equilibrium(robot)
        tension = study.cables.groupby("group")["tension"].mean() / 1e3
        predicted = {
            "H": 1e3 * np.mean([at_rest(robot)[node][2] for node in UPPER]),
            "CB": tension["bottom"],
            "CT": tension["top"],
            "CV": tension["vertical"],
        }
        row = {"load": load}
        for kind, value in predicted.items():
            values = of_step[of_step["kind"] == kind]["value"]
            row |= {kind: value, f"{kind} measured": values.mean()}
            row |= {f"{kind} least": values.min(), f"{kind} greatest": values.max()}
        rows.append(row)
    return pandas.DataFrame(rows)


def simplex_heights(most_load: float = 1.01) -> list[Rest]:
    """Measured mean heights of the upper nodes, up to a load (kN) per node, for a fit."""
    measured = pandas.read_csv(HERE / "simplex_loading.csv")
    heights = measured[measured["quantity"] == "height"]
    cases = []
    for _, of_step in heights.groupby("step"):
        load = max(0.0, of_step["x"].mean())
        if load > most_load:
            continue
        force = ["0 N", "0 N", f"{-1e3 * load} N"]
        height = of_step["value"].mean() / 1e3
        cases.append(
            Rest(
                changes={f"robot.loads.{node}": force for node in UPPER},
                positions={f"{node} z": height for node in UPPER},
                position_uncertainty=HEIGHT_UNCERTAINTY,
            )
        )
    return cases


def fitted_free_lengths(*groups: str) -> Fit:
    """Free lengths of groups of the simplex's cables, fitted to its measured heights."""
    bounds = {f"robot.cables.{group}.free_length": ("2035 mm", "2050 mm") for group in groups}
    return fit_values(simplex(1.5), simplex_heights(), bounds)


def simplex_frequency(self_stress: float) -> float:
    """First natural frequency (Hz) of the simplex. The self-stress is in kN."""
    scenario = simplex(self_stress)
    structure = scenario.robot
    assert isinstance(structure, StructureFile)
    tube = structure.struts["tube"]
    density = TUBE / (math.pi * (tube.diameter / 2) ** 2 * structure.size)
    changes = {"robot.struts.tube.density": f"{density!r} kg/m^3"}
    for node, weight in VIBRATING.items():
        changes[f"robot.masses.{node}"] = f"{weight / GRAVITY - TUBE / 2!r} kg"
    return float(study_equilibrium(Robot.of(scenario.with_changes(changes))).frequencies[0])


# The spine


def spine_poses() -> pandas.DataFrame:
    """Poses of the spine's vertebra for each measured set of cable lengths: predicted ones, wanted
    ones by the authors' statics, and ones that their camera measured; in m and rad."""
    table, scenario = pandas.read_csv(HERE / "spine_poses.csv"), in_the_air("spine")
    poses = []
    for lengths in table[["l1_m", "l2_m", "l3_m", "l4_m"]].to_numpy().tolist():
        named = zip(SADDLE, lengths, strict=True)
        changes = {f"robot.cables.{cable}.free_length": f"{x!r} m" for cable, x in named}
        nodes = at_rest(Robot.of(scenario.with_changes(changes)))
        along = nodes["f"] - nodes["c"]
        origin = nodes["c"] + CENTRE * along / np.linalg.norm(along)
        poses.append([origin[0], origin[2] - FLOOR, math.atan2(along[2], along[0])])
    table[["predicted_x_m", "predicted_y_m", "predicted_rad"]] = poses
    return table


# The jumper


def jump(*, share: float, damping: float) -> tuple[float, float]:
    """Rise (m) of the jumper's centre, and the least distance (m) of two rods' axes.

    The actuators are wound up slowly by a share of UNWOUND and let go at once. The damping of the
    springs is in N s/m.
    """
    scenario = load_scenario(str(HERE / "jump.yaml"))
    scenario = scenario.with_changes({"robot.cables.spring.damping": f"{damping} N*s/m"})
    times = np.arange(0.0, scenario.simulation.duration, 0.01)
    wound = UNWOUND * (1.0 - share * np.minimum(times / WIND, 1.0))
    free_length = np.where(times < HOLD, wound, RELEASED)
    command = Command("wound up and released", 0.01, np.tile(free_length[:, np.newaxis], 3))
    result = simulate(scenario, command=command, record=True)
    assert result.trajectory is not None
    height = result.trajectory.p_WB.sel(axis="z").mean("body")
    rise = height.sel(time=slice(HOLD, None)).max() - height.sel(time=HOLD, method="nearest")
    return float(rise), result.metrics.clearance


# Tables, pictures and the page


def simplex_table(under_load: pandas.DataFrame) -> TextTable:
    """Heights and forces of the simplex at five loads."""
    steps = [int(np.abs(under_load["load"] - load).argmin()) for load in (0.0, 0.3, 0.6, 1.0, 2.1)]
    rows = []
    for step in steps:
        row = under_load.iloc[step]
        cells = [fixed(row["load"])]
        for kind, digits in (("H", 1), ("CB", 2), ("CT", 2), ("CV", 2)):
            cells += [fixed(row[kind], digits), fixed(row[f"{kind} measured"], digits)]
        rows.append(cells)
    quantities = ("height, mm", "bottom cables, kN", "top cables, kN", "vertical cables, kN")
    pairs = [text for quantity in quantities for text in (quantity, "measured")]
    return TextTable(["load per upper node, kN", *pairs], rows, text_columns=())


def frequency_table(frequencies: dict[float, float]) -> TextTable:
    """First natural frequencies of the simplex."""
    rows = [
        [fixed(stress, 1), fixed(predicted), fixed(SELF_STRESSES[stress])]
        for stress, predicted in frequencies.items()
    ]
    return TextTable(["self-stress, kN", "first frequency, Hz", "measured"], rows, text_columns=())


def free_length_table(fit: Fit) -> TextTable:
    """The fitted free lengths beside the published ones."""
    rows = []
    for key, row in fit.parameters.iterrows():
        interval = f"{fixed(1e3 * row['low'], 1)} to {fixed(1e3 * row['high'], 1)}"
        published, group = row["start"], str(key).split(".")[2]
        rows.append([group, *(fixed(1e3 * x, 1) for x in (row["value"], published)), interval])
    head = ["cables", "free length, fitted (mm)", "published (mm)", "95 % interval (mm)"]
    return TextTable(head, rows)


def spine_table(poses: pandas.DataFrame) -> TextTable:
    """Deviations of the spine's poses from the authors' statics, and of the camera's from them."""
    rows = []
    for name, unit, size in (("x", "m", 1e-3), ("y", "m", 1e-3), ("rad", "", math.radians(1.0))):
        column = f"{name}_{unit}" if unit else name
        predicted = poses[f"predicted_{column}"]
        wanted = (predicted - poses[f"wanted_{column}"]) / size
        camera = (poses[column] - predicted) / size
        label = {"x": "x, mm", "y": "y, mm", "rad": "angle, degrees"}[name]
        spread = f"{fixed(camera.min())} to {fixed(camera.max())}"
        rows.append([label, fixed(wanted.abs().max(), 4), fixed(camera.mean()), spread])
    headings = ["", "largest deviation from the authors' statics", "camera, mean", "camera, range"]
    return TextTable(headings, rows)


def jump_table(jumps: dict[float, list[tuple[float, float]]]) -> TextTable:
    """Rises of the jumper, and the least distance of its rods."""
    rows = []
    for share, results in jumps.items():
        rises = " and ".join(fixed(rise) for rise, _ in results)
        least = fixed(1e3 * min(clearance for _, clearance in results), 1)
        rows.append([f"{100.0 * share:.0f} %", rises, JUMPS[share], least])
    headings = ["wound up by", "rise, m, at 2 and 0.5 N s/m", "measured", "rods' axes apart, mm"]
    return TextTable(headings, rows)


def simplex_figure(under_load: pandas.DataFrame) -> Figure:
    """Height and cable forces of the simplex over the load."""
    figure = Figure(figsize=(7.0, 3.2), layout="constrained")
    heights, forces = figure.subplots(1, 2)
    panels = {
        heights: {"H": "upper nodes"},
        forces: {"CV": "vertical", "CB": "bottom", "CT": "top"},
    }
    for axes, kinds in panels.items():
        for number, (kind, label) in enumerate(kinds.items()):
            color = f"C{number}"
            axes.plot(under_load["load"], under_load[kind], color=color, label=label)
            axes.vlines(
                under_load["load"],
                under_load[f"{kind} least"],
                under_load[f"{kind} greatest"],
                color=color,
                linewidth=3.0,
                alpha=0.5,
            )
        axes.vlines([], 0.0, 0.0, color="black", linewidth=3.0, alpha=0.5, label="measured")
        axes.set_xlabel("load per upper node, kN")
        axes.legend(frameon=False)
    heights.set_ylabel("height, mm")
    forces.set_ylabel("tension, kN")
    return figure


def spine_figure(poses: pandas.DataFrame) -> Figure:
    """Paths of the spine's vertebra in its tests: predicted, wanted and seen by the camera."""
    figure = Figure(figsize=(7.0, 3.2), layout="constrained")
    place, angle = figure.subplots(1, 2)
    for _, test in poses.groupby("test"):
        place.plot(1e3 * test["predicted_x_m"], 1e3 * test["predicted_y_m"], "C0", linewidth=2.0)
        place.plot(1e3 * test["x_m"], 1e3 * test["y_m"], "C1.", markersize=2.0)
        angle.plot(test["step"], np.degrees(test["predicted_rad"]), "C0", linewidth=2.0)
        angle.plot(test["step"], np.degrees(test["rad"]), "C1.", markersize=2.0)
    place.set(xlabel="x, mm", ylabel="y, mm")
    angle.set(xlabel="set of cable lengths", ylabel="angle, degrees")
    lines = [angle.lines[0], angle.lines[1]]
    figure.legend(
        lines, ["predicted", "camera"], loc="outside upper center", ncols=2, frameon=False
    )
    return figure


def jump_figure(jumps: dict[float, list[tuple[float, float]]]) -> Figure:
    """Rise of the jumper over the share that is wound up."""
    figure = Figure(figsize=(5.0, 3.2), layout="constrained")
    axes = figure.subplots()
    shares = 100.0 * np.array(list(jumps))
    for number, damping in enumerate(SPRING_DAMPINGS):
        rises = [results[number][0] for results in jumps.values()]
        axes.plot(shares, rises, "o-", label=f"springs damped by {damping:g} N s/m")
    for share, text in JUMPS.items():
        if " to " in text:
            low, high = map(float, text.split(" to "))
            axes.vlines(100.0 * share, low, high, color="black", linewidth=6.0, alpha=0.4)
    axes.plot([], [], color="black", linewidth=6.0, alpha=0.4, label="measured")
    axes.set(xlabel="wound up by, %", ylabel="rise of the centre, m")
    axes.legend(frameon=False)
    return figure


PAGE = """\
# Measured robots

Predictions beside measurements of three real structures. No constant of a prediction is fitted.
`python runs/measured.py` writes this page.

## Simplex (UCLouvain)

Three tubes of 3 m and nine cables, 2 m high, loaded at the three upper nodes. The tubes are
elastic: their axial stiffness shortens them in equilibrium and counts in the natural frequencies.
The self-stress is made as in the laboratory: the tubes are lengthened until they bear it.

![height and forces](simplex.svg)

{simplex}

Up to 1 kN the heights are within 1 mm of the measured ones. At the end the real simplex is lower by
several mm; its authors suspect that the tubes bend, and ours stay straight.

The other way round, a [fit](../../README.md) of two free lengths to these heights finds the
published ones. The bottom cables are as published: the heights do not tell them from the top ones.

{free_lengths}

{frequencies}

The frequencies are a tenth too low. A truss with elastic bars and consistent masses gives 2.35 and
2.81 Hz; the difference is the mass of the cables, which is at their ends here. The truss is too low
by the same factor at both self-stresses, 0.92. This mode follows an infinitesimal mechanism, so its
stiffness comes from the self-stress. Supports that stick instead of sliding change our frequencies
by less than 4 %. No published number explains the rest.

Source: J. Feron, L. Rhode-Barbarigos, P. Latteur, *Experimental testing of a tensegrity simplex*,
J. Struct. Eng. 149(7), 2023, Table 1 and Figures 6a and 11c; repository JonasFeron/Muscle, commit
46d146a5 ([Apache-2.0](LICENSE.apache2)). [Structure](simplex.yaml),
[measurements](simplex_loading.csv). Assumed: damping, which does not count here.

## Planar spine (Berkeley BEST lab)

One vertebra on four cables with springs, in a vertical plane. Each set of cable lengths has a pose
that the authors' statics wants and one that a camera measured.

![poses](spine.svg)

{spine}

Our equilibrium is the one of the authors' statics. What is left is between both models and the
robot: friction of the vertebra on its board and of the cables in their hooks is not modelled.

Source: repositories 2d-spine-control-hardware, commit 3fc2cdae, and apsabelhaus/tiso, commit
1fa914a8 ([Apache-2.0](LICENSE.apache2)); paper arXiv 1808.08252. [Structure](spine.yaml),
[measurements](spine_poses.csv). Assumed: all mass is at one node, as in the authors' statics.

## Six-strut jumper (ETH Zurich)

Three actuators are wound up slowly by a share of their length, then let go at once. The springs'
damping is not known; NTRT uses 2 N s/m.

![rise](jumper.svg)

{jumps}

At 20 % the prediction is at the upper end of the measured range, at 30 % at its lower end. It
hardly depends on the unknown damping, as springs that are slack do not brake. At 40 % the rods
touch and keep the shape of 30 %, so the jump is no higher: rods that bend, or rub as they pass each
other, are not in the model. At 46 % the actuators, which have no limit of force here, press the
rods flat on the ground before the release, and the rise is as measured.

Source: repositories MoCap_tensegrity and jumping_tensegrity_supplementary, 2024-25, of which only
published facts are used. [Structure](jumper.yaml), [scenario](jump.yaml). Assumed: the shape of a
six-bar with equal cables, rods whose ends are points, the ground, the contact of the rods, stiff
actuator cables.
"""


def main(out: Path = HERE) -> None:
    """Writes the page and its pictures."""
    under_load, poses = simplex_under_load(), spine_poses()
    frequencies = {stress: simplex_frequency(stress) for stress in SELF_STRESSES}
    jumps = {share: [jump(share=share, damping=c) for c in SPRING_DAMPINGS] for share in JUMPS}
    figures = {
        "simplex": simplex_figure(under_load),
        "spine": spine_figure(poses),
        "jumper": jump_figure(jumps),
    }
    for name, figure in figures.items():
        save_figure(figure, out, name, kinds=["svg"])
    page = PAGE.format(
        simplex=simplex_table(under_load).markdown(),
        free_lengths=free_length_table(fitted_free_lengths("top", "vertical")).markdown(),
        frequencies=frequency_table(frequencies).markdown(),
        spine=spine_table(poses).markdown(),
        jumps=jump_table(jumps).markdown(),
    )
    write_whole(out / "README.md", page)
    print(out / "README.md")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", nargs="?", type=Path, default=HERE)
    main(parser.parse_args().out)
