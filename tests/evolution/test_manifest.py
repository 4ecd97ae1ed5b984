"""What the parts of a method are called, and what is refused by its name."""

import functools
from dataclasses import dataclass

import numpy as np
import pytest
from helpers.analytic import small_scenario

from tetra_drake.evolution.manifest import Manifest, Method, read_manifest, write_manifest
from tetra_drake.optimizers.steady_state import SteadyState


def scaled(result):
    return 2.0 * result.fitness


@dataclass(frozen=True)
class Weighted:
    factor: float = 1.0
    table: object = None

    def __call__(self, result):
        return self.factor * result.fitness


HERE = __name__


@pytest.mark.parametrize(
    ("objective", "name"),
    [
        (scaled, f"{HERE}.scaled"),
        (Weighted(2.5), f'{HERE}.Weighted {{"factor": 2.5, "table": null}}'),
        (Weighted(1.0, np.ones(3)), f'{HERE}.Weighted {{"factor": 1.0, "table": "ndarray"}}'),
        (functools.partial(scaled), "functools.partial"),
    ],
)
def test_what_is_given_from_python_has_its_module_and_fields_in_its_name(objective, name):
    assert Method.of(small_scenario(), objective=objective).objective == name


def test_a_method_survives_its_file_and_what_the_package_brings_has_no_module(tmp_path):
    method = Method.of(small_scenario(), objective=Weighted(2.5), optimizer=scaled)
    assert method.given_from_python == ["objective", "optimizer"]
    manifest = Manifest(small_scenario(), 3, {"numpy": "2.0"}, method, "a1b2")
    write_manifest(tmp_path, manifest)
    assert read_manifest(tmp_path) == manifest
    built_in = Method.of(small_scenario())
    assert built_in == Method(objective="fitness", optimizer="SteadyState")
    assert built_in == Method.of(small_scenario(), optimizer=SteadyState)
