"""Figures of the thesis, drawn again from the recorded trials; see thesis_page.py."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from matplotlib.figure import Figure
from PIL import Image
from readings import THESIS

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.run import Run
from tetra_drake.figures.fitness import fitness_of_trials, initial_fitness
from tetra_drake.figures.forces import ground_forces, signals_and_tensions
from tetra_drake.figures.motion import one_step, relative_distances, time_lapse
from tetra_drake.figures.style import (
    OKABE_ITO,
    REFERENCE,
    common_style,
    legend_below,
    make_figure,
)
from tetra_drake.files import write_whole
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.measures import distance_walked
from tetra_drake.robot.structure import Structure, node_positions
from tetra_drake.settings.units import INCH

Results: TypeAlias = dict[str, list[SimulationResult]]
"""Simulated gaits of the trials, by GAITS."""
GAITS: Any = {
    "best initial": {"color": OKABE_ITO["blue"], "linestyle": "-"},
    "worst initial": {"color": OKABE_ITO["orange"], "linestyle": "-"},
    "best evolved": {"color": OKABE_ITO["green"], "linestyle": "-"},
}
"""Looks of the gaits of each trial, by name."""
TURN = -0.09
"""Angle (rad) by which Figure 13 turns the robot."""
COLOURS = 40
"""Number of colours of a picture's file."""
INITIAL, EVOLVED = THESIS["initial"], THESIS["evolved"]
"""Distances (in) of the thesis's best initial gait and of its best evolved gait."""


def walks(run: Run) -> Results:
    """Results of three gaits of each trial, by their names in GAITS: the initial gaits with the
    greatest and the least distance, and the fittest gait."""
    initial = run.initial().groupby("trial")["distance"]
    chosen = initial.idxmax(), initial.idxmin(), run.best().index
    results = {}
    for name, places in zip(GAITS, chosen, strict=True):
        rows = run.evaluations.loc[places]
        gaits = [run.gait(row["trial"], row["index"]) for _, row in rows.iterrows()]
        results[name] = [simulate(run.scenario, gait, record=True) for gait in gaits]
    return results


@common_style()
def measured_points(structure: Structure) -> Figure:
    """The robot from above, displaced and turned, with the points of Eq. 10 (Figure 13)."""
    figure, axes = make_figure(width_in=7.0, height_in=2.9)
    panel, nodes = axes[0, 0], node_positions(structure, structure.initial_state)[:, :2] / INCH
    cosine, sine = np.cos(TURN), np.sin(TURN)
    turned = (nodes - nodes[structure.markers[0]]) @ np.array([[cosine, sine], [-sine, cosine]])
    shown = turned + np.array([4.0, 2.0])
    for ends in structure.struts:
        panel.plot(shown[ends, 0], shown[ends, 1], color="0.7", linestyle="-")
    (left, right), tip = shown[structure.markers[:2]], shown[nodes[:, 0].argmax()]
    arrows = {"x_1": (0.0, left[1], left), "x_2": (0.0, right[1], right)}
    arrows |= {"x_3": (0.0, tip[1], tip), "y_1": (left[0], 0.0, left)}
    for name, (x, y, point) in arrows.items():
        panel.annotate("", xy=point, xytext=(x, y), arrowprops={"arrowstyle": "-|>"})
        panel.plot(*point, marker="o", markersize=6.0, color=OKABE_ITO["vermillion"])
        beside = (x + 0.3, 1.0) if name == "y_1" else (1.5, y + 0.4)
        panel.text(*beside, f"${name}$", va="center")
    for body, name in enumerate(structure.bodies):
        x, y = max(shown[structure.carriers == body], key=lambda node: node[1])
        panel.text(x, y + 0.3, name, ha="center", color="0.35")
    panel.axvline(0.0, color="black", linestyle="-", linewidth=0.8)
    panel.axhline(0.0, color="black", linestyle="-", linewidth=0.8)
    panel.set(xlabel="x, forward (in)", ylabel="y, left (in)")
    panel.set(xlim=(-1.0, tip[0] + 1.0), ylim=(-5.5, 3.5))
    panel.set_aspect("equal")
    panel.grid(visible=False)
    return figure


@common_style()
def forward_distances(
    results: Results, panels: Sequence[Sequence[str]], *, thesis: Sequence[float]
) -> Figure:
    """Forward distance of all trials over time (Figures 16 and 18): a panel for each list of names
    of GAITS, with the thesis's best distance (in)."""
    figure, axes = make_figure(width_in=7.0, height_in=3.7, columns=len(panels), sharey=True)
    looks = {}
    for panel, names, distance in zip(axes[0], panels, thesis, strict=True):
        for name in names:
            looks[name] = GAITS[name]
            for result in results[name]:
                walked = distance_walked(result.trajectory, result.robot.structure) / INCH
                panel.plot(result.trajectory.time, walked, **GAITS[name], linewidth=0.9)
        panel.axhline(distance, **REFERENCE)
        panel.set_xlabel("time (s)")
    axes[0, 0].set_ylabel("forward distance $x_1$ (in)")
    legend_below(figure, looks | {"thesis, best of all trials": REFERENCE})
    return figure


@common_style()
def save_figures(run: Run, out: Path) -> None:
    """Writes the figures into a folder, named by their numbers in the thesis."""
    results, trial = walks(run), int(run.fittest()["trial"])
    best = results["best evolved"][trial]
    figures = {
        13: measured_points(best.robot.structure),
        14: relative_distances(best, title=False),
        15: time_lapse(best, title=False, instants=4),
        16: forward_distances(results, [["best initial", "worst initial"]], thesis=[INITIAL]),
        17: initial_fitness(run, trial, title=False),
        18: forward_distances(
            results, [["best initial"], ["best evolved"]], thesis=[INITIAL, EVOLVED]
        ),
        19: signals_and_tensions(best, title=False),
        20: ground_forces(best, title=False),
        21: one_step(best, title=False, instants=4),
        22: fitness_of_trials(run, title=False),
    }
    for number, figure in figures.items():
        picture, file = io.BytesIO(), io.BytesIO()
        figure.savefig(picture, format="png")
        Image.open(picture).convert("RGB").quantize(COLOURS).save(file, "PNG", optimize=True)
        write_whole(out / f"figure_{number}.png", file.getvalue())
