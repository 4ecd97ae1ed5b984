"""What a run remembers of its objective and optimiser, and what it takes for something else."""

import functools
import json
from dataclasses import asdict, dataclass

import numpy as np
import pytest
from helpers.analytic import small_scenario

from tetra_drake.errors import InputError
from tetra_drake.evolution.method import Method, Part
from tetra_drake.evolution.optimizers.steady_state import SteadyState

WEIGHT = 2.0


def scaled(result):
    return WEIGHT * result.fitness


def other_body(result):
    return WEIGHT * result.fitness + 1.0


def by_closure(factor):
    def objective(result):
        return factor * result.fitness

    return objective


def by_default(factor):
    def objective(result, factor=factor):
        return factor * result.fitness

    return objective


@dataclass(frozen=True)
class Weighted:
    factor: float = 1.0

    def __call__(self, result):
        return self.factor * result.fitness


class Table:
    def __init__(self, values):
        self.values = np.array(values)

    def __call__(self, result):
        return float(self.values @ self.values)


def by_source(factor):
    """Functions without a source file, as typed into an interpreter."""
    names = {}
    exec(f"def objective(result):\n    return {factor} * result.fitness", names)
    return names["objective"]


def power(exponent, result):
    return result.fitness**exponent


MADE = [
    by_closure,
    by_default,
    by_source,
    Weighted,
    lambda values: Table([values, 1.0]),
    lambda exponent: functools.partial(power, exponent),
]


@pytest.mark.parametrize("make", MADE)
def test_the_digest_covers_code_and_the_values_it_uses(make):
    assert Part.of(make(2.0)) == Part.of(make(2.0))
    assert Part.of(make(2.0)).digest != Part.of(make(3.0)).digest


def test_the_digest_covers_globals_and_the_body(monkeypatch):
    before = Part.of(scaled)
    assert before.name.endswith("test_method.scaled")
    assert before.digest != Part.of(other_body).digest
    monkeypatch.setitem(globals(), "WEIGHT", 3.0)
    assert Part.of(scaled).digest != before.digest


def test_fields_of_a_dataclass_are_settings():
    assert Part.of(Weighted(2.5)).settings == {"factor": 2.5}


def test_what_the_package_brings_needs_no_digest():
    assert Part.of(SteadyState) == Method.of(small_scenario()).optimizer
    built_in = Method.of(small_scenario())
    assert built_in.given_from_python == []
    assert built_in.evaluator.name == "drake"


def test_a_method_survives_its_file():
    method = Method.of(small_scenario(), objective=Weighted(2.0), optimizer=by_closure(1.0))
    assert method.given_from_python == ["objective", "optimizer"]
    assert Method.from_json(json.loads(json.dumps(asdict(method))), "run") == method
    with pytest.raises(InputError):
        Method.from_json({"objective": {}}, "run")


@pytest.mark.parametrize(
    ("now", "key"),
    [
        ({}, "objective"),
        ({"objective": Weighted(3.0), "optimizer": RuntimeError}, "objective"),
        ({"objective": scaled, "optimizer": RuntimeError}, "objective"),
        ({"objective": Weighted(2.0)}, "optimizer"),
    ],
)
def test_another_method_is_refused_and_the_part_named(now, key):
    scenario = small_scenario()
    method = Method.of(scenario, objective=Weighted(2.0), optimizer=RuntimeError)
    method.check_same(
        Method.of(scenario, objective=Weighted(2.0), optimizer=RuntimeError), "runs/mine"
    )
    with pytest.raises(InputError) as caught:
        method.check_same(Method.of(scenario, **now), "runs/mine")
    assert (caught.value.source, caught.value.key) == ("runs/mine", key)
