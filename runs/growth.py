"""Does the growth of a tiny difference tell where engines differ, and which gaits are robust?

    python runs/growth.py runs/thesis

Displaces each body of the robot by 1 nm at the start, in ten random ways per best gait, and draws
how much the differences have grown at the end, beside the disagreement of the compiled engine with
the diagram and the share of disturbed robots that keep the gait. Writes growth.png to the run's
folder, and prints the table and the rank correlations.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas
from analyse import TIGHT, load_analysis
from matplotlib.figure import Figure

from tetra_drake.engines.simulate import simulate_many
from tetra_drake.errors import InputError
from tetra_drake.evolution.run import Run, load_run
from tetra_drake.figures.style import OKABE_ITO, common_style, make_figure, save_figure
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait

START, WAYS = 1e-9, 10
"""Displacement of a body at the start, in m, and number of ways."""

GROWTH, APART, KEPT = "growth", "engines apart, in", "kept, %"


def growth(run: Run, gait: Gait) -> float:
    """Median over the ways of the largest displacement of a node at the end, over that at the
    start."""
    scenario = run.scenario
    bodies = scenario.robot.body_count
    generator = np.random.default_rng(0)
    directions = generator.normal(size=(WAYS, bodies, 3))
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    directions[:, :, 2] = np.abs(directions[:, :, 2])  # not into the ground
    changes = [{"robot.offsets": displaced.tolist()} for displaced in START * directions]
    scenarios = [scenario, *(scenario.with_numbers(change) for change in changes)]
    outcomes = simulate_many(scenarios, [gait] * len(scenarios), record=True)
    ends = [
        outcome.trajectory.p_WN.values[-1]
        for outcome in outcomes
        if isinstance(outcome, SimulationResult)
    ]
    displacements = [float(np.linalg.norm(end - ends[0], axis=1).max()) for end in ends[1:]]
    return float(np.median(displacements)) / START


def growth_table(directory: Path) -> pandas.DataFrame:
    """Growth, disagreement of engines (in) and share of disturbed robots (%) of each trial's best
    gait. Index: trial."""
    run, analysis = load_run(directory), load_analysis(directory)
    rows = []
    for trial, evaluation in analysis.best_gaits["evaluation"].items():
        apart = abs(analysis.undisturbed(trial) - analysis.again(trial, TIGHT))
        grown = growth(run, run.gait(trial, int(evaluation)))
        kept = 100.0 * analysis.disturbed.loc[trial, "kept"]
        rows.append({"trial": trial, GROWTH: grown, APART: apart, KEPT: kept})
    return pandas.DataFrame(rows).set_index("trial")


@common_style()
def growth_figure(table: pandas.DataFrame) -> Figure:
    """Disagreement of engines and share of disturbed robots over the growth of a difference of 1 nm
    in the start; a point per best gait, with its trial."""
    figure, [panels] = make_figure(width_in=7.0, height_in=3.2, columns=2, sharex=True)
    for panel, name in zip(panels, (APART, KEPT), strict=True):
        panel.plot(table[GROWTH], table[name], "o", color=OKABE_ITO["blue"])
        for trial, row in table.iterrows():
            panel.annotate(str(trial), (row[GROWTH], row[name]), (4, 2), textcoords="offset points")
        panel.margins(0.1)
        panel.set(xscale="log", xlabel="growth of 1 nm in 15 s", ylabel=name)
    panels[0].set_yscale("log")
    return figure


def main(directories: list[str]) -> None:
    """Draws the figure of each run."""
    for directory in map(Path, directories):
        table = growth_table(directory)
        save_figure(growth_figure(table), directory, "growth", kinds=["png"])
        print(table.to_string(float_format="%.3g"))
        ranks = table.rank()
        for name in (APART, KEPT):
            print(f"rank correlation of growth and {name}: {ranks[GROWTH].corr(ranks[name]):+.2f}")


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except InputError as error:
        sys.exit(f"growth.py: {error}")
