"""Comparison of the trials of two recorded runs: mean numbers of their best gaits, and differences
of the means with 95 % confidence intervals, by bootstrap over the trials."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from analyse import Analysis, load_analysis
from page import rendered

from tetra_drake.formatting import ranged
from tetra_drake.lab.study.statistics import interval_of_resamples, resampled
from tetra_drake.settings.units import INCH


def numbers(analysis: Analysis) -> dict[str, np.ndarray]:
    """Numbers of the trials' best gaits (trials,), by name."""
    disturbed = analysis.disturbed
    by_name = {
        "distance where it was evolved, in": disturbed["undisturbed"].to_numpy() / INCH,
        "mean distance on disturbed robots, in": disturbed["mean"].to_numpy() / INCH,
        "share of disturbed robots that keep the gait, %": 100.0 * disturbed["kept"].to_numpy(),
    }
    if len(analysis.unseen):
        unseen = analysis.unseen.fillna({"distance_in": 0.0})
        unseen["valid_in"] = unseen["distance_in"] * unseen["met"]
        walks = unseen.assign(met=100.0 * unseen["met"]).groupby("trial").mean()
        by_name["mean distance on unseen ground, in"] = walks["distance_in"].to_numpy()
        by_name["share of these walks that meet the requirements, %"] = walks["met"].to_numpy()
        by_name["mean distance, 0 where they are not met, in"] = walks["valid_in"].to_numpy()
    return by_name


def difference_of_means(one: np.ndarray, other: np.ndarray) -> tuple[float, float, float]:
    """Mean of `other` (m,) minus mean of `one` (n,), and its 95 % interval by bootstrap."""
    generator = np.random.default_rng(0)
    means = resampled(one, generator).mean(axis=1)
    other_means = resampled(other, generator).mean(axis=1)
    return float(other.mean() - one.mean()), *interval_of_resamples(other_means - means)


def settled(first: Path, second: Path) -> str:
    """Table of the comparison of two runs."""
    one, other = (numbers(load_analysis(run)) for run in (first, second))
    names = {"first": first.name, "second": second.name}
    tools = {"ranged": ranged, "difference": difference_of_means}
    return rendered("settled.md", **names, one=one, other=other, **tools)
