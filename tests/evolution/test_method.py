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
    return lambda result: factor * result.fitness


def by_default(factor):
    return lambda result, factor=factor: factor * result.fitness


def by_cached_helper(factor):
    @functools.cache
    def helper(fitness):
        return factor * fitness

    return lambda result: helper(result.fitness)


@dataclass(frozen=True)
class Weighted:
    factor: float = 1.0

    def __call__(self, result):
        return self.factor * result.fitness


class Table:
    def __init__(self, values):
        self.values = np.array(values)

    def total(self, result):
        return float(self.values @ self.values)

    __call__ = total


def by_source(factor):
    """Functions without a source file, as typed into an interpreter."""
    names = {}
    exec(f"def objective(result):\n    return [{factor} * r for r in result]", names)
    return names["objective"]


def power(exponent, result):
    return result.fitness**exponent


MADE = [
    by_closure,
    by_default,
    by_cached_helper,
    by_source,
    Weighted,
    lambda values: Table([values, 1.0]),
    lambda values: Table([values, 1.0]).total,
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


def test_a_method_survives_its_file_and_what_the_package_brings_needs_no_digest():
    method = Method.of(small_scenario(), objective=Weighted(2.5), optimizer=by_closure(1.0))
    assert method.given_from_python == ["objective", "optimizer"]
    assert method.objective.settings == {"factor": 2.5}
    assert Method.from_json(json.loads(json.dumps(asdict(method))), "run") == method
    with pytest.raises(InputError):
        Method.from_json({"objective": {}}, "run")
    built_in = Method.of(small_scenario())
    assert built_in.given_from_python == []
    assert (built_in.optimizer, built_in.evaluator.name) == (Part.of(SteadyState), "drake")


@pytest.mark.parametrize(
    ("now", "key", "settings"),
    [
        ({}, "objective", '{"factor": 2.0}'),
        ({"objective": Weighted(3.0), "optimizer": RuntimeError}, "objective", '{"factor": 2.0}'),
        ({"objective": scaled, "optimizer": RuntimeError}, "objective", '{"factor": 2.0}'),
        ({"objective": Weighted(2.0)}, "optimizer", "RuntimeError, not"),
    ],
)
def test_another_method_is_refused_and_the_part_named(now, key, settings):
    scenario = small_scenario()
    given = {"objective": Weighted(2.0), "optimizer": RuntimeError}
    method = Method.of(scenario, **given)
    method.check_same(Method.of(scenario, **given), "runs/mine")
    with pytest.raises(InputError) as caught:
        method.check_same(Method.of(scenario, **now), "runs/mine")
    assert (caught.value.source, caught.value.key) == ("runs/mine", key)
    assert settings in caught.value.problem
