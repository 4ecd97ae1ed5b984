"""Pictures of the rover that rolls, and the open loops that its page compares it with.

    python runs/rolling.py

Draws rolling/lapse.svg, and prints the open loops' table of rolling/README.md. After an
interruption the script continues.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from script import evolved, run_script

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.run import load_run
from tetra_drake.figures.style import save_figure
from tetra_drake.formatting import TextTable, fixed
from tetra_drake.results.result import SimulationResult
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.optimizer_kinds import CmaEs

HERE = Path(__file__).parent / "rolling"
LAPSE = "lapse"
TRIALS, NETWORKS, SCRATCH = 10, 600, Path("out/runs/rover")
"""Numbers of trials of open loops and of networks in each, and folder of their run."""


def lapse_figure(result: SimulationResult) -> Figure:
    """The rover from the side at six times of its first turn, and the way of its centre over the
    whole time."""
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    lapse, path = figure.subplots(2, 1, height_ratios=(3.0, 1.0))
    trajectory, structure = result.trajectory, result.robot.structure
    nodes = trajectory.p_WN.values
    centre = structure.node_shares @ nodes
    for number, time in enumerate(np.linspace(2.0, 7.0, 6)):
        sample = int(np.abs(trajectory.time.values - time).argmin())
        for strut, ends in enumerate(structure.struts):
            x, _, z = nodes[sample][ends].T
            marked = strut == 0
            style = {"color": "C1" if marked else "0.45", "linewidth": 2.5 if marked else 1.2}
            lapse.plot(x + 0.35 * number, z, **style)
        lapse.text(centre[sample, 0] + 0.35 * number, -0.12, f"{time:g} s", ha="center")
    lapse.set_aspect("equal")
    lapse.axhline(0.0, color="black", linewidth=0.8)
    lapse.set_axis_off()
    path.plot(centre[:, 0], centre[:, 1])
    path.plot(centre[::100, 0], centre[::100, 1], "C0.")
    path.set(xlabel="x, forward (m); a dot every second", ylabel="y, left (m)")
    path.set_aspect("equal")
    return figure


def network_table() -> TextTable:
    """Turns, way and drift of the fittest gait of each of TRIALS trials.

    CMA-ES evolves networks of oscillators, open loops, on the undisturbed rover.
    """
    changes = {"simulation.steady_from": "2 s", "optimizer": CmaEs(), "evolution.trials": TRIALS}
    scenario = load_scenario("rover").with_changes(changes | {"evolution.evaluations": NETWORKS})
    rows, run = [], evolved(scenario, SCRATCH)
    for trial, row in run.best().set_index("trial").iterrows():
        drift = row["lateral_drift"] / row["distance"]
        turns, way = fixed(row["rolled"] / math.tau, 2), fixed(row["distance"], 2)
        rows.append([f"{trial}", turns, way, f"{100.0 * drift:.0f} %"])
    return TextTable(["trial", "turns", "way, m", "drift"], rows)


def main(_: Sequence[str] = ()) -> None:
    """Draws the picture, and prints the table of open loops."""
    run = load_run(HERE)
    result = simulate(run.scenario, run.best_gait(), record=True)
    save_figure(lapse_figure(result), HERE, LAPSE, kinds=["svg"])
    print(network_table().markdown())


if __name__ == "__main__":
    run_script(main)
