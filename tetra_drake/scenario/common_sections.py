"""Sections of a scenario: their settings with units, limits and defaults.

The type of a field gives its unit; values are in SI units. A field without a default must be in the
file.
"""

from __future__ import annotations

import operator
from collections import Counter
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, Field, WithJsonSchema, model_validator

from tetra_drake.errors import InputError
from tetra_drake.settings.quantities import Keyed, Speed, Time, Value
from tetra_drake.settings.refusals import refuse
from tetra_drake.settings.section import Section


def separate(joined: str) -> list[str]:
    """Splits a key that joins scenario keys by commas: "cpg.gain, robot.density" gives two keys."""
    return [key.strip() for key in joined.split(",")]


def different_keys(by_joined: Mapping[str, Value], *, source: str = "") -> Mapping[str, Value]:
    """Checks a mapping whose keys may each name several scenario keys, such as "a.b, c.d", and
    returns it. Raises InputError, naming `source`, if a scenario key occurs twice."""
    counts = Counter(key for joined in by_joined for key in separate(joined))
    for key, count in counts.items():
        if count > 1:
            raise InputError(source, key, "is given twice")
    return by_joined


BodyBound = Annotated[Any, WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}]})]
"""A bound of a number in SI, or a text with a unit. Its key decides which units are possible."""

BodyBounds = Annotated[
    Keyed[str, Annotated[list[BodyBound], Field(min_length=2, max_length=2)]],
    AfterValidator(different_keys),
]
"""Least and greatest value of numbers of the robot, by scenario key or by joined keys."""

BODY_SECTIONS = ("robot", "actuation", "cpg", "friction", "ground", "strut_contact")
"""Sections of a scenario whose numbers can evolve with the gait."""

LONGEST_SETTLING = 3.0
"""Upper limit (s) of the default of SimulationSection.steady_from."""


class SimulationSection(Section):
    """Duration and sampling of a simulation, and limits beyond which it fails."""

    duration: Time = Field(gt=0, le=1e5)
    """Simulated time."""
    steady_from: Time | None = Field(default=None, ge=0)
    """Time at which the steady walk begins, for fitness and metrics (thesis section 2.3). If not
    given, a quarter of the duration, at most 3 s."""
    max_evaluations: int = Field(ge=1)
    """Largest number of evaluations of the derivatives in one simulation."""
    sample_period: Time = Field(gt=0)
    """Time between samples of a recorded trajectory."""
    control_period: Time = Field(default=0.02, gt=0)
    """Time between actions of a controller. See td.Simulation."""
    max_speed: Speed | None = Field(default=None, gt=0)
    """Speed of a body above which a simulation has diverged. If not given, a speed that the energy
    of fall, cables and actuators cannot give; at least 10.16 m/s."""

    @property
    def settling_time(self) -> float:
        """Time (s) at which the steady walk begins: `steady_from`, or its default."""
        default = min(LONGEST_SETTLING, self.duration / 4.0)
        return default if self.steady_from is None else self.steady_from

    @model_validator(mode="after")
    def _check(self) -> SimulationSection:
        if self.settling_time >= self.duration:
            problem = f"found {self.steady_from} s, expected less than the duration"
            refuse("steady_from", f"{problem}, {self.duration} s; null is a quarter of it")
        return self


class EvolutionSection(Section):
    """Number and length of an evolution's trials, which are independent runs, for any optimiser."""

    trials: int = Field(ge=1, le=1000)
    """Number of independent trials, each with another seed."""
    evaluations: int = Field(ge=1)
    """Number of gaits that a trial evaluates, unless it ends early. !SteadyState evaluates its
    population, then two gaits in each iteration."""
    time_budget: Time = Field(gt=0)
    """Longest wall time of a simulation; one that takes longer counts as failed."""


Spread = Annotated[float, Field(gt=0, le=0.5)]


class Cuts(Section):
    """Cables that break in each draw of disturbances, chosen at random."""

    count: int = Field(default=1, ge=1)
    """Number of cables."""
    at: Time = Field(default=0.0, ge=0)
    """Time at which they break."""


class Disturbances(Section):
    """Random changes of robot and surroundings during evolution. A draw is one set of such changes.

    Every gait is simulated once in each draw. All gaits of an iteration have the same draws. Each
    draw also has another terrain seed, if the terrain has a seed.
    """

    draws: int = Field(ge=1, le=10_000)
    """Number of draws. Each gait is simulated once in each draw."""
    spreads: Annotated[Keyed[str, Spread], AfterValidator(different_keys)] = Field(default={})
    """Relative spreads of numbers, by scenario key. Each draw multiplies the number by a factor
    from 1 - spread to 1 + spread. Keys joined by commas get the same factor."""
    start: float = Field(default=0.0, ge=0, le=0.5)
    """Largest displacement of a body at t = 0 along x, y and up, as a share of the spacing of
    tetrahedra, or of the shortest strut of a structure. Each draw displaces every body."""
    cuts: Cuts | None = Field(default=None, exclude_if=operator.not_)
    """Cables that break in each draw; none if not given. A gait that copes is one that walks in all
    draws."""
    tail: float = Field(default=1.0, gt=0, le=1)
    """Share of the draws, the worst ones, whose mean is a gait's fitness (the conditional value at
    risk). 1 is the mean over all draws. At least one draw counts."""
