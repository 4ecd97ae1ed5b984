"""Every scenario that loads makes a robot, or ends in one line."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers.anchored import load_once
from helpers.laws import EXAMPLES

from tetra_drake.errors import InputError
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import dump_scenario, load_scenario

ANY, ROW, STRUCTURE = yaml.safe_load(
    Path(__file__).with_name("any.yaml").read_text("utf-8")
).values()
LAWS = {key: list(laws.values()) for key, laws in EXAMPLES.items()}
SCENARIOS = {"turning": ROW, "feedback": ROW, "prism": STRUCTURE, "mast": STRUCTURE}
"""Shipped scenarios, with values of what is no number."""


def text_of(name, generator):
    """A scenario file in which some settings and some numbers are others, by up to eight orders of
    magnitude."""
    choices = SCENARIOS[name] | ANY | LAWS
    keys = generator.choice(list(choices), size=generator.integers(0, 4), replace=False)
    changes = {key: choices[key][generator.integers(len(choices[key]))] for key in keys.tolist()}
    scenario = load_once(name).with_changes(changes)
    numbers = scenario.numbers()
    some = generator.choice(list(numbers), size=generator.integers(0, 4), replace=False).tolist()
    factors = 10.0 ** generator.uniform(-8.0, 8.0, len(some))
    factors *= generator.choice([-1.0, 0.0, 1.0, 1.0, 1.0, 1.0], len(some))
    changed = {key: float(numbers[key] * factor) for key, factor in zip(some, factors, strict=True)}
    return dump_scenario(scenario.with_numbers(changed))


@pytest.mark.parametrize("draws", [8, pytest.param(50, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", SCENARIOS)
def test_a_scenario_that_loads_makes_a_robot_or_one_line(name, draws, tmp_path):
    generator, ends = np.random.default_rng(1), []
    for _ in range(draws):
        try:
            (tmp_path / "any.yaml").write_text(text_of(name, generator))
            scenario = load_scenario(tmp_path / "any.yaml")
            ends.append("loads")
            robot = Robot.of(scenario)
            robot.oscillators(seeded_gait(scenario))
        except InputError as error:
            assert len(str(error).splitlines()) == 1
        else:
            assert np.isfinite(robot.structure.initial_state).all()
            assert robot.model.bodies.mass.min() > 0.0
            ends[-1] = "makes a robot"
    assert ends.count("makes a robot") > 0.2 * draws
