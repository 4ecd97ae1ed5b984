"""Kinds of optimisers and their settings."""

from dataclasses import dataclass

from tetra_drake.scenario.fields import setting


@dataclass
class SteadyState:
    """The thesis's evolutionary algorithm. Its settings are those of the section `evolution`."""


@dataclass
class CmaEs:
    """Covariance matrix adaptation by pycma (Hansen, arXiv 1604.00772): vectors are drawn from a
    normal distribution that learns from them. Where it has converged, it begins anew, larger."""

    population: int | None = setting(at_least=4, default=None)
    """Vectors in an iteration; 4 + 3 ln n, rounded down, of n parameters if not given."""
    sigma: float = setting(above=0, default=0.5)
    """Standard deviation at the start, as a share of each parameter's range in random gaits."""
    sample: int = setting(at_least=0, default=0)
    """Random gaits evaluated first, of which the best is the start; 0: the middle of the ranges."""
    tolerance: float = setting(above=0, default=1e-3)
    """A run has converged where all standard deviations are below this, in the same units."""
    growth: float = setting(at_least=1, default=2.0)
    """Factor on the population at each restart (IPOP)."""


@dataclass
class DifferentialEvolution:
    """Differential evolution that adapts itself: L-SHADE (Tanabe and Fukunaga, CEC 2014)."""

    population: int = setting(at_least=8, default=50)
    """Vectors in the first iteration; falls evenly to 4 in the last one."""
    greed: float = setting(above=0, at_most=1, default=0.11)
    """Share of the population, the best, towards which each vector is moved."""


@dataclass
class RandomSearch:
    """Random gaits, as many in an iteration as `evolution.population`: a baseline."""


OptimizerKind = SteadyState | CmaEs | DifferentialEvolution | RandomSearch
"""What `optimizer` may be; without a tag it is the first."""
