"""Pictures of the rover that rolls, and the open loops that its page compares it with.

    python runs/rolling.py

Draws rolling/lapse.svg, and prints the open loops' table of rolling/README.md. After an
interruption the script continues.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from script import evolved, run_script

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.run import load_run
from tetra_drake.figures.motion import one_step
from tetra_drake.figures.style import save_figure
from tetra_drake.formatting import TextTable, fixed
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.optimizer_kinds import CmaEs

HERE = Path(__file__).parent / "rolling"
LAPSE = "lapse"
TRIALS, NETWORKS, SCRATCH = 10, 600, Path("out/runs/rover")
"""Numbers of trials of open loops and of networks in each, and folder of their run."""


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
    figure = one_step(result, time=(2.0, 7.0), instants=4, title=False)
    save_figure(figure, HERE, LAPSE, kinds=["svg"])
    print(network_table().markdown())


if __name__ == "__main__":
    run_script(main)
