"""The robot walking: how its tetrahedra move against each other (thesis Fig. 14), and the signals
and tensions of its actuated cables (Fig. 19).

Writes the block diagram and the figures, and prints distance and signals beside the thesis's.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tetra_drake import thesis
from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.figures.block_diagram import save_block_diagram
from tetra_drake.figures.forces import figure_19_signal_and_tension
from tetra_drake.figures.motion import figure_14_relative_distances
from tetra_drake.figures.style import save_figure
from tetra_drake.results.measures import actuated_cable
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait, load_gait, seeded_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import POUND_FORCE
from tetra_drake.systems.diagram import MakeTensegrityDiagram


def report(gait: Gait, result: SimulationResult) -> str:
    """Distance, signals and tensions, the thesis's numbers beside ours."""
    trajectory = result.trajectory
    assert trajectory is not None
    cables = [actuated_cable(junction) for junction in trajectory.junction.values]
    tension = trajectory.tension.sel(cable=cables) / POUND_FORCE
    signal = np.ptp(trajectory.signal.values, axis=0).max() / POUND_FORCE
    return (
        f"{gait.name}: {result.metrics.distance_in:.2f} in in {result.duration:g} s (thesis: "
        f"{thesis.BEST_INITIAL_DISTANCE_IN:g} in for the best random gait, "
        f"{thesis.BEST_EVOLVED_DISTANCE_IN:g} in for the best evolved one)\n"
        f"largest signal, peak to peak: {signal:.2f} lbf (thesis: one pound); "
        f"tensions: {float(tension.min()):.2f} to {float(tension.max()):.2f} lbf"
    )


def choose_gait(path: Path | None, scenario: Scenario) -> Gait:
    """The gait in the file, or without one a random one that walks."""
    if path is not None:
        return load_gait(path, scenario)
    return seeded_gait(scenario)


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the pictures and prints the numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gait", metavar="FILE", type=Path, help="default: a random gait")
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path(__file__).parent)
    options = parser.parse_args(arguments)
    scenario = load_scenario("thesis")
    try:
        gait = choose_gait(options.gait, scenario)
        save_block_diagram(MakeTensegrityDiagram(scenario, gait), options.out / "robot.svg")
        result = simulate(scenario=scenario, gait=gait, record=True)
        assert result.trajectory is not None
        distances = figure_14_relative_distances(result.trajectory)
        tensions = figure_19_signal_and_tension(result.trajectory)
        save_figure(distances, options.out, "figure_14", kinds=["svg"])
        save_figure(tensions, options.out, "figure_19", kinds=["svg"])
    except InputError as error:
        parser.error(str(error))
    except SimulationFailure as error:
        parser.exit(1, f"{error}\n")
    print(report(gait, result))
    return 0


if __name__ == "__main__":
    sys.exit(main())
