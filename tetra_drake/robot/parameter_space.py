"""Parameter space that evolution searches: vectors of gaits and of the bodies beside them."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from tetra_drake.errors import InputError, check_type, check_whole, checked_numbers
from tetra_drake.laws.oscillator import GaitParameter
from tetra_drake.robot.gait import Body, Gait, check_parameters
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.quantities import Quantity, separate
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
    evolve: Mapping[str, Sequence[float]]
    """Bounds of the numbers of the body, also of fixed ones; see Scenario.evolve."""
    turn: float
    """Steering of all gaits; see Gait.turn."""
    body: slice
    """Places in a vector of the body's numbers that are parameters: their bounds differ."""
    names: tuple[str, ...]
    """Names such as "weight 3->1 extensor", "gain length", "robot.density", "tau_A"."""
    low: Vector
    high: Vector
    """Upper bounds of the parameters of random gaits; `low` are the lower bounds (Table 5)."""
    floors: Vector
    """Lower limits of the search. Mutation keeps parameters above (listing A.3.3, A.3.4)."""
    leaders: npt.NDArray[np.int64]
    """Index of the parameter that each one follows, as tau_B follows tau_A; -1 if it follows
    none."""
    is_coupled: npt.NDArray[np.bool_]
    """True for parameters that always have the `ratio` to their leaders."""

    @classmethod
    def of(cls, scenario: GivenScenario) -> Self:
        """The parameter space of a scenario, given by its name or file, or by a run. A parameter
        with equal bounds is fixed."""
        scenario = given_scenario(scenario)
        free = {key: GaitParameter(a, b) for key, (a, b) in scenario.evolve.items() if a < b}
        searched = {name: one for name, one in scenario.parameters.items() if not one.copies}
        leaders = {one.leader for one in searched.values()}
        alone = [name for name, one in searched.items() if not one.leader and name not in leaders]
        names = (*alone, *free, *(name for name in searched if name not in alone))
        rows = [(searched | free)[name] for name in names]
        low, high, floors = np.array([row[:3] for row in rows], dtype=float).reshape(-1, 3).T.copy()
        return cls(
            parameters=scenario.parameters,
            evolve=scenario.evolve,
            turn=scenario.gait_bounds.turn,
            body=slice(len(alone), len(alone) + len(free)),
            names=names,
            low=low,
            high=high,
            floors=floors,
            leaders=np.array([names.index(x.leader) if x.leader else -1 for x in rows], dtype=int),
            is_coupled=np.array([bool(x.leader) and x.coupled for x in rows], dtype=bool),
        )

    def gait(self, vector: npt.ArrayLike, *, name: str) -> Gait:
        """Gait called `name` with the parameters of a vector (parameters,), in the order of
        `names`; the bounds are not checked. Raises InputError for a vector of another size, or for
        a number that no gait may have, such as a weight below 0."""
        check_type("ParameterSpace", "name", name, str)
        values = dict(zip(self.names, self._numbers(vector).tolist(), strict=True))
        own = {key: values[one.copies or key] for key, one in self.parameters.items()}
        check_parameters(own, self.parameters, f"gait {name}")
        return Gait(name, own, turn=self.turn, body=self._body_of(values))

    def _body_of(self, values: Mapping[str, float]) -> Body:
        """Keys of all numbers of the body, and their values. `values` has the free ones in SI."""

        def like(low: float, value: float) -> float:
            return Quantity(value, low.unit) if isinstance(low, Quantity) else value

        numbers = {key: like(low, values.get(key, low)) for key, (low, _) in self.evolve.items()}
        return tuple(written(numbers).items())

    def vector(self, gait: Gait) -> Vector:
        """Parameter vector of a gait, without its name, its turn and fixed numbers of its body. Of
        parameters that copy each other, the first one counts. Raises InputError if the gait has
        other parameters, or lacks a number of the body."""
        check_type("ParameterSpace", "gait", gait, Gait)
        key = f"gait {gait.name}"
        values = check_parameters(gait.parameters, self.parameters, "ParameterSpace", key)
        values |= self._body_numbers(gait)
        return np.array([values[name] for name in self.names], dtype=float)

    def _body_numbers(self, gait: Gait) -> dict[str, float]:
        """Numbers in SI of the body of a gait that are parameters, by key."""
        given, body = dict(gait.body), {}
        for key in self.names[self.body]:
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
        vector, drawn = self.low.copy(), self.leaders < 0
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
            ratio = self.parameters[self.names[place]].ratio
            vector[place] = ratio * vector[self.leaders[place]]
        return vector

    def _numbers(self, vector: npt.ArrayLike) -> Vector:
        """A copy of a vector. Raises InputError unless it has a number for each parameter."""
        return checked_numbers(vector, (len(self.names),), source="ParameterSpace", key="vector")


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
