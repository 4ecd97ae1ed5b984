"""A gait, its file, and the space of parameters that evolution searches."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from tetra_drake.errors import InputError
from tetra_drake.files import read_text, write_whole
from tetra_drake.scenario.fields import Check, setting
from tetra_drake.scenario.schema import Scenario

SCHEMA = 1

Vector = npt.NDArray[np.float64]
"""The parameters of one gait in the order of ParameterSpace.names."""

TAU_B_PER_TAU_A = 2.0
"""The thesis keeps tau_B = 2 tau_A, so that the output resembles a sine wave."""

TAU_A, TAU_B = -2, -1
"""Indices of the time constants in a vector."""


def weight_count(oscillators: int) -> int:
    """Number of inhibitory weights of n oscillators: 2 n (n - 1)."""
    return 2 * oscillators * (oscillators - 1)


@dataclass(frozen=True)
class Gait:
    """The parameters of the oscillator network: weights in the listing's order (B.2), time
    constants in s."""

    name: str
    weights: tuple[float, ...]
    tau_a: float
    tau_b: float

    def to_json(self) -> dict[str, Any]:
        """The content of a gait file."""
        taus = {"tau_a_s": self.tau_a, "tau_b_s": self.tau_b}
        if self.tau_b == TAU_B_PER_TAU_A * self.tau_a:
            del taus["tau_b_s"]
        return {"schema": SCHEMA, "name": self.name, "weights": list(self.weights), **taus}


@dataclass(frozen=True)
class ParameterSpace:
    """The parameters of a gait as one vector: weights in the listing's order, tau_A, tau_B (s)."""

    names: tuple[str, ...]
    """As "weight 3->1 extensor" (from oscillator 3 onto oscillator 1), "tau_A", "tau_B"."""
    low: Vector
    high: Vector
    """Bounds of random gaits (Table 5)."""
    steps: Vector
    """Largest change of each parameter in one mutation (Table 6); 0 where it does not mutate."""
    floors: Vector
    """A parameter reduced by mutation must stay above this (listing A.3.3, A.3.4)."""
    couples_tau_b: bool
    """Whether tau_B is kept at 2 tau_A."""

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """The space of a scenario.

        With equal bounds of tau_A it is fixed. With `tau_mutation: listing` it does not mutate:
        the listing's index 26 is that of tau_B. An independent tau_B has twice tau_A's numbers.
        """
        settings, bounds = scenario.evolution, scenario.gait_bounds
        weights = weight_count(scenario.oscillators)
        tau_step = 0.0 if bounds.tau_a_min == bounds.tau_a_max else settings.tau_mutation_range
        tau_a_step = 0.0 if settings.tau_mutation == "listing" else tau_step

        def vector(weight: float, tau_a: float, twice: float) -> Vector:
            return np.array([weight] * weights + [tau_a, TAU_B_PER_TAU_A * twice])

        return cls(
            names=(*_weight_names(scenario.oscillators), "tau_A", "tau_B"),
            low=vector(bounds.weight_min, bounds.tau_a_min, bounds.tau_a_min),
            high=vector(bounds.weight_max, bounds.tau_a_max, bounds.tau_a_max),
            steps=vector(settings.weight_mutation, tau_a_step, tau_step),
            floors=vector(0.0, bounds.tau_a_min, bounds.tau_a_min),
            couples_tau_b=not settings.independent_tau_b,
        )

    def gait(self, vector: Vector, *, name: str) -> Gait:
        """The gait of a vector."""
        *weights, tau_a, tau_b = vector.tolist()
        return Gait(name=name, weights=tuple(weights), tau_a=tau_a, tau_b=tau_b)

    def vector(self, gait: Gait) -> Vector:
        """The vector of a gait."""
        return np.array([*gait.weights, gait.tau_a, gait.tau_b])

    def random(self, generator: np.random.Generator) -> Vector:
        """A vector drawn uniformly within the bounds, with tau_B = 2 tau_A."""
        drawn = generator.uniform(self.low[:TAU_B], self.high[:TAU_B])
        return np.append(drawn, TAU_B_PER_TAU_A * drawn[TAU_B])

    def repair(self, vector: Vector) -> Vector:
        """A copy of the vector with tau_B = 2 tau_A, unless tau_B is independent."""
        repaired = vector.copy()
        if self.couples_tau_b:
            repaired[TAU_B] = TAU_B_PER_TAU_A * vector[TAU_A]
        return repaired


def _weight_names(oscillators: int) -> list[str]:
    """Onto extensor 1 from all others, onto flexor 1, onto extensor 2 ... (the listing's order)."""
    numbers = range(1, oscillators + 1)
    return [
        f"weight {source}->{target} {neuron}"
        for target in numbers
        for neuron in ("extensor", "flexor")
        for source in numbers
        if source != target
    ]


WALKING_SEED = 80
"""Seed of a random gait that walks forward on the thesis's scenario: the default gait."""


def seeded_gait(scenario: Scenario, seed: int = WALKING_SEED) -> Gait:
    """The random gait of a seed, drawn uniformly from the scenario's bounds (Table 5)."""
    space = ParameterSpace.of(scenario)
    return space.gait(space.random(np.random.default_rng(seed)), name=f"random gait {seed}")


def save_gait(gait: Gait, path: str | Path) -> None:
    """Writes a gait file; it loads back to the same numbers."""
    write_whole(path, json.dumps(gait.to_json(), indent=1) + "\n")


@dataclass
class _GaitFile:
    """The keys of a gait file."""

    weights: list[float] = setting(at_least=0)
    tau_a_s: float = setting(above=0)
    schema: int = setting(at_least=SCHEMA, at_most=SCHEMA)
    tau_b_s: float | None = setting(default=None, above=0)
    name: str = setting(default="")


def load_gait(path: str | Path, scenario: Scenario, *, key: str = "") -> Gait:
    """Reads a gait file, or the gait under `key` of a JSON file, for the scenario's robot.

    Raises InputError, naming file and key, for whatever is wrong in the file.
    """
    text = read_text(path, "gait file")
    try:
        raw = json.loads(text, object_pairs_hook=_unique_keys)
    except (ValueError, RecursionError) as error:
        raise InputError(path, "", f"is not JSON: {error}") from error
    if key and isinstance(raw, dict):
        raw = raw.get(key)
    file: _GaitFile = Check(path, complete=True).value(_GaitFile, raw, key)
    count, n = len(file.weights), scenario.oscillators
    if count != weight_count(n):
        problem = f"found {count} numbers, expected {weight_count(n)} for {n} oscillators"
        raise InputError(path, f"{key}.weights".strip("."), problem)
    return Gait(
        name=file.name or Path(path).stem,
        weights=tuple(file.weights),
        tau_a=file.tau_a_s,
        tau_b=TAU_B_PER_TAU_A * file.tau_a_s if file.tau_b_s is None else file.tau_b_s,
    )


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        raise ValueError("a key is given twice")
    return content
