"""Parameter space that evolution searches: vectors of gaits and of the bodies beside them."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np
import numpy.typing as npt

from tetra_drake.errors import InputError, check_whole
from tetra_drake.laws.oscillator import GaitParameter
from tetra_drake.robot.gait import Body, Gait, check_parameters
from tetra_drake.scenario.joined_keys import separate
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.quantities import Quantity
from tetra_drake.settings.section import written
from tetra_drake.settings.units import given_quantity

Vector = npt.NDArray[np.float64]
"""Parameters of a gait, in the order of ParameterSpace.names."""


def with_body(scenario: Scenario, gait: Gait) -> tuple[Scenario, Gait]:
    """A scenario with the numbers of a gait's body, and the gait without them.

    Nothing changes for a gait that evolved without a body. Otherwise the scenario has no section
    `evolve`. Raises InputError if the scenario cannot have such a robot.
    """
    if not gait.body:
        return scenario, gait
    changes = {key: value for joined, value in gait.body for key in separate(joined)}
    changed = scenario.with_sections(evolve={}).with_changes(changes)
    return changed, dataclasses.replace(gait, body=())


@dataclass(frozen=True)
class ParameterSpace:
    """Parameter space of a scenario's gaits, for your own search algorithm.

    A vector has the parameters of a gait, and the numbers of the body in SI that `evolve` of the
    scenario leaves free. Parameters that copy another one are left out. Pairs like tau_A and tau_B,
    where one follows the other, are behind the body.

    >>> space = td.ParameterSpace.of("thesis")
    >>> vector = space.repair(0.5 * (space.low + space.high))
    >>> space.gait(vector, name="middle")
    <Gait middle>
    """

    parameters: Mapping[str, GaitParameter]
    """All parameters of a gait by name; see Scenario.parameters."""
    evolve: Mapping[str, Sequence[float]] = field(default_factory=dict)
    """Bounds of the numbers of the body, also of fixed ones; see Scenario.evolve."""
    turn: float = 0.0
    """Steering of all gaits; see Gait.turn."""

    @classmethod
    def of(cls, scenario: GivenScenario) -> Self:
        """The parameter space of a scenario, given by its name or file, or by a run. A parameter
        with equal bounds is fixed."""
        scenario = given_scenario(scenario)
        return cls(scenario.parameters, scenario.evolve, scenario.gait_bounds.turn)

    @functools.cached_property
    def free_body(self) -> tuple[str, ...]:
        """Keys of the numbers of the body that are parameters: their bounds differ."""
        return tuple(key for key, (low, high) in self.evolve.items() if low < high)

    @functools.cached_property
    def names(self) -> tuple[str, ...]:
        """Names such as "weight 3->1 extensor", "gain length", "robot.density", "tau_A"."""
        searched = {name: one for name, one in self.parameters.items() if not one.copies}
        pairs = {(name, one.leader) for name, one in searched.items() if one.leader}
        in_pairs = {name for pair in pairs for name in pair}
        alone = [name for name in searched if name not in in_pairs]
        return (*alone, *self.free_body, *(name for name in searched if name in in_pairs))

    @property
    def body(self) -> slice:
        """Places of the body's numbers in a vector."""
        first = self.names.index(self.free_body[0]) if self.free_body else 0
        return slice(first, first + len(self.free_body))

    @functools.cached_property
    def _rows(self) -> list[GaitParameter]:
        """Parameters in the order of a vector."""
        body = {key: GaitParameter(low, high) for key, (low, high) in self.evolve.items()}
        return [body[name] if name in body else self.parameters[name] for name in self.names]

    @functools.cached_property
    def low(self) -> Vector:
        """Lower bounds of the parameters of random gaits (Table 5)."""
        return np.array([row.low for row in self._rows], dtype=float)

    @functools.cached_property
    def high(self) -> Vector:
        """Upper bounds of the parameters of random gaits."""
        return np.array([row.high for row in self._rows], dtype=float)

    @functools.cached_property
    def floors(self) -> Vector:
        """Lower limits of the search. Mutation keeps parameters above (listing A.3.3, A.3.4)."""
        return np.array([row.floor for row in self._rows], dtype=float)

    @functools.cached_property
    def is_coupled(self) -> npt.NDArray[np.bool_]:
        """True for parameters that are always a multiple of another one, as tau_B is of tau_A."""
        return np.array([bool(row.leader and row.coupled) for row in self._rows], dtype=bool)

    def gait(self, vector: npt.ArrayLike, *, name: str) -> Gait:
        """Gait called `name` with the parameters of a vector (parameters,), in the order of
        `names`; the bounds are not checked. Raises InputError for a vector of another size, or for
        a number that no gait may have, such as a weight below 0."""
        values = dict(zip(self.names, self._numbers(vector).tolist(), strict=True))
        own = {key: values[one.copies or key] for key, one in self.parameters.items()}
        check_parameters(own, self.parameters, source=f"gait {name}")
        return Gait(name, own, turn=self.turn, body=self._body_of(values))

    def _body_of(self, values: Mapping[str, float]) -> Body:
        """Keys of all numbers of the body, and their values. `values` has the free ones in SI."""
        numbers = {
            key: Quantity(values.get(key, low), low.unit)
            if isinstance(low, Quantity)
            else values.get(key, low)
            for key, (low, _) in self.evolve.items()
        }
        return tuple(written(numbers).items())

    def vector(self, gait: Gait) -> Vector:
        """Parameter vector of a gait, without its name, its turn and fixed numbers of its body. Of
        parameters that copy each other, the first one counts. Raises InputError if the gait has
        other parameters, or lacks a number of the body."""
        source, key = "ParameterSpace", f"gait {gait.name}"
        values = check_parameters(gait.parameters, self.parameters, source=source, key=key)
        values |= self._body_numbers(gait)
        return np.array([values[name] for name in self.names], dtype=float)

    def _body_numbers(self, gait: Gait) -> dict[str, float]:
        """Numbers in SI of the body of a gait that are parameters, by key."""
        given, body = dict(gait.body), {}
        for key in self.free_body:
            if key not in given:
                raise InputError("ParameterSpace", f"gait {gait.name}", f"lacks the body's {key}")
            unit, value = getattr(self.evolve[key][0], "unit", ""), given[key]
            if isinstance(value, str):
                value = given_quantity(value, unit, gait.name, key)
            body[key] = float(value)
        return body

    def random(self, generator: np.random.Generator) -> Vector:
        """Random parameter vector, uniform between `low` and `high`. A parameter that follows
        another one is not drawn, even if a search may change it independently later: tau_B is
        2 tau_A."""
        vector, drawn = self.low.copy(), np.array([row.leader == "" for row in self._rows])
        vector[drawn] = generator.uniform(self.low[drawn], self.high[drawn])
        return self._with_followers(vector, ~drawn)

    def repair(self, vector: npt.ArrayLike) -> Vector:
        """A copy of the vector with tau_B = 2 tau_A and the like (see `is_coupled`), and the
        numbers of the body within their bounds, for example after mutation. Other bounds are not
        enforced. Raises InputError for a vector of another size."""
        repaired, body = self._numbers(vector), self.body
        repaired[body] = repaired[body].clip(self.low[body], self.high[body])
        return self._with_followers(repaired, self.is_coupled)

    def _with_followers(self, vector: Vector, which: npt.NDArray[np.bool_]) -> Vector:
        """Sets some parameters of a vector, in place, by the ones that they follow."""
        for place in np.flatnonzero(which).tolist():
            row = self._rows[place]
            vector[place] = row.ratio * vector[self.names.index(row.leader)]
        return vector

    def _numbers(self, vector: npt.ArrayLike) -> Vector:
        """A copy of a vector. Raises InputError unless it has a number for each parameter."""
        try:
            given = np.array(vector)
        except ValueError:  # rows of different lengths
            given = np.array(None)
        if given.shape != (len(self.names),) or given.dtype.kind not in "iuf":
            problem = f"found {vector!r:.60}, expected {len(self.names)} numbers"
            raise InputError("ParameterSpace", "vector", problem)
        return given.astype(np.float64)


WALKING_SEED = 80
"""Seed of a random gait that walks forward on the thesis's scenario: the default gait."""


def seeded_gait(scenario: GivenScenario, seed: int = WALKING_SEED) -> Gait:
    """Random gait, the same for the same seed: uniform between the scenario's bounds of gaits.

    The default bounds are from Table 5 of the thesis.

    >>> td.seeded_gait("thesis", 80)
    <Gait random gait 80>

    Args:
        scenario: a scenario, its name or file, or a run.
        seed: an integer, 0 or more. The default gives a gait that walks forward in the scenario
            "thesis".

    Raises:
        InputError: if an argument cannot be used.
    """
    check_whole("seeded_gait", "seed", seed, least=0)
    space = ParameterSpace.of(given_scenario(scenario))
    return space.gait(space.random(np.random.default_rng(seed)), name=f"random gait {seed}")
