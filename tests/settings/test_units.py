"""Text with units becomes SI numbers; anything else is refused."""

from pathlib import Path

import pytest
import yaml

from tetra_drake.scenario.load import dump_scenario, load_scenario
from tetra_drake.settings.units import SYSTEMS, plainest, quantity_to_si, shown_in

# Exact by definition: the international inch, the avoirdupois pound (0.45359237 kg) and
# standard gravity (9.80665 m/s^2), whose product is the pound-force.
IN = 0.0254
LBF = 0.45359237 * 9.80665


EXACT = [("25 lbf/in", "N/m", 25 * LBF / IN), ("0.72 s/in", "s/m", 0.72 / IN)]
EXACT += [("1 in", "m", IN), ("1 lbf", "N", LBF)]
EXACT += [("2.7 g/cm^3", "kg/m^3", 2.7e-3 / 1e-6), (" -1.5e-3   m ", "m", -1.5e-3)]


ROWS = yaml.safe_load(Path(__file__).with_name("units.yaml").read_text("utf-8"))


@pytest.mark.parametrize(("text", "unit", "expected"), [*EXACT, *ROWS["signs"]])
def test_quantities_convert_by_the_exact_definitions(text, unit, expected):
    assert quantity_to_si(text, unit) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(("system", "unit", "read", "text"), ROWS["read"])
def test_people_read_numbers_of_the_same_size(system, unit, read, text):
    size = quantity_to_si(text, unit)
    assert SYSTEMS[system].of(unit) == (pytest.approx(size, rel=1e-14), read)
    assert SYSTEMS[system].shown(2.5 * size, unit) == f"2.5 {read}"


@pytest.mark.parametrize(("text", "unit"), ROWS["round"])
def test_a_setting_is_shown_in_the_unit_in_which_it_is_a_round_number(text, unit):
    number = quantity_to_si(text, unit) if " " in text else float(text)
    assert plainest(number, unit) == text


@pytest.mark.parametrize(("text", "unit", "words"), ROWS["refused"])
def test_anything_else_is_refused_with_what_was_found(text, unit, words):
    with pytest.raises(ValueError) as caught:
        quantity_to_si(text, unit)
    problem = str(caught.value)
    assert problem.startswith(f"found '{text}'") and "\n" not in problem
    assert all(word in problem for word in words)


@pytest.mark.parametrize(("base", "changes", "expected"), ROWS["robots"])
def test_a_scenario_is_shown_in_the_units_of_its_robot(base, changes, expected, tmp_path):
    scenario = load_scenario(base).with_changes(changes)
    (tmp_path / "record.yaml").write_text(dump_scenario(scenario))  # in SI
    disturbed = scenario.with_numbers({"robot.gravity": 9.7})
    for each in (scenario, load_scenario(tmp_path / "record.yaml"), disturbed):
        assert each.units == SYSTEMS[expected]
    with shown_in("SI"):
        assert scenario.units == SYSTEMS["SI"]
