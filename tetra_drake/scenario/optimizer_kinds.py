"""Kinds of optimisers and their settings."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tetra_drake.scenario.fields import refuse, setting
from tetra_drake.scenario.metric_units import METRICS

if TYPE_CHECKING:
    from tetra_drake.scenario.schema import Scenario


@dataclass
class SteadyState:
    """The thesis's evolutionary algorithm. Its settings are those of the section `evolution`."""

    def check(self, scenario: "Scenario", source: object) -> None:
        """Raises InputError if there are not enough evaluations for the first population."""
        evaluations, population = scenario.evolution.evaluations, scenario.evolution.population
        if evaluations < population:
            expected = f"at least the population, {population}"
            refuse(source, "evolution.evaluations", found=evaluations, expected=expected)


@dataclass
class CmaEs:
    """Covariance matrix adaptation by pycma (Hansen, arXiv 1604.00772): vectors are drawn from a
    normal distribution that learns from them. Where it has converged, it begins anew around the
    best gait, larger."""

    population: int | None = setting(at_least=4, at_most=100_000, default=None)
    """Vectors in an iteration; 4 + 3 ln n, rounded down, of n parameters if not given."""
    sample: int = setting(at_least=0, at_most=100_000, default=40)
    """Random gaits evaluated first."""
    starts: int = setting(at_least=1, at_most=1000, default=5)
    """Searches, of which the one with the best gait goes on: the first from the mean of the best
    quarter of the sample, the others from its best gaits; without a sample, from the middle of the
    ranges and random gaits. Fewer where trying them out would take more than half of the
    evaluations, and one more than the sample at most."""


@dataclass
class RandomSearch:
    """Random gaits, as many in an iteration as `evolution.population`: a baseline."""


@dataclass
class QualityDiversity:
    """Gaits that differ: a map of two metrics, in each of whose cells the fittest gait counts, by
    pyribs (extra `qd`). Several runs of CMA-ES look for gaits that raise the levels of cells, which
    follow the fittest gaits slowly (CMA-MAE, Fontaine and Nikolaidis, arXiv 2205.10752)."""

    measures: dict[str, list[float]] = setting(
        units=METRICS, length=2, default={"travelling_index": [0.0, 1.0], "lifted": [0.4, 0.6]}
    )
    """Two metrics and the range of each on the map. What lies outside counts to the cells at the
    edge."""
    cells: list[int] = setting(at_least=2, at_most=1000, length=2, default=[20, 20])
    """Of each metric."""
    draws: int = setting(at_least=0, at_most=10_000, default=10)
    """In the end, each gait of the map is simulated in as many draws of disturbances."""

    def check(self, scenario: "Scenario", source: object) -> None:
        """Raises InputError unless there are two measures, each with a range."""
        if len(self.measures) != 2:
            found, expected = f"{len(self.measures)} metrics", "two, one for each side of the map"
            refuse(source, "optimizer.measures", found=found, expected=expected)
        for name, (low, high) in self.measures.items():
            if low >= high:
                expected = f"less than the range's end, {high}"
                refuse(source, f"optimizer.measures.{name}", found=low, expected=expected)


OptimizerKind = SteadyState | CmaEs | RandomSearch | QualityDiversity
"""What `optimizer` may be; without a tag it is the first."""
