"""The population a trial has come to, read back from its record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.evolution.optimizers.base import Genome

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class Member:
    """One gait of a population."""

    evaluation: int
    """Its index in the trial."""
    fitness: float
    genome: Genome


def last_population(evaluations: pandas.DataFrame) -> pandas.DataFrame:
    """The rows of the members of a trial's population after its last recorded iteration.

    `evaluations` are those of one trial, as load_run gives them. Each row says in `placed`
    whose place it took, so the last row of a place is the one that is still there.
    """
    placed = evaluations[evaluations["placed"].notna()].sort_values("index")
    return placed.drop_duplicates("placed", keep="last").sort_values("placed")


def two_best(evaluations: pandas.DataFrame) -> tuple[Member, Member] | None:
    """The two fittest different genomes of a trial's last population; None if there are no two.

    Members that have failed do not count; of equally fit ones the earlier counts as better.
    """
    population = last_population(evaluations).dropna(subset="fitness")
    ranked = population.sort_values(["fitness", "index"], ascending=[False, True])
    columns = genome_columns(evaluations)
    distinct = ranked.drop_duplicates(columns)
    if len(distinct) < 2:
        return None
    first, second = (
        Member(
            evaluation=int(row["index"]),
            fitness=float(row["fitness"]),
            genome=row[columns].to_numpy(dtype=np.float64),
        )
        for _, row in distinct.iloc[:2].iterrows()
    )
    return first, second


def genome_columns(evaluations: pandas.DataFrame) -> list[str]:
    """The columns that make a genome, in its order."""
    weights = [name for name in evaluations if name.startswith("weight_")]
    return [*weights, "tau_a_s", "tau_b_s"]
