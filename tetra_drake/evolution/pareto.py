"""What a run's gaits trade distance against: fronts of the best trades, and their champions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas

from tetra_drake.evolution.tables import Run

NEAREST = 0.5
"""The champions other than the farthest walk this share of its distance or more: what hardly walks
is easily cheap."""


@dataclass(frozen=True)
class Trade:
    """A number of a gait that is wanted beside its distance."""

    name: str
    champion: str
    """What the gait is called that is best in it."""
    column: str
    """Of `Run.evaluations`."""
    per_inch: bool
    """Whether it is the column's share of the distance, both in inches."""
    wanted: float
    """1 if it is to be great, -1 if small."""

    def of(self, gaits: Any) -> Any:
        """The number of each row of evaluations, or of one."""
        return gaits[self.column] / gaits["distance_in"] if self.per_inch else gaits[self.column]


COST = Trade("cost of transport", "cheapest", "cost_of_transport", per_inch=False, wanted=-1.0)
STEADINESS = Trade(
    "steadiness (worst draw / mean)", "steadiest", "worst_distance_in", per_inch=True, wanted=1.0
)
"""The distance in a gait's worst draw as a share of its mean distance. Gaits of different
iterations met different draws, and luck is chosen, too: fresh draws tell what is robust."""

TRADES = (COST, STEADINESS)


def pareto_front(points: np.ndarray) -> np.ndarray:
    """Which of the points (k, 2) no other one dominates, as booleans (k,).

    One that is at least as great in both columns, and greater in one, dominates. Equal points are
    in the front together; points with NaN are not.
    """
    known = ~np.isnan(points).any(axis=1)
    distinct, places = np.unique(points[known], axis=0, return_inverse=True)
    second = distinct[::-1, 1]  # from the greatest in the first column on, ties from the second's
    before = np.maximum.accumulate(np.r_[-np.inf, second])[:-1]
    front = np.zeros(len(points), dtype=bool)
    front[known] = (second > before)[::-1][places.ravel()]
    return front


def forward_gaits(evaluations: pandas.DataFrame) -> pandas.DataFrame:
    """Those evaluations with a fitness that walk forward."""
    return evaluations.dropna(subset="fitness").query("distance > 0.0")


def trades(gaits: pandas.DataFrame) -> list[Trade]:
    """Those of TRADES whose number a gait of forward_gaits() has: none in older records."""
    known = gaits.columns[gaits.notna().any()]
    return [trade for trade in TRADES if trade.column in known]


def front_of(gaits: pandas.DataFrame, trade: Trade) -> pandas.DataFrame:
    """The gaits whose trade of distance no other one dominates, the farthest first."""
    points = np.column_stack([gaits["distance"], trade.wanted * trade.of(gaits)])
    return gaits[pareto_front(points)].sort_values("distance", ascending=False, kind="stable")


def champions(run: Run) -> dict[str, pandas.Series]:
    """By name, the farthest of the gaits that walk forward and, for each trade, the best in it that
    walks at least NEAREST as far: rows of the evaluations. Empty where there is no trade."""
    gaits = forward_gaits(run.whole)
    near = gaits[gaits["distance"] >= NEAREST * gaits["distance"].max()]
    best = {"farthest": gaits["distance"].idxmax()} if trades(gaits) else {}
    for trade in trades(near):
        best[trade.champion] = front_of(near, trade).index[-1]
    return {name: gaits.loc[row] for name, row in best.items()}


def distinct_gaits(named: Mapping[str, pandas.Series]) -> list[tuple[list[str], pandas.Series]]:
    """The different ones among named gaits, each with all of its names."""
    names: dict[Any, list[str]] = {}
    for name, gait in named.items():
        names.setdefault((gait["trial"], gait["index"]), []).append(name)
    return [(each, named[each[0]]) for each in names.values()]
