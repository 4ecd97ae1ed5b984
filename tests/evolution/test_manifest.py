"""What the parts of a method are called, and what is refused by its name."""

import functools
from dataclasses import dataclass

import numpy as np
from helpers.analytic import small_scenario

from tetra_drake.evolution.manifest import Method


def scaled(result):
    return 2.0 * result.fitness


@dataclass(frozen=True)
class Weighted:
    factor: float = 1.0
    table: object = None

    def __call__(self, result):
        return self.factor * result.fitness


HERE = __name__


def test_what_is_given_from_python_has_its_module_and_fields_in_its_name():
    for objective, name in (
        (Weighted(2.5), f'{HERE}.Weighted {{"factor": 2.5, "table": null}}'),
        (Weighted(1.0, np.ones(3)), f'{HERE}.Weighted {{"factor": 1.0, "table": "ndarray"}}'),
        (functools.partial(scaled), "functools.partial"),
    ):
        method = Method.of(small_scenario(), objective=objective, optimizer=scaled)
        assert (method.objective, method.optimizer) == (name, f"{HERE}.scaled")
    built_in = Method(objective="fitness", optimizer="SteadyState")
    assert built_in == Method.of(small_scenario())
