"""Sections of an experiment: their settings with units, limits and defaults.

The type of a field gives its unit; values are in SI units. A field without a default must be in the
file.
"""

from __future__ import annotations

import operator
from typing import Annotated, Any

from pydantic import AfterValidator, Field, WithJsonSchema

from tetra_drake.settings.quantities import TWO, Keyed, Time, different_keys
from tetra_drake.settings.section import Section

BodyBound = Annotated[Any, WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}]})]
"""A bound of a number in SI, or a text with a unit. Its key decides which units are possible."""

BodyBounds = Annotated[Keyed[str, Annotated[list[BodyBound], TWO]], AfterValidator(different_keys)]
"""Least and greatest value of numbers of the robot, by scenario key or by joined keys."""

BODY_SECTIONS = ("robot", "actuation", "cpg", "friction", "ground", "strut_contact")
"""Sections of a scenario whose numbers can evolve with the gait."""


class EvolutionSection(Section):
    """Number and length of an evolution's trials, which are independent runs, for any optimiser."""

    trials: int = Field(ge=1, le=1000)
    """Number of independent trials, each with another seed."""
    evaluations: int = Field(ge=1)
    """Number of gaits that a trial evaluates at most: for !SteadyState its population, then two an
    iteration."""
    time_budget: Time = Field(gt=0)
    """Longest CPU time of a simulation; beyond, it counts as failed."""


Spread = Annotated[float, Field(gt=0, le=0.5)]


class Cuts(Section):
    """Cables that break in each draw of disturbances, chosen at random."""

    count: int = Field(default=1, ge=1)
    """Number of cables."""
    at: Time = Field(default=0.0, ge=0)
    """Time at which they break."""


class Disturbances(Section):
    """Random changes of robot and surroundings during evolution. A draw is one set of such changes,
    and another terrain seed if the terrain has one. Every gait is simulated once in each draw; all
    gaits of an iteration have the same draws.
    """

    draws: int = Field(ge=1, le=10_000)
    """Number of draws."""
    spreads: Annotated[Keyed[str, Spread], AfterValidator(different_keys)] = Field(default={})
    """Relative spreads by scenario key: a draw multiplies the number by 1 - spread to 1 + spread.
    Keys joined by commas get one factor."""
    start: float = Field(default=0.0, ge=0, le=0.5)
    """Largest displacement of each body at t = 0 along x, y and up, as a share of the spacing of
    tetrahedra, or of the shortest strut."""
    cuts: Cuts | None = Field(default=None, exclude_if=operator.not_)
    """Cables that break in each draw."""
    tail: float = Field(default=1.0, gt=0, le=1)
    """Share of the draws, the worst and at least one, whose mean is the fitness (conditional value
    at risk)."""
