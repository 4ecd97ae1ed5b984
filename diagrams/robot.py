"""The robot walking: how its tetrahedra move against each other (thesis Fig. 14), and the signals
and tensions of its actuated cables (Fig. 19).

Writes the block diagram and the figure, and prints distance and signals beside the thesis's.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from tetra_drake import thesis
from tetra_drake.diagram import MakeTensegrityDiagram
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.figures.block_diagram import save_block_diagram
from tetra_drake.files import whole_file
from tetra_drake.gait import Gait, load_gait, seeded_gait
from tetra_drake.scenario import Scenario, load_scenario
from tetra_drake.simulation import SimulationResult, simulate
from tetra_drake.units import INCH, POUND_FORCE

if TYPE_CHECKING:
    import xarray


def relative_distances(trajectory: xarray.Dataset) -> xarray.DataArray:
    """(time, tetrahedron): x of each tetrahedron's centre of mass from that of T1, in m."""
    x = trajectory.p_WN.sel(axis="x").mean("node")
    return x - x.isel(tetrahedron=0)


def actuated_cable(junction: str) -> str:
    """One of the two cables that the junction's signal drives; the other mirrors it."""
    return f"{junction} outer bottom_left"


def draw(trajectory: xarray.Dataset) -> Figure:
    """Fig. 14 on the left, Fig. 19, one panel a junction, on the right."""
    with style.context("tableau-colorblind10"):
        figure = Figure(figsize=(11, 6.5), layout="constrained")
        left, right = figure.subfigures(1, 2, squeeze=False)[0]
        left.suptitle("Distances between tetrahedra (Fig. 14)")
        _draw_distances(left.subplots(), relative_distances(trajectory))
        right.suptitle("Signals and tensions of actuated cables (Fig. 19)")
        _draw_cables(right, trajectory)
    return figure


def _draw_distances(panel: Axes, distances: xarray.DataArray) -> None:
    for name in distances.tetrahedron.values:
        inches = distances.sel(tetrahedron=name) / INCH
        # Each line says at its end what it is, so that all may have one colour.
        panel.plot(distances.time, inches, color="black")
        panel.annotate(name, (1.01, inches[-1]), xycoords=("axes fraction", "data"), va="center")
    panel.set_xlabel("time (s)")
    panel.set_ylabel("distance from T1 along x (in)")
    panel.margins(x=0)
    panel.grid(alpha=0.4)


def _draw_cables(figure: SubFigure, trajectory: xarray.Dataset) -> None:
    junctions = trajectory.junction.values
    panels = figure.subplots(len(junctions), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for panel, junction in zip(panels, junctions, strict=True):
        tension = trajectory.tension.sel(cable=actuated_cable(junction)) / POUND_FORCE
        signal = trajectory.signal.sel(junction=junction) / POUND_FORCE
        panel.plot(trajectory.time, tension, label="tension")
        panel.plot(trajectory.time, signal, "--", label="signal")
        panel.set_ylabel(f"{junction} (lbf)")
        panel.margins(x=0)
        panel.grid(alpha=0.4)
    panels[0].legend(loc="lower left", fontsize="small")
    panels[-1].set_xlabel("time (s)")


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
        return load_gait(path, oscillators=scenario.oscillators)
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
        with whole_file(options.out / "robot.png") as file:
            draw(result.trajectory).savefig(file, dpi=90)
    except InputError as error:
        parser.error(str(error))
    except SimulationFailure as error:
        parser.exit(1, f"{error}\n")
    print(report(gait, result))
    return 0


if __name__ == "__main__":
    sys.exit(main())
