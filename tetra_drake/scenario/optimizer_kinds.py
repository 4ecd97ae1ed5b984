"""Optimisers that a scenario can choose, and their settings."""

from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field

from tetra_drake.scenario.metrics import UNITS
from tetra_drake.settings.plugins import OPTIMIZERS
from tetra_drake.settings.quantities import TWO, Time, by_name
from tetra_drake.settings.section import Kinds, Section

MOST_GAITS = 100_000
"""Largest number of gaits in a population or a sample."""


class OptimizerSettings(Section):
    """Base class of the settings of an optimiser. A scenario chooses the optimiser by its kind."""

    module: ClassVar[str] = "tetra_drake.optimizers"
    """Module of the optimiser: a class that has the name of the kind and "Optimizer", such as
    CmaEsOptimizer. It takes the arguments of optimizers.base.MakeOptimizer, and `settings`."""
    package: ClassVar[str] = ""
    """Package that only this optimiser needs."""
    extra: ClassVar[str] = ""
    """Extra of this project that installs the package."""
    map: ClassVar[str] = ""
    """Module with judge_elites(), elites(), notable_gaits() and map_of_gaits() of the map that the
    optimiser fills; empty without map."""


class SteadyState(OptimizerSettings):
    """The thesis's evolutionary algorithm (its Table 6, section 2.3, appendix A)."""

    population: int = Field(default=50, ge=2, le=MOST_GAITS)
    """Number of gaits in the population."""
    tournament: int = Field(default=5, ge=1, le=MOST_GAITS)
    """Number of gaits drawn for a parent, or for the gait that a child replaces."""
    crossover_probability: float = Field(default=0.2, ge=0, le=1)
    """Probability that two children swap a parameter."""
    mutation_probability: float = Field(default=0.7, ge=0, le=1)
    """Probability that a parameter mutates."""
    weight_mutation: float = Field(default=0.2, ge=0)
    """Largest change of a weight in one mutation."""
    tau_mutation: Literal["intended", "listing"] = "intended"
    """Whether mutation changes tau_A, or never does, as in the thesis's `listing` A.3.4."""
    tau_mutation_range: Time = Field(default=0.05, ge=0)
    """Largest change of tau_A in one mutation."""
    stop_rise: float = Field(default=0.03, ge=0)
    """Least rise of the mean fitness in `stop_window` iterations; with less a trial ends early."""
    stop_window: int = Field(default=100, ge=1)
    """Number of iterations for `stop_rise`."""
    stop_after: int = Field(default=200, ge=0)
    """Iteration before which no trial ends early."""


class CmaEs(OptimizerSettings):
    """Covariance matrix adaptation by pycma (Hansen, arXiv 1604.00772).

    Gaits are drawn from a normal distribution that adapts to the fittest. A search that has
    converged restarts around its best gait, with twice the population; one that has stalled begins
    elsewhere.
    """

    population: int | None = Field(default=None, ge=4, le=MOST_GAITS)
    """Number of vectors in an iteration; by default 4 + 3 ln n, rounded down."""
    sample: int = Field(default=40, ge=0, le=MOST_GAITS)
    """Number of random gaits that are evaluated before each search."""
    starts: int = Field(default=5, ge=1, le=1000)
    """Number of searches that are tried, for 1,000 evaluations each and half of all at most; the
    best continues. A search starts at the mean of the best quarter of its sample, or without one in
    the middle of the ranges or at random."""


class RandomSearch(OptimizerSettings):
    """Baseline for other optimisers: all gaits are random."""


def _checked_range(ends: list[float]) -> list[float]:
    low, high = ends
    if low >= high:
        raise ValueError(f"found {low}, expected less than the range's end, {high}")
    return ends


CellCount = Annotated[int, Field(ge=2, le=1000)]


class QualityDiversity(OptimizerSettings):
    """Search for a map of two metrics with the fittest gait in each cell.

    By CMA-MAE of pyribs (extra `qd`; Fontaine and Nikolaidis, arXiv 2205.10752): a cell's level of
    fitness slowly follows its fittest gait, and several runs of CMA-ES look for gaits above the
    level of their cell.
    """

    module: ClassVar[str] = "tetra_drake.lab.elites.quality_diversity"
    package, extra = "ribs", "qd"
    map: ClassVar[str] = "tetra_drake.lab.elites.elites"

    measures: Annotated[
        dict[str, list[float]],
        *by_name(UNITS, lambda x: Annotated[list[x], TWO, AfterValidator(_checked_range)]),
    ] = Field(
        default={"travelling_index": [0.0, 1.0], "lifted": [0.4, 0.6]}, min_length=2, max_length=2
    )
    """Two metrics with their ranges on the map; cells at the edge also have what is outside."""
    cells: list[CellCount] = Field(default=[20, 20], min_length=2, max_length=2)
    """Number of cells along each metric."""
    draws: int = Field(default=10, ge=0, le=10_000)
    """Number of draws of disturbances; each gait of the map is simulated in all at the end."""


OptimizerKind = Annotated[
    SteadyState | CmaEs | RandomSearch | QualityDiversity, Kinds(OptimizerSettings, OPTIMIZERS)
]
"""Optimiser of a scenario, with its settings. A mapping without a tag is a SteadyState."""
