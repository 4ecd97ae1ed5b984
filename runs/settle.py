"""Compares the trials of two recorded runs: which walk farther, and how sure is that?

    python runs/settle.py runs/rough runs/rough-feedback

Prints the mean over the trials' best gaits of their distances (in), where they were evolved, on
unseen ground and on disturbed robots, and the difference of the means with its 95 % interval, by
bootstrap over the trials.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from analyse import Analysis, load_analysis

from tetra_drake.analysis.statistics import RESAMPLES
from tetra_drake.errors import InputError
from tetra_drake.formatting import Table, fixed, listed, ranged
from tetra_drake.scenario.units import INCH


def distances(analysis: Analysis) -> dict[str, np.ndarray]:
    """Distances (in) of the trials' best gaits, (trials,) each, by where they walk."""
    by_place = {
        "where it was evolved": analysis.gaits["undisturbed"].to_numpy() / INCH,
        "on 200 disturbed robots": analysis.gaits["mean"].to_numpy() / INCH,
    }
    if len(analysis.unseen):
        unseen = analysis.unseen.groupby("trial")["distance_in"].mean()
        by_place["on 20 unseen grounds"] = unseen.to_numpy()
    return by_place


def difference_of_means(one: np.ndarray, other: np.ndarray) -> tuple[float, float, float]:
    """Mean of `other` (m,) less that of `one` (n,), and its 95 % interval by bootstrap."""
    generator = np.random.default_rng(0)
    resampled = [
        values[generator.integers(len(values), size=(RESAMPLES, len(values)))].mean(axis=1)
        for values in (one, other)
    ]
    low, high = np.quantile(resampled[1] - resampled[0], [0.025, 0.975])
    return float(other.mean() - one.mean()), float(low), float(high)


def settled(first: Path, second: Path) -> Table:
    """The comparison of two runs."""
    one, other = (distances(load_analysis(run)) for run in (first, second))
    rows = []
    for place in [place for place in one if place in other]:
        means = [fixed(values[place].mean()) for values in (one, other)]
        rows.append([place, *means, ranged(*difference_of_means(one[place], other[place]))])
    return Table(["mean distance, in", first.name, second.name, "difference"], rows)


def main(runs: list[str]) -> None:
    """Compares two runs."""
    if len(runs) != 2:
        raise InputError("RUN RUN", "", f"found {listed(runs)}, expected two runs")
    print(settled(Path(runs[0]), Path(runs[1])).markdown())


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except InputError as error:
        sys.exit(f"settle.py: {error}")
