"""Gaits on a grid of scenarios: labelled axes, and the numbers of single simulations."""

from __future__ import annotations

import math

import pytest
from helpers.converged import shortly

from tetra_drake.engines.simulate import simulate
from tetra_drake.lab.study.sweep import sweep
from tetra_drake.laws.friction import Coulomb
from tetra_drake.robot.gait_file import save_gait
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.metrics import UNITS
from tetra_drake.scenario.scenario import Scenario

STIFFNESS = "robot.cables.outer_stiffness"


@pytest.fixture(scope="module")
def short() -> Scenario:
    return shortly(load_scenario("thesis"), 0.4, engine="!Compiled")


def test_each_key_is_a_labelled_axis_of_the_numbers_of_single_simulations(short: Scenario) -> None:
    slippery = short.with_changes({"friction": "!Coulomb"})
    gaits = [seeded_gait(short, seed) for seed in (1, 2)]
    friction = "friction.static, friction.kinetic"  # the same value: one axis
    changes = {STIFFNESS: ["30 N/m", "0.2 lbf/in"], friction: [0.1, 0.3]}
    found = sweep(slippery, gaits, changes, workers=1)
    assert dict(found.sizes) == {"outer_stiffness": 2, "kinetic": 2, "gait": 2}
    assert found.kinetic.values.tolist() == [0.1, 0.3]
    assert found.outer_stiffness.values.tolist() == pytest.approx([30.0, 35.0253670])
    assert found.outer_stiffness.units == "N/m"
    assert found.gait.values.tolist() == ["random gait 1", "random gait 2"]
    one = found.sel(outer_stiffness=30.0, kinetic=0.1, gait="random gait 2")
    both = {"friction.static": 0.1, "friction.kinetic": 0.1}
    alone = simulate(slippery.with_changes(both | {STIFFNESS: "30 N/m"}), gaits[1])
    assert alone.scenario.robot.spacing != short.robot.spacing, "balanced anew"
    assert (one.distance, one.fitness) == (alone.metrics.distance, alone.fitness)
    assert {name: array.units for name, array in found.items()} == {
        "fitness": "1", **{name: unit or "1" for name, unit in UNITS.items()}
    }  # fmt: skip


def test_the_path_of_one_gait_is_enough_and_a_failure_is_nan(short, tmp_path):
    save_gait(seeded_gait(short), tmp_path / "gait.json", short)
    found = sweep(short, tmp_path / "gait.json", {"simulation.max_evaluations": [10, 100_000]})
    assert found.distance.dims == ("max_evaluations", "gait")
    assert [math.isnan(x) for x in found.distance.values[:, 0]] == [True, False]


def test_axes_have_whole_keys_where_the_last_part_says_too_little(short: Scenario) -> None:
    damping = {"robot.cables.damping": "8 N*s/m", "ground.damping": "5000 N*s/m^2"}
    others = {"require.speed": "1 mm/s", "friction": Coulomb(), "robot.tetrahedra": 5}
    found = sweep(short, seeded_gait(short), damping | others)
    assert [*found.dims] == [*damping, "require.speed", "friction", "tetrahedra", "gait"]
    assert found["require.speed"].item() == 1e-3
    assert "static=0.5" in found.friction.item()
