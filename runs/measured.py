"""Predictions with intervals of real structures, beside measurements; no constant is fitted.

    python runs/measured.py [OUT]

Writes the page README.md and its pictures into the folder OUT, by default measured/. The structures
and the measurements are files in measured/, with their sources. Predictions with intervals are kept
in measured/predictions/ as they are made, so that an interrupted run goes on; delete a file to make
its predictions again. Predictions without measurements are in measured/blind.csv.
"""

from __future__ import annotations

import argparse
import hashlib
import math
import re
from pathlib import Path

import numpy as np
import pandas
from matplotlib.figure import Figure
from measured_intervals import cases
from measured_intervals import predicted as intervals_of
from measured_robots import (
    HERE,
    JUMPS,
    SELF_STRESSES,
    SPRING_DAMPINGS,
    fitted_free_lengths,
    jump,
    simplex_frequency,
    simplex_under_load,
    spine_poses,
)

from tetra_drake.figures.style import LINE_COLOURS, common_style, line_style, save_figure
from tetra_drake.files import write_whole
from tetra_drake.formatting import TextTable, fixed
from tetra_drake.study.fit import Fit
from tetra_drake.study.predict import interval_text

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


def intervals_table(rows: pandas.DataFrame) -> TextTable:
    """Intervals of quantities, beside measured values where they are known."""
    is_known = rows["measured"].notna().any()
    lines = []
    for _, row in rows.iterrows():
        line = [row["quantity"], row["unit"], interval_text(row)]
        if is_known:
            verdict = "inside" if is_inside(row) else "**outside**"
            line += [f"{row['measured']:.4g}", verdict]
        lines.append([*line, _text(row["mostly from"])])
    head = ["quantity", "unit", "median, 90 % interval"]
    head += ["measured", "verdict"] if is_known else []
    return TextTable([*head, "mostly from"], lines, (0, 1, len(head)))


def _text(cell: object) -> str:
    """Names of the largest shares, shortened; a cell may be empty."""
    text = cell if isinstance(cell, str) else ""
    return re.sub(r"(, robot\.[^,;% ]+)+", " and others", text).replace("robot.", "")


def is_inside(row: pandas.Series) -> bool:
    """True if the interval of a row holds the measured value."""
    return bool(row["low"] <= row["measured"] <= row["high"])


def totals_table(rows: pandas.DataFrame, by: str) -> TextTable:
    """Median error of the medians, and share of the intervals that hold the measured value, of the
    rows with a measured value. Tests with the same prediction count once in a further line."""
    known = rows[rows["measured"].notna()]
    groups = [*known.groupby(by, sort=False), ("all", known)]
    once = known.drop_duplicates(["median", "low", "high"])
    if len(once) < len(known):
        groups.append(("all, repeated tests once", once))
    lines = []
    for name, group in groups:
        error = (100.0 * (group["median"] / group["measured"] - 1.0).abs()).median()
        inside = sum(is_inside(row) for _, row in group.iterrows())
        share = f"{inside} of {len(group)} ({100.0 * inside / len(group):.0f} %)"
        lines.append([str(name), str(len(group)), fixed(error, 1), share])
    head = [by, "quantities", "median error, %", "intervals that hold the measured value"]
    return TextTable(head, lines)


@common_style()
def intervals_figure(rows: pandas.DataFrame) -> Figure:
    """Measured values beside intervals, each in units of half the width of its interval."""
    known = rows[rows["measured"].notna()]
    figure = Figure(figsize=(7.0, 3.0), layout="constrained")
    axes = figure.subplots()
    places = pandas.Series(range(len(known)), index=known.index)
    deviation = 2.0 * (known["measured"] - known["low"]) / (known["high"] - known["low"]) - 1.0
    axes.axhspan(-1.0, 1.0, color="0.9", label="90 % interval")
    for number, (kind, group) in enumerate(known.groupby("kind", sort=False), start=1):
        color, own = LINE_COLOURS[number], group.index
        axes.plot(places[own], deviation[own], "o", color=color, label=f"measured {kind}")
    names = {}
    for name, group in known.groupby("structure", sort=False):
        names[places[group.index].mean()] = str(name).replace(", ", ",\n")
        axes.axvline(places[group.index].max() + 0.5, color="0.6", linewidth=0.8)
    axes.set_xticks([*names], [*names.values()])
    axes.grid(visible=False, axis="x")
    axes.set(ylabel="place in the interval (ends: -1, 1)", ylim=(-3.0, 8.0))
    axes.margins(x=0.02)
    axes.legend(framealpha=1.0, ncols=3, loc="upper left")
    return figure


@common_style()
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
            axes.plot(under_load["load"], under_load[kind], label=label, **line_style(number))
            axes.vlines(
                under_load["load"],
                under_load[f"{kind} least"],
                under_load[f"{kind} greatest"],
                color=LINE_COLOURS[number],
                linewidth=3.0,
                alpha=0.5,
            )
        axes.vlines([], 0.0, 0.0, color="black", linewidth=3.0, alpha=0.5, label="measured")
        axes.set_xlabel("load per upper node, kN")
        axes.margins(x=0.03)
        axes.legend(frameon=False)
    heights.set_ylabel("height, mm")
    forces.set_ylabel("tension, kN")
    return figure


@common_style()
def spine_figure(poses: pandas.DataFrame) -> Figure:
    """Paths of the spine's vertebra in its tests: predicted, wanted and seen by the camera."""
    figure = Figure(figsize=(7.0, 3.2), layout="constrained")
    place, angle = figure.subplots(1, 2)
    line = {"linestyle": "-", "color": LINE_COLOURS[1], "linewidth": 2.0}
    dots = {"linestyle": "", "marker": ".", "color": LINE_COLOURS[2], "markersize": 3.0}
    for _, test in poses.groupby("test"):
        place.plot(1e3 * test["predicted_x_m"], 1e3 * test["predicted_y_m"], **line)
        place.plot(1e3 * test["x_m"], 1e3 * test["y_m"], **dots)
        angle.plot(test["step"], np.degrees(test["predicted_rad"]), **line)
        angle.plot(test["step"], np.degrees(test["rad"]), **dots)
    place.margins(x=0.03)
    angle.margins(x=0.03)
    place.set(xlabel="x, mm", ylabel="y, mm")
    angle.set(xlabel="set of cable lengths", ylabel="angle, degrees")
    lines = [angle.lines[0], angle.lines[1]]
    figure.legend(
        lines, ["predicted", "camera"], loc="outside upper center", ncols=2, frameon=False
    )
    return figure


@common_style()
def jump_figure(jumps: dict[float, list[tuple[float, float]]]) -> Figure:
    """Rise of the jumper over the share that is wound up."""
    figure = Figure(figsize=(5.0, 3.2), layout="constrained")
    axes = figure.subplots()
    shares = 100.0 * np.array(list(jumps))
    for number, damping in enumerate(SPRING_DAMPINGS):
        rises = [results[number][0] for results in jumps.values()]
        style = line_style(number + 1)
        axes.plot(shares, rises, marker="o", label=f"springs damped by {damping:g} N s/m", **style)
    for share, text in JUMPS.items():
        if " to " in text:
            low, high = map(float, text.split(" to "))
            axes.vlines(100.0 * share, low, high, color="black", linewidth=6.0, alpha=0.4)
    axes.plot([], [], color="black", linewidth=6.0, alpha=0.4, label="measured")
    axes.margins(x=0.03)
    axes.set(xlabel="wound up by, %", ylabel="rise of the centre, m")
    axes.legend(frameon=False)
    return figure


PAGE = """\
# Measured robots

Predictions of real structures beside measurements, with 90 % intervals. No constant of a prediction
is fitted. `python runs/measured.py` writes this page.

An interval comes from draws within the tolerances of the structure's numbers, which are in its file
with their source, and within what is not known, which is listed below each table. Where no source
is named, a tolerance is assumed. The last column names the two largest shares in the variance.

![measured values in their intervals](intervals.svg)

{by_kind}

{by_structure}

Goals: a median error of at most 3 % for shapes and forces, 8 % for frequencies and 15 % for motion,
and 80 to 97 % of the intervals that hold the measured value. Too few hold for shapes, where two of
five heights lie 0.1 and 0.3 mm outside, and for the jumper. All hold for frequencies and the spine,
whose intervals may be too wide.

The totals flatter, for three reasons. Nearly all rows are of the simplex and the spine, and rows of
one structure are not independent: its loads are one test, and the spine's three tests had the same
commands. The measured values were known when the tolerances were assumed; the bow of the tubes and
what may stiffen the frequencies were assumed because the first predictions were off. And these were
changed after a first comparison of intervals:

- An error of 2 % that all force readings of the simplex share was added.
- The camera's frame on the spine was known to 1 mm, and now to 2 mm.
- Friction of the spine's board was up to a tenth of the weight, and now is up to a twentieth.
- Noise that widens the spine's ranges was added.

The [blind predictions](#blind-predictions) are the real test. The simplex and the spine have the
changed settings there as well, so the hexagonal prism, Laika and the jumper at rest are blindest.

## Simplex (UCLouvain)

Three tubes of 3 m and nine cables, 2 m high, loaded at the three upper nodes. The tubes are
elastic: their axial stiffness shortens them in equilibrium and counts in the natural frequencies.
The self-stress is made as in the laboratory: the tubes are lengthened until they bear it.

![height and forces](simplex.svg)

{simplex}

Up to 1 kN the heights are within 1 mm of the measured ones. At the end the real simplex is lower by
several mm; its authors suspect that the tubes bend, and ours stay straight.

The intervals include it: under a force *P*, a tube that is bowed by *a* without load is shorter by
*π² a² / (4 l (1 - P / Pc)²)*; its buckling load *Pc* is 10.66 kN. The tubes sag by 0.7 mm under
their weight and are bowed by 0 to 3 mm besides (a thousandth of their length). At 2.08 kN this
lowers the upper nodes by the missing 4 mm, and lowers the forces. Below 1 kN it moves nothing.

{simplex_loads}

Assumed: {assumed[simplex_loads]}.

The other way round, a [fit](../../README.md) of two free lengths to these heights finds the
published ones. The bottom cables are as published: the heights do not tell them from the top ones.

{free_lengths}

{frequencies}

The frequencies are a tenth too low. A truss with elastic bars and consistent masses gives 2.35 and
2.81 Hz; the difference is the mass of the cables, which is at their ends here. The truss is too low
by the same factor at both self-stresses, 0.92. This mode follows an infinitesimal mechanism, so its
stiffness comes from the self-stress. Supports that stick instead of sliding change our frequencies
by less than 4 %. No published number explains the rest.

Two things are in this page's script only, and not in the package. The mass along the cables raises
the frequencies by 3 % and changes nothing else; masses at nodes, which all engines have, cannot
give that. The bow of the tubes counts near their buckling load only.

The intervals have the cables' mass spread along them, and what may stiffen the mode:

{simplex_frequencies}

Assumed: {assumed[simplex_frequencies]}.

Source: J. Feron, L. Rhode-Barbarigos, P. Latteur, *Experimental testing of a tensegrity simplex*,
J. Struct. Eng. 149(7), 2023, Table 1 and Figures 6a and 11c; repository JonasFeron/Muscle, commit
46d146a5 ([Apache-2.0](LICENSE.apache2)). [Structure](simplex.yaml),
[measurements](simplex_loading.csv). Assumed: damping, which does not count here.

## Planar spine (Berkeley BEST lab)

One vertebra on four cables with springs, in a vertical plane. Each set of cable lengths has a pose
that the authors' statics wants and one that a camera measured.

![poses](spine.svg)

{poses}

Our equilibrium is the one of the authors' statics. What is left is between both models and the
robot: friction of the vertebra on its board and of the cables in their hooks is not modelled.

{spine}

Assumed: {assumed[spine]}.

Source: repositories 2d-spine-control-hardware, commit 3fc2cdae, and apsabelhaus/tiso, commit
1fa914a8 ([Apache-2.0](LICENSE.apache2)); paper arXiv 1808.08252. [Structure](spine.yaml),
[measurements](spine_poses.csv). Assumed: all mass is at one node, as in the authors' statics.

## Six-strut jumper (ETH Zurich)

Three actuators are wound up slowly by a share of their length, then let go at once. The springs'
damping is not known; NTRT uses 2 N s/m.

![rise](jumper.svg)

{jumping}

At 20 % the prediction is at the upper end of the measured range, at 30 % at its lower end. It
hardly depends on the unknown damping, as springs that are slack do not brake. At 40 % the rods
touch and keep the shape of 30 %, so the jump is no higher: rods that bend, or rub as they pass each
other, are not in the model. At 46 % the actuators, which have no limit of force here, press the
rods flat on the ground before the release, and the rise is as measured.

{jumps}

Assumed: {assumed[jumps]}. A measured value is the middle of its range. At 46 % some draws
do not jump, so that this interval says little; with the shape of 40 % no tolerance reaches the
measured rise.

Source: repositories MoCap_tensegrity and jumping_tensegrity_supplementary, 2024-25, of which only
published facts are used. [Structure](jumper.yaml), [scenario](jump.yaml). Assumed: the shape of a
six-bar with equal cables, rods whose ends are points, the ground, the contact of the rods, stiff
actuator cables.

## Blind predictions

Structures and tests whose measured values were not looked at: **not yet compared**. All {count}
predictions are in [blind.csv](blind.csv). Its SHA-256 is `{hash}`.

### Hexagonal prism

Six carbon tubes and eighteen strings, free. There are nine modes below 14 Hz, and the next is above
20 Hz. Modes 1 to 7 follow infinitesimal mechanisms. Their stiffness comes from the tension, which
is from the authors' theory. Modes 8 and 9 stretch the strings.

{blind_prism}

Assumed: {assumed[blind_prism]}. Source: repository huangk86/Tensegrity-structure-test, commit
9f9ecacb, which states no licence: facts only. [Structure](hex_prism.yaml).

### Laika

The twist between the halves of the centre vertebra at which each foot of the quadruped lifts. On
the foot's side the spine has mechanical springs, which are pulled in; how far is not known. Left
and right are mirror images. The foot's loads at 0 and 15 degrees lead to the twist without load.
With a lattice a quarter softer than the source's, the robot topples before a foot lifts.

{blind_laika}

Assumed: {assumed[blind_laika]}. Source: repository NASA-Tensegrity-Robotics-Toolkit/NTRTsim, branch
laika, src/dev/laika ([Apache-2.0](LICENSE.apache2)). [Structure](laika.yaml).

### Jumper at rest

Heights of its twelve nodes on the ground, sorted.

{blind_jumper}

Assumed: {assumed[blind_jumper]}. [Structure](eth_jumper.yaml); source as above.

### Simplex at other loads and self-stresses

At a self-stress of 8.5 kN the tubes are near their buckling load, so that their bow counts from the
beginning. Here is one member of each kind; blind.csv has all of them.

{blind_simplex_loads}

Assumed: {assumed[blind_simplex_loads]}.

As the tube S1 is lengthened from a self-stress of 1.5 kN, all forces grow by nearly one factor, and
the three tubes bear nearly the same:

{blind_simplex_tightened}

Assumed: {assumed[blind_simplex_tightened]}.

{blind_simplex_frequencies}

Assumed: {assumed[blind_simplex_frequencies]}.

### Spine, nine further tests

The commands of all tests are the same, so their predictions are. Here is one of the nine.

{blind_spine}

Assumed: {assumed[blind_spine]}. [Commands](spine_commands.csv); source as above.
"""


def main(out: Path = HERE) -> None:
    """Writes the page, its pictures and the blind predictions."""
    found = {name: intervals_of(name, case) for name, case in cases().items()}
    spine = found["spine"]
    found["blind_spine"] = spine[spine["measured"].isna()]
    found["spine"] = spine[spine["measured"].notna()]
    blind = pandas.concat([rows for name, rows in found.items() if name.startswith("blind_")])
    known = pandas.concat([rows for name, rows in found.items() if not name.startswith("blind_")])
    known = known.reset_index(drop=True)
    columns = ["structure", "quantity", "unit", "median", "low", "high", "assumed"]
    text = blind[columns].to_csv(index=False, float_format="%.6g", lineterminator="\n")
    write_whole(out / "blind.csv", text)
    under_load, poses = simplex_under_load(), spine_poses()
    frequencies = {stress: simplex_frequency(stress) for stress in SELF_STRESSES}
    jumps = {share: [jump(share=share, damping=c) for c in SPRING_DAMPINGS] for share in JUMPS}
    figures = {
        "simplex": simplex_figure(under_load),
        "spine": spine_figure(poses),
        "jumper": jump_figure(jumps),
        "intervals": intervals_figure(known),
    }
    for name, figure in figures.items():
        save_figure(figure, out, name, kinds=["svg"])
    for name in ("blind_simplex_loads", "blind_simplex_tightened"):
        is_shown = found[name]["quantity"].str.match(r"(H3|CB1|CT1|CV1|S1) at")
        found[name] = found[name][is_shown]
    spine = found["blind_spine"]
    found["blind_spine"] = spine[spine["quantity"].str.endswith(spine["quantity"].iloc[0][-17:])]
    page = PAGE.format(
        simplex=simplex_table(under_load).markdown(),
        free_lengths=free_length_table(fitted_free_lengths("top", "vertical")).markdown(),
        frequencies=frequency_table(frequencies).markdown(),
        poses=spine_table(poses).markdown(),
        jumping=jump_table(jumps).markdown(),
        by_kind=totals_table(known, "kind").markdown(),
        by_structure=totals_table(known, "structure").markdown(),
        count=len(blind),
        hash=hashlib.sha256(text.encode()).hexdigest(),
        assumed={name: rows["assumed"].iloc[0] for name, rows in found.items()},
        **{name: intervals_table(rows).markdown() for name, rows in found.items()},
    )
    write_whole(out / "README.md", page)
    print(out / "README.md")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", nargs="?", type=Path, default=HERE)
    main(parser.parse_args().out)
