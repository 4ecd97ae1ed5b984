"""What is changed to learn how far a distance can be trusted."""

import dataclasses

import numpy as np
import pytest
from helpers.synthetic_run import tiny_scenario

from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.experiment.variations import (
    DEFAULT,
    DRAWS,
    NOTHING,
    PERCENTS,
    POSE,
    SCALED,
    DisplacedStart,
    resimulations,
    variations,
)
from tetra_drake.robot.gait import ParameterSpace
from tetra_drake.robot.structure import MakeStructure
from tetra_drake.scenario.schema import Scenario


def differences(one: Scenario, other: Scenario) -> dict[str, float]:
    """The keys in which two scenarios differ, and the ratio of their values."""
    ratios = {}
    for section in dataclasses.fields(Scenario):
        first, second = getattr(one, section.name), getattr(other, section.name)
        if not dataclasses.is_dataclass(first):
            continue
        for field in dataclasses.fields(first):
            a, b = getattr(first, field.name), getattr(second, field.name)
            if a != b:
                ratios[f"{section.name}.{field.name}"] = b / a
    return ratios


def is_localised(scenario):
    return scenario.simulation.mode_changes == "witness"


def test_a_variation_scales_its_keys_and_nothing_else(scenario):
    compiled = scenario.with_changes({"simulation.engine": "compiled"})
    scaled = [each for each in variations(scenario) if each.what in SCALED]
    assert len(scaled) == len(SCALED) * len(PERCENTS) * 2
    for each in scaled:
        ratio = pytest.approx(1.0 + each.percent / 100.0)
        assert differences(compiled, each.evaluate.scenario) == dict.fromkeys(
            SCALED[each.what], ratio
        )


def test_one_variation_changes_nothing(scenario):
    (unchanged,) = [each for each in variations(scenario) if each.what == NOTHING]
    assert unchanged.evaluate == GaitEvaluation(
        scenario.with_changes({"simulation.engine": "compiled"})
    )


def test_variations_leave_the_scenario_as_it_is(scenario):
    before = dataclasses.asdict(scenario)
    list(variations(scenario))
    resimulations(scenario)
    assert dataclasses.asdict(scenario) == before


@pytest.mark.parametrize("percent", PERCENTS)
def test_a_displaced_robot_starts_near_its_pose_and_not_in_the_ground(scenario, percent):
    pose = MakeStructure(scenario.robot, scenario.cables).p_WB
    reach = percent / 100.0 * scenario.robot.spacing
    starts = [
        each.evaluate.structure().p_WB
        for each in variations(scenario)
        if (each.what, each.percent) == (POSE, percent)
    ]
    assert len(starts) == DRAWS
    moves = np.array(starts) - pose
    assert np.abs(moves).max() <= reach
    assert np.abs(moves).max() > reach / 2
    assert moves[..., 2].min() >= 0.0
    assert moves[..., :2].min() < 0.0
    assert len(np.unique(moves)) == moves.size  # no two draws, bodies or axes alike


def test_a_robot_displaced_by_nothing_walks_as_ever():
    scenario = tiny_scenario().with_changes({"simulation.engine": "compiled"})
    genome = ParameterSpace.of(scenario).random(np.random.default_rng(1))
    displaced = DisplacedStart(scenario, 0.0, seed=0)(genome)
    plain = GaitEvaluation(scenario)(genome)
    assert (displaced.metrics, displaced.fitness) == (plain.metrics, plain.fitness)
    assert DisplacedStart(scenario, 5.0, seed=0)(genome).metrics != plain.metrics


def test_a_displaced_robot_that_fails_says_when():
    scenario = tiny_scenario().with_changes({"simulation.engine": "compiled"})
    scenario.simulation.max_evaluations = 100
    evaluation = DisplacedStart(scenario, 5.0, seed=0)(
        ParameterSpace.of(scenario).random(np.random.default_rng(1))
    )
    assert evaluation.failure.startswith("ended at ")
    assert np.isnan(evaluation.distance_in)


def test_resimulations_are_of_the_diagram_and_differ_as_their_names_say(scenario):
    drake = scenario.with_changes({"simulation.engine": "drake"})
    settings = resimulations(scenario.with_changes({"simulation.engine": "compiled"}))
    assert settings[DEFAULT] == drake
    assert differences(drake, settings["accuracy × 10"]) == {
        "simulation.accuracy": pytest.approx(0.1)
    }
    assert differences(drake, settings["accuracy × 100"]) == {
        "simulation.accuracy": pytest.approx(0.01)
    }
    other = settings["runge_kutta3"].simulation
    assert (other.scheme, other.accuracy) == ("runge_kutta3", 0.001)
    localised = [name for name, each in settings.items() if is_localised(each)]
    assert localised == ["witness, steps ≤ 2 ms", "runge_kutta3, witness"]
