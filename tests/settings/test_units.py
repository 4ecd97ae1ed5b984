"""Text with units becomes SI numbers; anything else is refused."""

import math

import pytest

from tetra_drake.lab.predict.variates import deviation
from tetra_drake.scenario.load import dump_scenario, load_scenario
from tetra_drake.settings.quantities import Quantity
from tetra_drake.settings.units import SYSTEMS, plainest, quantity_to_si, shown_in

# Exact by definition: the international inch, the avoirdupois pound (0.45359237 kg) and
# standard gravity (9.80665 m/s^2), whose product is the pound-force.
IN = 0.0254
LBF = 0.45359237 * 9.80665


EXACT = [("25 lbf/in", "N/m", 25 * LBF / IN), ("0.72 s/in", "s/m", 0.72 / IN)]
EXACT += [("1 in", "m", IN), ("1 lbf", "N", LBF)]
EXACT += [("2.7 g/cm^3", "kg/m^3", 2.7e-3 / 1e-6), (" -1.5e-3   m ", "m", -1.5e-3)]


# Signs that editors insert and Pint prints; both code points of micro, minus, times and angstrom.
SIGNS = [("450000 \u00b5m", "m", 0.45), ("5 \u03bcm", "m", 5e-6), ("2 \u212b", "m", 2e-10)]
SIGNS += [
    ("90°", "rad", math.pi / 2),
    ("3 °/s", "rad/s", math.pi / 60),
    ("1 /°", "1/rad", 180 / math.pi),
]
SIGNS += [("5 N·s/m", "N*s/m", 5.0), ("5 N⋅s∕m", "N*s/m", 5.0), ("2 kg·m²", "kg*m^2", 2.0)]
SIGNS += [("3 m s⁻¹", "m/s", 3.0), ("\u22125\u00a0mm", "m", -0.005), ("1e-3 N/mm", "N/m", 1.0)]
SIGNS += [("1.5×10³ N·m⁻¹", "N/m", 1500.0), ("2 · 10⁻³ m", "m", 2e-3), ("3 × 10^-2 m", "m", 0.03)]
EXACT += SIGNS


@pytest.mark.parametrize(("text", "unit", "expected"), EXACT)
def test_quantities_convert_by_the_exact_definitions(text, unit, expected):
    assert quantity_to_si(text, unit) == pytest.approx(expected, rel=1e-14)


READ = [("in", "N*s/m^2", "lbf*s/in^2", LBF / IN**2), ("in", "1/rad", "/deg", 180 / math.pi)]
READ += [("in", "m", "in", IN), ("in", "N", "lbf", LBF), ("cm", "m/s", "cm/s", 0.01)]
READ += [("mm", "1/m", "/mm", 1000), ("SI", "N/m", "N/m", 1), ("in", "kg", "kg", 1)]


@pytest.mark.parametrize(("system", "unit", "read", "size"), READ)
def test_people_read_numbers_of_the_same_size(system, unit, read, size):
    assert SYSTEMS[system].of(unit) == (pytest.approx(size, rel=1e-14), read)
    assert SYSTEMS[system].shown(2.5 * size, unit) == f"2.5 {read}"


SMALL = {"robot.strut_length": "15 cm", "robot.strut_diameter": "3 mm"}
LARGE = {"robot.strut_length": "2 m", "robot.strut_diameter": "1 dm", "robot.node_diameter": "2 dm"}
OF_ROBOTS = [("thesis", {}, "in"), ("thesis", SMALL, "cm"), ("thesis", LARGE, "SI")]
OF_ROBOTS += [("prism", {}, "cm")]  # a radius of 0.1 m, a height of 0.16 m
OF_ROBOTS += [("prism", {"robot.unit": "mm"}, "mm")]  # given in mm


@pytest.mark.parametrize(("base", "changes", "expected"), OF_ROBOTS)
def test_a_scenario_is_shown_in_the_units_of_its_robot(base, changes, expected, tmp_path):
    scenario = load_scenario(base).with_changes(changes)
    (tmp_path / "record.yaml").write_text(dump_scenario(scenario))  # in SI
    disturbed = scenario.with_numbers({"robot.gravity": 9.7})
    for each in (scenario, load_scenario(tmp_path / "record.yaml"), disturbed):
        assert each.units == SYSTEMS[expected]
    with shown_in("SI"):
        assert scenario.units == SYSTEMS["SI"]


ROUND = {"6 in": "m", "240 mm/s": "m/s", "27 lbf*s/in^2": "N*s/m^2", "9.80665 m/s^2": "m/s^2"}
ROUND |= {"1 /rad": "1/rad", "0.125": "", "0": "m"}


@pytest.mark.parametrize(("text", "unit"), ROUND.items())
def test_a_setting_is_shown_in_the_unit_in_which_it_is_a_round_number(text, unit):
    number = quantity_to_si(text, unit) if " " in text else float(text)
    assert plainest(number, unit) == text


def test_signs_are_read_with_tolerances_too():
    given = {"density": "2.7·10³ kg·m⁻³ ± 1 %", "strut_diameter": "3000 µm ± 5 µm"}
    robot = load_scenario().with_changes({"robot": given}).robot
    assert (robot.density, robot.strut_diameter) == pytest.approx((2700.0, 3e-3))
    assert deviation(robot.tolerances["strut_diameter"], Quantity(3e-3, "m")) == pytest.approx(5e-6)
    assert robot.tolerances.keys() == {"density", "strut_diameter"}


# What Pint reads as something that many people do not mean; what they may mean.
TWO_MEANINGS = {"20 gr": ("kg", ["g", "grain"]), "1 ton": ("kg", ["t", "2000 lb"])}
TWO_MEANINGS |= {"2 mgr": ("kg", ["g", "grain"]), "3 tons/m^3": ("kg/m^3", ["t", "2000 lb"])}
TWO_MEANINGS |= {"5 mil": ("rad", ["thou", "mm", "mrad"]), "5 pond": ("N", ["gf", "lbf"])}
TWO_MEANINGS |= {"5 grad": ("rad", ["deg", "gon"]), "3 Ns/m": ("N/m", ["N", "N*s"])}
TWO_MEANINGS |= {"1 cwt": ("kg", ["100 lb", "112 lb"]), "4 lbfs/in": ("N/m", ["lbf", "lbf*s"])}


@pytest.mark.parametrize("text", TWO_MEANINGS)
def test_a_name_with_two_meanings_is_refused_with_the_choice(text):
    unit, meant = TWO_MEANINGS[text]
    with pytest.raises(ValueError) as caught:
        quantity_to_si(text, unit)
    problem = str(caught.value)
    assert "\n" not in problem and all(name in problem for name in meant)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("60 rpm", "Hz"),
        ("10 rad/s", "Hz"),
        ("5 percent", "rad"),
        ("0.1 m/m", "rad"),
        ("5 1/s", "rad/s"),
    ],
)
def test_an_angle_is_no_number(text, unit):
    with pytest.raises(ValueError):
        quantity_to_si(text, unit)
    assert quantity_to_si("60 rpm", "rad/s") == pytest.approx(2 * math.pi)


REFUSED = [
    *("0,5 m", "1,000 m", "5 %", "10½ m", "5² m", "5 m⁻¹²", "5·m", "−−5 m"),
    "6 lbf",  # not a length
    "25 lb/in",  # a pound is a mass
    "6 in**(9**9**9)",  # must not be evaluated
    *("6", "in", "", "1 000", "6 furlings", "6 in 7", "6 in - 3 in", "__import__('os').getcwd()"),
    *("nan in", "-inf m", "1e16 m", "-1e200 m", "1e400 m"),
]


@pytest.mark.parametrize("text", REFUSED)
def test_anything_else_is_refused_with_what_was_found(text):
    with pytest.raises(ValueError) as caught:
        quantity_to_si(text, "m")
    assert str(caught.value).startswith(f"found '{text}'")
