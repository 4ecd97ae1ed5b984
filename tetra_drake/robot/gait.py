"""A gait: the inhibitory weights and time constants of the oscillator network."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.files import write_whole
from tetra_drake.scenario.schema import Scenario

SCHEMA = 1

TAU_B_PER_TAU_A = 2.0
"""The thesis keeps tau_B = 2 tau_A, so that the output resembles a sine wave."""


def weight_count(oscillators: int) -> int:
    """Inhibitory weights of n oscillators: 2 n (n - 1)."""
    return 2 * oscillators * (oscillators - 1)


@dataclass(frozen=True)
class Gait:
    """What the evolution varies. Weights in the listing's order (B.2), time constants in s."""

    name: str
    weights: tuple[float, ...]
    tau_a: float
    tau_b: float

    def to_json(self) -> dict[str, Any]:
        """The gait as a gait file holds it."""
        gait: dict[str, Any] = {
            "schema": SCHEMA,
            "name": self.name,
            "weights": list(self.weights),
            "tau_a_s": self.tau_a,
        }
        if self.tau_b != TAU_B_PER_TAU_A * self.tau_a:
            gait["tau_b_s"] = self.tau_b
        return gait


def random_gait(scenario: Scenario, generator: np.random.Generator, *, name: str) -> Gait:
    """A gait drawn uniformly from the scenario's bounds (Table 5)."""
    bounds = scenario.gait_bounds
    count = weight_count(scenario.oscillators)
    weights = generator.uniform(bounds.weight_min, bounds.weight_max, count)
    tau_a = float(generator.uniform(bounds.tau_a_min, bounds.tau_a_max))
    return Gait(
        name=name, weights=tuple(weights.tolist()), tau_a=tau_a, tau_b=TAU_B_PER_TAU_A * tau_a
    )


WALKING_SEED = 80
"""Of a random gait of the thesis's scenario that walks forward, for want of a better one."""


def seeded_gait(scenario: Scenario, seed: int = WALKING_SEED) -> Gait:
    """The random gait of a seed."""
    return random_gait(scenario, np.random.default_rng(seed), name=f"random gait {seed}")


def save_gait(gait: Gait, path: str | Path) -> None:
    """Writes a gait file; it loads back to the same numbers."""
    write_whole(path, json.dumps(gait.to_json(), indent=1) + "\n")


def load_gait(path: str | Path, *, oscillators: int) -> Gait:
    """Reads a gait file for a robot with this many oscillators.

    Raises InputError, naming file and key, for whatever is wrong in the file.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise InputError(path, "", "no such gait file") from error
    except IsADirectoryError as error:
        raise InputError(path, "", "is a directory, expected a gait file") from error
    except (OSError, ValueError) as error:
        raise InputError(path, "", f"cannot be read as a text file: {error}") from error
    try:
        raw = json.loads(text, object_pairs_hook=_unique_keys)
    except (ValueError, RecursionError) as error:
        raise InputError(path, "", f"is not JSON: {error}") from error
    return gait_from_json(raw, source=str(path), oscillators=oscillators)


def gait_from_json(raw: Any, *, source: str, oscillators: int) -> Gait:
    """Checks the content of a gait file; raises InputError that names `source` and key."""
    if not isinstance(raw, dict):
        raise InputError(source, "", "expected a JSON object with the keys of a gait")
    known = {"schema", "name", "weights", "tau_a_s", "tau_b_s"}
    for key in raw:
        if key not in known:
            expected = ", ".join(sorted(known))
            raise InputError(source, key, f"unknown key, expected one of {expected}")
    for key in ("schema", "weights", "tau_a_s"):
        if key not in raw:
            raise InputError(source, key, "is missing")
    if type(raw["schema"]) is not int or raw["schema"] != SCHEMA:
        found = json.dumps(raw["schema"])
        raise InputError(source, "schema", f"found {found}, expected {SCHEMA}")
    name = raw.get("name", Path(source).stem)
    if not isinstance(name, str):
        raise InputError(source, "name", f"found {json.dumps(name)}, expected text")
    tau_a = _number(raw["tau_a_s"], source, "tau_a_s", above=0.0)
    tau_b = _number(raw.get("tau_b_s", TAU_B_PER_TAU_A * tau_a), source, "tau_b_s", above=0.0)
    return Gait(
        name=name, weights=_weights(raw["weights"], source, oscillators), tau_a=tau_a, tau_b=tau_b
    )


def _weights(raw: Any, source: str, oscillators: int) -> tuple[float, ...]:
    expected = f"expected {weight_count(oscillators)} numbers for {oscillators} oscillators"
    if not isinstance(raw, list):
        raise InputError(source, "weights", f"found {json.dumps(raw)}, {expected}")
    if len(raw) != weight_count(oscillators):
        raise InputError(source, "weights", f"found {len(raw)} numbers, {expected}")
    return tuple(_number(w, source, f"weights[{i}]", at_least=0.0) for i, w in enumerate(raw))


def _number(
    value: Any, source: str, key: str, *, above: float = -math.inf, at_least: float = -math.inf
) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(source, key, f"found {json.dumps(value)}, expected a number")
    if not abs(value) < 1e300:  # NaN, infinity, and integers beyond floating point
        raise InputError(source, key, f"found {str(value)[:40]}, expected a finite number")
    if not value > above:
        raise InputError(source, key, f"found {value}, expected more than {above:g}")
    if not value >= at_least:
        raise InputError(source, key, f"found {value}, expected at least {at_least:g}")
    return float(value)


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        raise ValueError("a key is given twice")
    return content
