"""Draws how far the two engines agree on the random gaits of a recorded run.

    python runs/engines.py runs/thesis

Writes figures/both_engines.svg to the run's folder, of the initial gaits that `tetra-drake
reevaluate RUN --initial` has evaluated on the Drake diagram, too.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas
from matplotlib.figure import Figure

from tetra_drake.evolution.tables import Run, load_run
from tetra_drake.figures.style import OKABE_ITO, REFERENCE, common_style, make_figure, save_figure


def distances_on_both(run: Run) -> pandas.DataFrame:
    """Distances of the gaits that were evaluated again on the Drake diagram.

    Columns: trial, index, iteration, compiled_in and drake_in (NaN where a gait failed).
    """
    key = ["trial", "index"]
    compiled = run.evaluations[[*key, "iteration", "distance_in"]]
    drake = run.reevaluations.reindex(columns=[*key, "distance_in"])
    both = compiled.merge(drake, on=key, validate="one_to_one")
    return both.rename(columns={"distance_in_x": "compiled_in", "distance_in_y": "drake_in"})


@common_style()
def both_engines(distances: pandas.DataFrame) -> Figure:
    """Distances of gaits on the diagram over those on the compiled engine (left), and the share
    of the gaits below each absolute difference (right)."""
    compiled, drake = distances["compiled_in"], distances["drake_in"]
    difference = (compiled - drake).abs().clip(lower=1e-4).sort_values()  # logarithmic axis
    figure, [[scatter, shares]] = make_figure(width_in=8.0, height_in=4.2, columns=2)
    ends = [min(compiled.min(), drake.min()), max(compiled.max(), drake.max())]
    scatter.plot(ends, ends, label="equal", **REFERENCE)
    dots: Any = {"alpha": 0.6, "markersize": 2.5, "markeredgewidth": 0.0}
    scatter.plot(compiled, drake, "o", color=OKABE_ITO["blue"], label="gait", **dots)
    scatter.set(aspect="equal", xlabel="compiled engine (in)", ylabel="Drake diagram (in)")
    scatter.margins(0.04)
    scatter.legend(loc="upper left")
    percent = 100.0 * np.arange(1, len(difference) + 1) / len(difference)
    shares.step(difference, percent, where="post", color=OKABE_ITO["blue"])
    for height in (50, 95):
        value = difference.quantile(height / 100)
        shares.plot(value, height, "o", color=OKABE_ITO["vermillion"])
        place: Any = {"xytext": (-6, 4), "textcoords": "offset points", "ha": "right"}
        shares.annotate(f"{height} %: {value:.2g} in", (value, height), **place)
    shares.set(xscale="log", xlabel="absolute difference (in)")
    shares.set(ylim=(0.0, 102.0), ylabel="gaits with a smaller difference (%)")
    figure.suptitle(f"Distances of {len(distances)} gaits on both engines")
    return figure


if __name__ == "__main__":
    for folder in map(Path, sys.argv[1:]):
        initial = distances_on_both(load_run(folder)).query("iteration == 0").dropna()
        save_figure(both_engines(initial), folder / "figures", "both_engines")
