"""Pictures of the rover that rolls, and the open loops that its page compares it with.

    python runs/rolling.py

Draws rolling/lapse.svg, and prints the open loops' table of rolling/README.md. After an
interruption the script continues.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from page import rendered
from script import evolved, script

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.run import load_run
from tetra_drake.figures.motion import one_step
from tetra_drake.figures.style import save_figure
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.optimizer_kinds import CmaEs

HERE = Path(__file__).parent / "rolling"
LAPSE = "lapse"
TRIALS, NETWORKS, SCRATCH = 10, 600, Path("out/runs/rover")
"""Numbers of trials of open loops and of networks in each, and folder of their run."""


def network_table() -> str:
    """Turns, way and drift of the fittest gait of each of TRIALS trials.

    CMA-ES evolves networks of oscillators, open loops, on the undisturbed rover.
    """
    changes = {"simulation.steady_from": "2 s", "optimizer": CmaEs(), "evolution.trials": TRIALS}
    scenario = load_scenario("rover").with_changes(changes | {"evolution.evaluations": NETWORKS})
    return rendered("rolling.md", best=evolved(scenario, SCRATCH).best())


@script
def main(_: Sequence[str] = ()) -> None:
    """Draws the picture, and prints the table of open loops."""
    run = load_run(HERE)
    result = simulate(run.scenario, run.best_gait(), record=True)
    figure = one_step(result, time=(2.0, 7.0), instants=4, title=False)
    save_figure(figure, HERE, LAPSE, kinds=["svg"])
    print(network_table())
