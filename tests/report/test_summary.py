"""What is printed of one simulation."""

import dataclasses
import math

import pytest

from tetra_drake.report.summary import ground_text, result_text
from tetra_drake.scenario.friction_kinds import Coulomb
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.terrain_kinds import HeightField, Rough
from tetra_drake.scenario.units import INCH


def numbers(text):
    """By metric, the numbers in a text; metrics in their order."""
    lines = text[text.index("metric ") :].splitlines()
    return {name.strip(): value for name, _, value in (line.rpartition("  ") for line in lines)}


def test_the_metrics_are_printed_in_the_units_of_people_the_objectives_first(tiny, result):
    metrics = dataclasses.replace(result.metrics, distance=2.0 * INCH, heading_change=math.pi)
    result = dataclasses.replace(result, metrics=metrics, fitness=1.5)
    shown = numbers(result_text(result))
    expected = {"distance (in)": "2.000", "fitness": "1.500", "heading change (deg)": "180.000"}
    assert shown | expected == shown
    assert list(shown)[1] == "distance (in)"
    turning = tiny.with_changes({"objective": {"heading_change": "1 /rad"}})
    assert (
        list(numbers(result_text(dataclasses.replace(result, scenario=turning))))[1]
        == "heading change (deg)"
    )


def test_requirements_that_are_not_met_are_named(tiny, result):
    assert "requirement" not in result_text(result)
    strict = tiny.with_changes({"require": {"distance": "4000 in", "twist": "0 in"}})
    strict_result = dataclasses.replace(result, scenario=strict)
    (line,) = (line for line in result_text(strict_result).splitlines() if "requir" in line)
    assert line.split()[0] == "distance" and "4000 in" in line


@pytest.mark.parametrize(
    ("scenario", "changes", "words"),
    [
        ("thesis", {"engine": "!Mujoco"}, {"flat", "MuJoCo", "0.5"}),
        ("thesis", {"terrain": Rough(amplitude=0.0254, wavelength=0.1)}, {"amplitude 1 in"}),
        ("incline", {}, {"incline", "slope 5 deg", "static 0.5", "kinetic 0.5"}),
        ("steps", {"friction": Coulomb(lateral=2.0)}, {"height 0.25 in", "count 4", "lateral 2"}),
        ("thesis", {"terrain": HeightField(file="/far/away/a.npy", cell=0.0254)}, {"a.npy"}),
    ],
)
def test_the_ground_is_named_unless_it_is_the_thesiss(scenario, changes, words):
    text = ground_text(load_scenario(scenario).with_changes(changes))
    assert bool(text) == bool(words)
    assert all(word in text for word in words)
    assert "/far" not in text and "\n" not in text
