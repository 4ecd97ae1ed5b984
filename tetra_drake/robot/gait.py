"""Gaits, gait files, and the parameter space that evolution searches."""

import dataclasses
import functools
import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field

import tetra_drake
from tetra_drake.errors import InputError, check_whole
from tetra_drake.files import given_path, read_json, write_whole
from tetra_drake.formatting import TextTable, heading_html
from tetra_drake.laws.oscillator import GaitParameter
from tetra_drake.scenario.joined_keys import separate
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.quantities import Quantity
from tetra_drake.settings.section import Section, written
from tetra_drake.settings.units import given_quantity

Vector = npt.NDArray[np.float64]
"""Parameters of a gait, in the order of ParameterSpace.names."""

Body = tuple[tuple[str, float | str], ...]
"""Numbers of a robot: scenario keys, and values as texts with units, or as numbers without one."""

_FEW = 8
"""Largest number of parameters whose names begin with the same word and are all printed."""


@dataclass(frozen=True)
class Gait:
    """Gait: numbers by name from which oscillators or a policy make the signals of a robot, and the
    body that evolved with them, if any: what evolution searches for."""

    name: str
    parameters: Mapping[str, float] = field(hash=False)
    """Numbers by name, in SI units, such as "tau_A"; see Scenario.parameters."""
    turn: float = 0.0
    """Steering, -1 to 1. Left oscillators get the input u0 (1 + turn), right ones u0 (1 - turn)."""
    body: Body = ()
    """Numbers of the robot that evolved with the gait; see Scenario.evolve."""
    scenario: str = field(default="", compare=False)
    """Name of the scenario that the gait was made for; "" if it is unknown."""

    def __str__(self) -> str:
        return f"{self.name}\n{self._table.text()}"

    def __repr__(self) -> str:
        return f"<Gait {self.name}>"

    def _repr_html_(self) -> str:
        return heading_html(self.name) + self._table.html()

    @property
    def _table(self) -> TextTable:
        """Table of the parameters, the turn unless it is 0, and the numbers of the body. Of many
        parameters whose names begin with the same word, it has number and range."""
        alike: dict[str, list[tuple[str, float | str]]] = {}
        turn = {"turn": self.turn} if self.turn else {}
        for name, value in {**self.parameters, **turn, **dict(self.body)}.items():
            alike.setdefault(name.partition(" ")[0], []).append((name, value))
        rows = []
        for word, group in alike.items():
            values = sorted(float(value) for _, value in group if not isinstance(value, str))
            if len(values) > _FEW:
                ends = f"{_four_digits(values[0])} to {_four_digits(values[-1])}"
                rows.append([f"{word} ({len(values)})", ends])
            else:
                rows += [[name, _four_digits(value)] for name, value in group]
        return TextTable(["parameter", "value"], rows, (0, 1))

    def to_json(self, scenario: Scenario) -> dict[str, Any]:
        """Content of a gait file, for json.dumps(). It has the name of the scenario that the gait
        was made for, or the name of `scenario` if that is unknown."""
        content: dict[str, Any] = {"schema": 3, "name": self.name}
        content["scenario"] = self.scenario or scenario.name
        content["parameters"] = dict(self.parameters)
        optional = {"turn": self.turn, "body": dict(self.body)}
        return content | {key: value for key, value in optional.items() if value}


def _four_digits(value: float | str) -> str:
    """A number, or the number of a quantity given as text, with four significant digits."""
    number, blank, unit = str(value).partition(" ")
    return f"{float(number):.4g}{blank}{unit}"


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


def save_gait(gait: Gait, path: str | Path, scenario: Scenario) -> None:
    """Writes a gait file (JSON) at `path`. load_gait() reads exactly the same numbers. If it is
    unknown for which scenario the gait was made, the file names `scenario`."""
    write_whole(path, json.dumps(gait.to_json(scenario), indent=1) + "\n")


_OLDER = {"weights": "weight ", "gains": "gain ", "tau_a_s": "tau_A", "tau_b_s": "tau_B"}
"""Names of parameters, or their beginnings, by keys that gait files had up to version 0.5.0."""


class GaitFile(Section):
    """Content of a gait file as it was read, before it is checked against a scenario; see Gait."""

    version: Literal[1, 2, 3] = Field(alias="schema")
    name: str = ""
    scenario: str = ""
    parameters: dict[str, float]
    """Numbers by name, in SI units and in any order; see Scenario.parameters."""
    turn: float = Field(default=0.0, ge=-1, le=1)
    body: dict[str, float | str] = Field(default={})
    """Numbers of the body by scenario key, quantities as texts with units."""


def _renewed(tree: Any) -> Any:
    """Content of a gait file of version 0.5.0 in the present form; any other content as it is."""
    if not isinstance(tree, dict) or "weights" not in tree:
        return tree
    parameters: dict[str, Any] = {}
    for key in _OLDER.keys() & tree.keys():
        group = tree[key] if isinstance(tree[key], dict) else {"": tree[key]}
        parameters |= {f"{_OLDER[key]}{name}": value for name, value in group.items()}
    return {key: x for key, x in tree.items() if key not in _OLDER} | {"parameters": parameters}


def load_gait(path: str | Path, scenario: GivenScenario, *, key: str = "") -> Gait:
    """Reads a gait for the scenario's robot: parameters of its oscillators, or of its policy.

        >>> gait = td.load_gait("gait.json", td.load_scenario("quick"))

    Args:
        path: a gait file.
        scenario: the scenario that the gait must fit, its name or file, or a run.
        key: for another JSON file that contains a gait: the key at its top level whose value is the
            gait. By default the file is the gait.

    Raises:
        InputError: names file and key, if the file is wrong or does not fit the scenario.
    """
    raw = read_json(given_path(path, "load_gait", "path"), "gait file")
    raw = raw.get(key) if key and isinstance(raw, dict) else raw
    scenario, file = given_scenario(scenario), GaitFile.from_tree(_renewed(raw), path, key=key)
    place = f"{key}.parameters".strip(".")
    gait = Gait(
        name=file.name or Path(path).stem,
        parameters=check_parameters(file.parameters, scenario.parameters, source=path, key=place),
        turn=file.turn,
        body=tuple(file.body.items()),
        scenario=file.scenario,
    )
    if gait.turn and (scenario.policy is not None or not scenario.blueprint().sides.any()):
        problem = f"found {gait.turn}, expected 0: no oscillator is left or right"
        raise InputError(path, f"{key}.turn".strip("."), problem)
    try:
        with_body(scenario, gait)
    except InputError as error:
        place = f"{key}.body.{error.key}".strip(".")
        raise InputError(path, place, error.problem) from error
    return gait


class HasBestGait(Protocol):
    """Object with a best gait, such as a run."""

    def best_gait(self) -> Gait: ...


GivenGait = Gait | HasBestGait | str | Path
"""A gait, its file, or a run or its folder; a run means its best gait."""


def given_gait(gait: GivenGait, scenario: Scenario) -> Gait:
    """The gait that an argument means: a gait itself, one read from a file for `scenario`, or the
    best gait of a run or of its folder. Raises InputError for anything else."""
    if isinstance(gait, Gait):
        return gait
    if isinstance(gait, (str, Path)):
        if os.path.isdir(gait):
            return tetra_drake.load_run(gait).best_gait()
        return load_gait(gait, scenario)
    if hasattr(gait, "best_gait"):
        return gait.best_gait()
    raise InputError("gait", "", f"found {gait!r:.60}, expected a gait, its file or a run")


def check_parameters(
    given: Mapping[str, float],
    expected: Mapping[str, GaitParameter],
    *,
    source: object,
    key: str = "",
) -> dict[str, float]:
    """The values of `given` in the order of the parameters `expected`. One that may be missing gets
    its default. Raises InputError, naming source and key, for other names, or for a value that is
    too small or not finite."""
    missing = [name for name, one in expected.items() if name not in given and not one.has_default]
    unknown = [name for name in given if name not in expected]
    problems = [f"lacks {len(missing)} names, such as '{missing[0]}'"] if missing else []
    if unknown:
        problems.append(f"has {len(unknown)} unknown names, such as '{unknown[0]}'")
    if problems:
        found = f"found {len(given)}, expected the {len(expected)} of the scenario"
        raise InputError(source, key, f"{found}; {' and '.join(problems)}")
    values: dict[str, float] = {}
    for name, one in expected.items():
        value = values[name] = given[name] if name in given else one.default_among(values)
        if not (one.least <= value and math.isfinite(value)):
            limit = "a finite number" if one.least == -math.inf else f"{one.least:g} or more"
            problem = f"found {value}, expected {limit}"
            raise InputError(source, f"{key}.{name}".strip("."), problem)
    return values
