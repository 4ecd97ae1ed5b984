"""Kinds of optimisers and their settings."""

from dataclasses import dataclass

from tetra_drake.scenario.fields import setting
from tetra_drake.scenario.metric_units import METRICS


@dataclass
class SteadyState:
    """The thesis's evolutionary algorithm. Its settings are those of the section `evolution`."""


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
    tryout: int = setting(at_least=1, default=350)
    """Evaluations in which each of them is tried out."""
    sigma: float = setting(above=0, default=0.2)
    """Standard deviation at the start, as a share of each parameter's range in random gaits (in its
    middle; smaller near a floor)."""
    tolerance: float = setting(above=0, default=0.05)
    """It has converged where all standard deviations are below this share of the ranges."""
    growth: float = setting(at_least=1, default=2.0)
    """Factor on the population at each restart (IPOP)."""


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
    floor: float = setting(default=0.0)
    """The fitness that gaits on the map exceed: the level of all cells at the start."""
    learning_rate: float = setting(above=0, at_most=1, default=0.01)
    """Share of the way to a better gait's fitness by which it raises the level of its cell."""
    emitters: int = setting(at_least=1, at_most=1000, default=4)
    """Runs of CMA-ES side by side."""
    batch: int = setting(at_least=2, at_most=100_000, default=15)
    """Vectors of each in an iteration."""
    sigma: float = setting(above=0, default=0.5)
    """As of !CmaEs; starts are random gaits and, where one begins anew, gaits of the map."""
    draws: int = setting(at_least=0, at_most=10_000, default=10)
    """In the end, each gait of the map is simulated in as many draws of disturbances."""


OptimizerKind = SteadyState | CmaEs | RandomSearch | QualityDiversity
"""What `optimizer` may be; without a tag it is the first."""
