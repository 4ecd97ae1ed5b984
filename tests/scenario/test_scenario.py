"""Scenario files: the thesis's numbers, files based on files, dumping, and differences."""

from pathlib import Path

import pytest
import yaml
from helpers.anchored import load_once
from record import EXPERIMENTS

from tetra_drake.robot.remarks import start_up_remark
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import dump_scenario, load_scenario
from tetra_drake.scenario.shipped import shipped_scenarios
from tetra_drake.settings.section import value_at

NUMBERS = yaml.safe_load(Path(__file__).with_name("thesis.yaml").read_text("utf-8"))


def write(folder: Path, text: str, name: str = "mine.yaml") -> Path:
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    return file


def test_the_thesis_scenario_holds_the_numbers_of_the_thesis(scenario):
    held, given = (each.model_dump() for each in (scenario, scenario.with_changes(NUMBERS)))
    for key in NUMBERS:
        assert value_at(held, key) == pytest.approx(value_at(given, key), rel=1e-12), key
    assert (scenario.simulation.settling_time, scenario.require) == (3.0, {})
    assert scenario.disturbances is None


RUNS = Path(__file__).parents[2] / "runs"


@pytest.mark.parametrize("name", [name for name in EXPERIMENTS if (RUNS / name).is_dir()])
def test_a_recorded_scenario_is_that_of_its_experiment(name):
    recorded = load_scenario(RUNS / name / "scenario.yaml")
    assert (recorded.name, recorded) == (name, EXPERIMENTS[name].scenario(name))


def test_a_base_file_is_found_beside_the_file_that_names_it(tmp_path, scenario):
    write(tmp_path, "base: thesis\nrobot: {spacing: 3 m, gravity: 1 m/s^2}\n", "common/low.yaml")
    write(tmp_path, "base: common/low.yaml\nrobot: {spacing: 2 m}\n", "middle.yaml")
    file = write(tmp_path, "base: ../middle.yaml\nname: top\n", "mine/top.yaml")
    changes = {"name": "top", "robot.spacing": "2.0 m", "robot.gravity": "1.0 m/s^2"}
    assert load_scenario(str(file)) == scenario.with_changes(changes)


@pytest.mark.parametrize("name", shipped_scenarios())
def test_a_written_scenario_loads_back_to_every_bit_without_its_base(tmp_path, name):
    shipped = load_once(name)
    odd = {key: 0.99973 * number for key, number in shipped.numbers().items()}
    odd["ground.damping"] = 1e-5 / 3  # written with an exponent
    other = shipped.with_numbers(odd).with_sections(name="a: 'name' that needs # quoting")
    for scenario in (shipped, other):
        for text in {dump_scenario(scenario), scenario.to_yaml()}:  # which may be one text
            assert load_scenario(write(tmp_path, text)) == scenario


@pytest.mark.parametrize("name", ["thesis", "quick", "prism", "rolling"])
def test_a_duration_is_shortened_by_one_key(name):
    shipped = load_once(name)
    for duration in (0.5, 2.0, 15.0):
        changed = shipped.with_changes({"simulation.duration": f"{duration} s"})
        given = shipped.simulation.steady_from
        expected = min(3.0, duration / 4.0) if given is None else given
        assert changed.simulation.settling_time == expected
        is_idle = duration <= changed.cpg.start_up and changed.policy is None
        assert ("cpg.start_up" in start_up_remark(Robot.of(changed))) == is_idle


def test_differences_are_keys_and_readable_values(scenario):
    changes = {"robot.cables.slack": True, "cpg.signals": "listing", "name": "other"}
    changes |= {"optimizer.stop_rise": 0.1 + 0.2, "friction.stiction_damping": "0.3 lbf*s/in"}
    changed = scenario.with_changes(changes | {"robot.offsets": [["1 mm", 0, 0]] * 5})
    assert changed.differences(scenario) == [
        ("robot.offsets", f"[{', '.join(['[1 mm, 0, 0]'] * 5)}]"),
        ("robot.cables.slack", "true"),
        ("friction.stiction_damping", "0.3 lbf*s/in"),
        ("cpg.signals", "listing"),
        ("optimizer.stop_rise", "0.3"),
    ]
    other = scenario.with_changes({"objective.lead": "2 /in", "terrain": "!Incline {slope: 5 deg}"})
    steep, lead = ("terrain.slope", "5 deg"), ("objective.lead", "2 /in")
    assert other.differences(scenario) == [("terrain", "Incline"), steep, lead]
    assert scenario.differences(other) == [("terrain", "Flat"), ("objective.lead", "none")]


CHANGES = yaml.safe_load(Path(__file__).with_name("compared.yaml").read_text("utf-8"))


def test_there_are_no_differences_exactly_between_equal_scenarios():
    seen = set()
    for name, changes in CHANGES:
        one = load_scenario(name)
        other = one.with_changes(changes)
        records = [dump_scenario(each.with_sections(name="")) for each in (one, other)]
        same = records[0] == records[1]
        assert (one == other, hash(one) == hash(other)) == (same, same), changes
        assert (one.differences(other) == [], other.differences(one) == []) == (same, same), changes
        seen.add(same)
    assert seen == {True, False}
