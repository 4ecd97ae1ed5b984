"""Gaits, gait files, and the parameter space that evolution searches."""

import dataclasses
import functools
import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field

import tetra_drake
from tetra_drake.errors import InputError, check_whole
from tetra_drake.files import given_path, read_json, write_whole
from tetra_drake.formatting import TextTable, heading_html
from tetra_drake.laws.feedback import Gains
from tetra_drake.robot.network import NEURONS, Weights
from tetra_drake.scenario.joined_keys import separate
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.world import World
from tetra_drake.settings.quantities import Quantity
from tetra_drake.settings.section import Section, written
from tetra_drake.settings.units import given_quantity

LARGEST_GAIN = 1.0
"""Largest absolute value of a feedback gain in random gaits."""

Vector = npt.NDArray[np.float64]
"""Parameters of a gait, in the order of ParameterSpace.names."""

Body = tuple[tuple[str, float | str], ...]
"""Numbers of a robot: scenario keys, and values as texts with units, or as numbers without one."""

TAU_A, TAU_B = -2, -1
"""Indices of the time constants in a parameter vector."""

TAU_B_PER_TAU_A = 2.0
"""Ratio of the time constants in the thesis. With it the output resembles a sine wave."""


_MOST_COLUMNS = 8
"""Largest number of oscillators for which print() shows all weights, in lines of 100 characters."""


@dataclass(frozen=True)
class Gait:
    """Parameters of an oscillator network (weights, time constants, turn, gains), and of the body
    that evolved with it, if any: what evolution searches for."""

    name: str
    weights: tuple[float, ...]
    """Weights in the order of robot.network.Weights.couplings (listing B.2)."""
    tau_a: float
    tau_b: float
    """Time constant of self-inhibition, in s."""
    turn: float = 0.0
    """Steering, -1 to 1. Left oscillators get the input u0 (1 + turn), right ones u0 (1 - turn)."""
    gains: Gains = field(default_factory=Gains)
    body: Body = ()
    """Numbers of the robot that evolved with the gait; see Scenario.evolve."""
    scenario: str = field(default="", compare=False)
    """Name of the scenario that the gait was made for; "" if it is unknown."""
    weight_names: tuple[str, ...] = field(default=(), repr=False, compare=False)
    """Names such as "3->1 extensor": from oscillator 3 onto oscillator 1. Empty if unknown."""

    def __post_init__(self) -> None:
        """Raises InputError for a weight below 0, a time constant of 0 or less, or a number that is
        not finite."""
        wrong = [weight for weight in self.weights if not 0.0 <= weight < math.inf]
        wrong += [tau for tau in (self.tau_a, self.tau_b) if not 0.0 < tau < math.inf]
        if wrong:
            expected = "weights of 0 or more, and time constants above 0 s"
            raise InputError(f"gait {self.name}", "", f"found {wrong[0]}, expected {expected}")

    def __str__(self) -> str:
        """Summary in a few lines. The weights are shown as a matrix if it fits."""
        lines = [f"{self.name}: tau_A {self.tau_a:.4g} s, tau_B {self.tau_b:.4g} s"]
        lines += [f"{name} {number}" for name, number in self._further]
        texts = dict(zip(self.weight_names, [f"{x:.2f}" for x in self.weights], strict=False))
        count = max((int(name.split("->")[0]) for name in texts), default=0)
        if not 0 < count <= _MOST_COLUMNS:
            least, most = min(self.weights, default=0.0), max(self.weights, default=0.0)
            lines.append(f"{len(self.weights)} weights from {least:.2f} to {most:.2f}")
            return "\n".join(lines)
        oscillators = [str(i + 1) for i in range(count)]
        rows = []
        for onto in oscillators:
            row = [[texts.get(f"{i}->{onto} {kind}", "-") for kind in NEURONS] for i in oscillators]
            rows.append([onto, *("/".join(pair).replace("-/-", "-") for pair in row)])
        lines.append(f"weights ({'/'.join(NEURONS)}), a column for each oscillator they come from")
        return "\n".join([*lines, TextTable(["onto", *oscillators], rows).text()])

    def __repr__(self) -> str:
        return f"<Gait {self.name}>"

    def _repr_html_(self) -> str:
        rows = [["τ_A", f"{self.tau_a:.4g} s"], ["τ_B", f"{self.tau_b:.4g} s"]]
        rows += self._further
        least, most = min(self.weights, default=0.0), max(self.weights, default=0.0)
        rows.append([f"{len(self.weights)} weights", f"{least:.2f} to {most:.2f}"])
        return heading_html(self.name) + TextTable(["parameter", "value"], rows, (0, 1)).html()

    @property
    def _further(self) -> list[list[str]]:
        """Names and values, as texts, of the turn and the feedback gains, except zeros; and of the
        numbers of the body."""
        numbers = {"turn": self.turn, **{f"gain of {name}": gain for name, gain in self.gains}}
        rows = [[name, f"{number:.4g}"] for name, number in numbers.items() if number]
        return rows + [[key, _four_digits(value)] for key, value in self.body]

    def to_json(self, scenario: Scenario) -> dict[str, Any]:
        """Content of a gait file, for json.dumps(). The gait must fit `scenario`, which gives the
        names of the weights. The content has the name of the scenario that the gait was made for,
        or the name of `scenario` if that is unknown."""
        names = Weights.of(scenario).names
        content: dict[str, Any] = {"schema": 2, "name": self.name}
        content["scenario"] = self.scenario or scenario.name
        content["weights"] = dict(zip(names, self.weights, strict=True))
        content["tau_a_s"] = self.tau_a
        if self.tau_b != TAU_B_PER_TAU_A * self.tau_a:
            content["tau_b_s"] = self.tau_b
        if self.turn:
            content["turn"] = self.turn
        if gains := {name: gain for name, gain in self.gains if gain}:
            content["gains"] = gains
        if self.body:
            content["body"] = dict(self.body)
        return content


def _four_digits(value: float | str) -> str:
    """A number, or the number of a quantity given as text, with four significant digits."""
    number, blank, unit = str(value).partition(" ")
    return f"{float(number):.4g}{blank}{unit}"


@dataclass(frozen=True)
class PolicyParameters:
    """Parameters of a policy in place of a gait, and of the body that evolved with it, if any: what
    evolution searches for in a scenario with a policy."""

    name: str
    values: tuple[float, ...]
    """Parameters in the order of Scenario.policy_parameters."""
    body: Body = ()
    """Numbers of the robot that evolved with the policy; see Gait.body."""
    scenario: str = field(default="", compare=False)
    """Name of the scenario that they were made for; "" if it is unknown."""

    def __post_init__(self) -> None:
        """Raises InputError for a number that is not finite."""
        wrong = [value for value in self.values if not math.isfinite(value)]
        if wrong:
            problem = f"found {wrong[0]}, expected finite numbers"
            raise InputError(f"policy {self.name}", "parameters", problem)

    def __str__(self) -> str:
        least, most = min(self.values), max(self.values)
        count = f"{len(self.values)} parameters of a policy"
        lines = [f"{self.name}: {count}, {least:.4g} to {most:.4g}"]
        return "\n".join([*lines, *(f"{key} {_four_digits(value)}" for key, value in self.body)])

    def __repr__(self) -> str:
        return f"<PolicyParameters {self.name}>"

    def to_json(self, scenario: Scenario) -> dict[str, Any]:
        """Content of a file, for json.dumps(). The parameters must fit `scenario`, which gives
        their names."""
        parameters = dict(zip(scenario.policy_parameters, self.values, strict=True))
        made_for = self.scenario or scenario.name
        content = {"schema": 1, "name": self.name, "scenario": made_for, "parameters": parameters}
        return content | ({"body": dict(self.body)} if self.body else {})


AnyGait = Gait | PolicyParameters
"""A gait, or the parameters of a policy in its place."""


def with_body(scenario: Scenario, gait: AnyGait) -> tuple[Scenario, AnyGait]:
    """A scenario with the numbers of a gait's body, and the gait without them.

    Nothing changes for a gait that evolved without a body. Otherwise the scenario has no section
    `evolve`. Raises InputError if the scenario cannot have such a robot.
    """
    if not gait.body:
        return scenario, gait
    changes = {key: value for joined, value in gait.body for key in separate(joined)}
    changed = scenario.with_sections(evolve={}).with_changes(changes)
    return changed, dataclasses.replace(gait, body=())


def network_gait(gait: AnyGait) -> Gait:
    """The given gait. Raises InputError for parameters of a policy, which has no network."""
    if isinstance(gait, Gait):
        return gait
    raise InputError(gait.name, "", "found parameters of a policy, expected a gait of a network")


@dataclass(frozen=True)
class ParameterSpace:
    """Parameter space of a scenario's gaits, for your own search algorithm.

    A vector has the weights, the feedback gains (if the scenario has feedback), the numbers of the
    body in SI (those that `evolve` of the scenario leaves free), and the time constants tau_A and
    tau_B in s. In a scenario with a policy it has the policy's parameters and the numbers of the
    body.

    >>> space = td.ParameterSpace.of("thesis")
    >>> vector = space.repair(0.5 * (space.low + space.high))
    >>> space.gait(vector, name="middle")
    <Gait middle>
    """

    names: tuple[str, ...]
    """Names such as "weight 3->1 extensor", "gain length", "robot.density", "tau_A", "tau_B"."""
    low: Vector
    high: Vector
    """Upper bounds of the parameters of random gaits; `low` are the lower bounds (Table 5)."""
    floors: Vector
    """Lower limits of the search. Mutation keeps parameters above (listing A.3.3, A.3.4)."""
    couples_tau_b: bool
    """True if tau_B is always 2 tau_A."""
    weights: npt.NDArray[np.int64]
    """Index of the parameter that gives each weight of a gait (weights,)."""
    weight_names: tuple[str, ...]
    """Name of each weight of a gait in gait files (weights,)."""
    pathways: tuple[str, ...]
    """Names of the feedback pathways with a gain."""
    turn: float
    """Steering of all gaits; see Gait.turn."""
    evolve: Mapping[str, Sequence[float]] = field(default_factory=dict)
    """Bounds of the numbers of the body, also of fixed ones; see Scenario.evolve."""
    of_policy: bool = False
    """True if the parameters are of a policy."""

    @functools.cached_property
    def free_body(self) -> tuple[str, ...]:
        """Keys of the numbers of the body that are parameters: their bounds differ."""
        return tuple(_free(self.evolve))

    @property
    def body(self) -> slice:
        """Places of the body's numbers in a vector."""
        end = len(self.names) - (0 if self.of_policy else 2)
        return slice(end - len(self.free_body), end)

    @classmethod
    def of(cls, scenario: GivenScenario) -> Self:
        """The parameter space of a scenario, given by its name or file, or by a run.

        The bounds are from its section `gait_bounds`. A parameter with equal bounds is fixed. The
        bounds of tau_B are twice the bounds of tau_A. The bounds of feedback gains are -1 and 1.
        """
        scenario = given_scenario(scenario)
        weights, bounds = Weights.of(scenario), scenario.gait_bounds
        of_policy = scenario.policy is not None
        weight_names = () if of_policy else weights.names
        shared, pathways = np.arange(len(weight_names)), tuple(scenario.cpg.feedback)
        if bounds.mirrored and not of_policy:
            shared = np.minimum(shared, weights.images)
        chosen, parameters = np.unique(shared, return_inverse=True)

        # Least and greatest value, and floor.
        free = {**scenario.policy_parameters, **_free(scenario.evolve)}
        limits: dict[str, Sequence[float]]
        limits = {key: (low, high, -math.inf) for key, (low, high) in free.items()}
        if not of_policy:
            of_weight = bounds.weight_min, bounds.weight_max, 0.0
            of_gain = -LARGEST_GAIN, LARGEST_GAIN, -math.inf
            of_tau = bounds.tau_a_min, bounds.tau_a_max, bounds.tau_a_min
            limits = {
                **{f"weight {weight_names[i]}": of_weight for i in chosen},
                **{f"gain {name}": of_gain for name in pathways},
                **limits,
                **{"tau_A": of_tau, "tau_B": [TAU_B_PER_TAU_A * tau for tau in of_tau]},
            }
        low, high, floors = np.reshape([*limits.values()], (-1, 3)).T.copy()
        return cls(
            names=tuple(limits),
            low=low,
            high=high,
            floors=floors,
            couples_tau_b=not (bounds.independent_tau_b or of_policy),
            weights=parameters,
            weight_names=weight_names,
            pathways=pathways,
            turn=bounds.turn,
            evolve=scenario.evolve,
            of_policy=of_policy,
        )

    def gait(self, vector: npt.ArrayLike, *, name: str) -> AnyGait:
        """Gait called `name` with the parameters of a vector (parameters,), in the order of
        `names`; the bounds are not checked. Raises InputError for a vector of another size, a
        number that is not finite, a weight below 0, or a time constant that is not above 0."""
        vector = self._numbers(vector)
        body, values = self._body_of(vector), vector.tolist()
        if self.of_policy:
            return PolicyParameters(name, tuple(values[: self.body.start]), body)
        first_gain = self.body.start - len(self.pathways)
        gains = dict(zip(self.pathways, values[first_gain:], strict=False))
        return Gait(
            name=name,
            weights=tuple(vector[self.weights].tolist()),
            tau_a=float(vector[TAU_A]),
            tau_b=float(vector[TAU_B]),
            turn=self.turn,
            gains=Gains(**gains),
            body=body,
            weight_names=self.weight_names,
        )

    def _body_of(self, vector: Vector) -> Body:
        """Keys of all numbers of the body, and their values."""
        numbers = dict(zip(self.free_body, vector[self.body].tolist(), strict=True))
        values = {
            key: Quantity(numbers.get(key, low), low.unit)
            if isinstance(low, Quantity)
            else numbers.get(key, low)
            for key, (low, _) in self.evolve.items()
        }
        return tuple(written(values).items())

    def vector(self, gait: AnyGait) -> Vector:
        """Parameter vector of a gait, without its name, its turn and fixed numbers of its body.
        With mirrored weights, a left weight and its right image share a parameter, which the first
        of the two gives. Raises InputError if the gait has another number of weights, or lacks a
        number of the body."""
        body = self._body_numbers(gait)
        if isinstance(gait, PolicyParameters):
            return self._numbers([*gait.values, *body])
        if len(gait.weights) != len(self.weights):
            problem = f"found {len(gait.weights)} weights, expected {len(self.weights)}"
            raise InputError("ParameterSpace", f"gait {gait.name}", problem)
        _, first = np.unique(self.weights, return_index=True)
        weights = np.array(gait.weights)[first]
        gains = [getattr(gait.gains, name) for name in self.pathways]
        return np.concatenate([weights, gains, body, [gait.tau_a, gait.tau_b]])

    def _body_numbers(self, gait: AnyGait) -> list[float]:
        """Numbers in SI of the body of a gait that are parameters."""
        given, body = dict(gait.body), []
        for key in self.free_body:
            if key not in given:
                raise InputError("ParameterSpace", f"gait {gait.name}", f"lacks the body's {key}")
            unit, value = getattr(self.evolve[key][0], "unit", ""), given[key]
            if isinstance(value, str):
                value = given_quantity(value, unit, gait.name, key)
            body.append(value)
        return body

    def random(self, generator: np.random.Generator) -> Vector:
        """Random parameter vector, uniform between `low` and `high`. tau_B is not drawn: it is
        2 tau_A, even if a search may change it independently later."""
        if self.of_policy:
            return generator.uniform(self.low, self.high)
        drawn = generator.uniform(self.low[:TAU_B], self.high[:TAU_B])
        return np.append(drawn, TAU_B_PER_TAU_A * drawn[TAU_B])

    def repair(self, vector: npt.ArrayLike) -> Vector:
        """A copy of the vector with tau_B = 2 tau_A, and the numbers of the body within their
        bounds, for example after mutation. If the scenario makes tau_B independent of tau_A, tau_B
        stays as given. Other bounds are not enforced. Raises InputError for a vector of another
        size."""
        repaired, body = self._numbers(vector), self.body
        repaired[body] = repaired[body].clip(self.low[body], self.high[body])
        if self.couples_tau_b:
            repaired[TAU_B] = TAU_B_PER_TAU_A * repaired[TAU_A]
        return repaired

    def _numbers(self, vector: npt.ArrayLike) -> Vector:
        """A copy of a vector. Raises InputError unless it has a number for each parameter."""
        try:
            given = np.array(vector)
        except ValueError:  # rows of different lengths
            given = np.array(None)
        if given.shape != self.low.shape or given.dtype.kind not in "iuf":
            problem = f"found {vector!r:.60}, expected {len(self.names)} numbers"
            raise InputError("ParameterSpace", "vector", problem)
        return given.astype(np.float64)


def _free(evolve: Mapping[str, Sequence[float]]) -> dict[str, Sequence[float]]:
    """Bounds of the numbers of the body that are parameters: the bounds differ."""
    return {key: pair for key, pair in evolve.items() if pair[0] < pair[1]}


WALKING_SEED = 80
"""Seed of a random gait that walks forward on the thesis's scenario: the default gait."""


def seeded_gait(scenario: GivenScenario, seed: int = WALKING_SEED) -> AnyGait:
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


def save_gait(gait: AnyGait, path: str | Path, scenario: Scenario) -> None:
    """Writes a gait file (JSON) at `path`. The gait must fit `scenario`, which gives the names of
    its weights. load_gait() reads exactly the same numbers."""
    write_whole(path, json.dumps(gait.to_json(scenario), indent=1) + "\n")


Weight = Annotated[float, Field(ge=0)]


class _AnyGaitFile(Section):
    """What files of gaits and of policy parameters have in common."""

    name: str = ""
    scenario: str = ""
    body: dict[str, float | str] = Field(default={})
    """Numbers of the body by scenario key, quantities as texts with units."""


class GaitFile(_AnyGaitFile):
    """Content of a gait file as it was read, before it is checked against a scenario; see Gait."""

    version: Literal[1, 2] = Field(alias="schema")
    weights: dict[str, Weight] | list[Weight]
    """Weights by name (see Weights.names), in any order. In schema 1, as in the thesis, a list in
    the order of Weights.couplings."""
    tau_a_s: float = Field(gt=0)
    tau_b_s: float | None = Field(default=None, gt=0)
    turn: float = Field(default=0.0, ge=-1, le=1)
    gains: Gains = Gains()


class PolicyFile(_AnyGaitFile):
    """Content of a file of policy parameters as it was read; see PolicyParameters."""

    version: Literal[1] = Field(alias="schema")
    parameters: dict[str, float]
    """Parameters by name, in any order; see Scenario.policy_parameters."""


def load_gait(path: str | Path, scenario: GivenScenario, *, key: str = "") -> AnyGait:
    """Reads a gait for the scenario's robot, or the parameters of the scenario's policy.

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
    scenario = given_scenario(scenario)
    gait = (_policy_in if scenario.policy else _gait_in)(raw, scenario, path, key)
    try:
        with_body(scenario, gait)
    except InputError as error:
        place = f"{key}.body.{error.key}".strip(".")
        raise InputError(path, place, error.problem) from error
    return gait


def _policy_in(raw: Any, scenario: Scenario, path: str | Path, key: str) -> PolicyParameters:
    """Parameters for a scenario's policy from the parsed content of a file; see load_gait()."""
    if isinstance(raw, dict) and "weights" in raw:
        problem = f"is a gait, expected parameters: scenario {scenario.name} has a policy"
        raise InputError(path, key, problem)
    file = PolicyFile.from_tree(raw, path, key=key)
    place = f"{key}.parameters".strip(".")
    return PolicyParameters(
        name=file.name or Path(path).stem,
        values=tuple(_in_order(file.parameters, [*scenario.policy_parameters], path, place)),
        body=tuple(file.body.items()),
        scenario=file.scenario,
    )


def _gait_in(raw: Any, scenario: Scenario, path: str | Path, key: str) -> Gait:
    """A gait for a scenario from the parsed content of a file; see load_gait()."""
    file = GaitFile.from_tree(raw, path, key=key)
    own, weights = Weights.of(scenario), file.weights
    names = own.names
    if isinstance(weights, dict):
        weights = _in_order(weights, names, path, f"{key}.weights".strip("."))
    gait = Gait(
        name=file.name or Path(path).stem,
        weights=tuple(weights),
        tau_a=file.tau_a_s,
        tau_b=TAU_B_PER_TAU_A * file.tau_a_s if file.tau_b_s is None else file.tau_b_s,
        turn=file.turn,
        gains=file.gains,
        body=tuple(file.body.items()),
        scenario=file.scenario,
        weight_names=names,
    )
    check_gait(gait, scenario, own, source=path, key=key)
    return gait


def _in_order(
    given: dict[str, float], names: Sequence[str], source: object, key: str
) -> list[float]:
    """The values of `given` in the order of `names`. Raises InputError, naming source and key,
    unless the names are the same."""
    known = {*names}
    missing = [name for name in names if name not in given]
    unknown = [name for name in given if name not in known]
    problems = [f"lacks {len(missing)} names, such as '{missing[0]}'"] if missing else []
    if unknown:
        problems.append(f"has {len(unknown)} unknown names, such as '{unknown[0]}'")
    if problems:
        found = f"found {len(given)}, expected the {len(names)} of the scenario"
        raise InputError(source, key, f"{found}; {' and '.join(problems)}")
    return [given[name] for name in names]


class HasBestGait(Protocol):
    """Object with a best gait, such as a run."""

    def best_gait(self) -> AnyGait: ...


GivenGait = AnyGait | HasBestGait | str | Path
"""A gait, parameters of a policy, their file, or a run or its folder; a run means its best gait."""


def given_gait(gait: GivenGait, scenario: Scenario) -> AnyGait:
    """The gait that an argument means: a gait itself, one read from a file for `scenario`, or the
    best gait of a run or of its folder. Raises InputError for anything else."""
    if isinstance(gait, AnyGait):
        return gait
    if isinstance(gait, (str, Path)):
        if os.path.isdir(gait):
            return tetra_drake.load_run(gait).best_gait()
        return load_gait(gait, scenario)
    if hasattr(gait, "best_gait"):
        return gait.best_gait()
    raise InputError("gait", "", f"found {gait!r:.60}, expected a gait, its file or a run")


def check_gait(
    gait: Gait, scenario: World, weights: Weights, *, source: object, key: str = ""
) -> None:
    """Raises InputError, naming source and key, if a gait does not fit the scenario.

    It needs as many weights as the robot has connections (`weights`), gains only for the scenario's
    feedback, and a turn only where the robot has left or right oscillators. `key` is the gait's key
    in the source, for the message.
    """
    prefix = f"{key}." if key else ""
    count, expected = len(gait.weights), len(weights.couplings)
    if count != expected:
        needed = f"{expected} for {weights.blueprint.signals} oscillators"
        raise InputError(source, f"{prefix}weights", f"found {count} numbers, expected {needed}")
    for name, gain in gait.gains:
        if gain and name not in scenario.cpg.feedback:
            problem = f"found {gain}, expected 0: cpg.feedback is {scenario.cpg.feedback}"
            raise InputError(source, f"{prefix}gains.{name}", problem)
    if gait.turn and not weights.blueprint.sides.any():
        problem = f"found {gait.turn}, expected 0: no oscillator is left or right"
        raise InputError(source, f"{prefix}turn", problem)
