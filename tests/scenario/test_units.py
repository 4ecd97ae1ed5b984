"""Text with units becomes SI numbers; anything else is refused with a reason."""

import math

import pytest

from tetra_drake.scenario.units import INCH, POUND_FORCE, quantity_to_si

# Exact by definition: the international inch, the avoirdupois pound (0.45359237 kg) and
# standard gravity (9.80665 m/s^2), whose product is the pound-force.
IN = 0.0254
LBF = 0.45359237 * 9.80665


def test_displayed_units_have_their_exact_definitions():
    assert INCH == 0.0254
    assert POUND_FORCE == 4.4482216152605
    assert pytest.approx(LBF, rel=1e-15) == POUND_FORCE


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("6 in", "m", 6 * IN),
        ("2 lbf", "N", 2 * LBF),
        ("25 lbf/in", "N/m", 25 * LBF / IN),
        ("0.4 lbf*s/in", "N*s/m", 0.4 * LBF / IN),
        ("27 lbf*s/in^2", "N*s/m^2", 27 * LBF / IN**2),
        ("27 lbf*s/in**2", "N*s/m^2", 27 * LBF / IN**2),
        ("0.72 s/in", "s/m", 0.72 / IN),
        ("2.7 g/cm^3", "kg/m^3", 2.7e-3 / 1e-6),
        ("400 in/s", "m/s", 400 * IN),
        ("0.5 ms", "s", 0.5e-3),
        ("9.80665 m/s^2", "m/s^2", 9.80665),
    ],
)
def test_quantities_convert_by_the_exact_definitions(text, unit, expected):
    assert quantity_to_si(text, unit) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("-3 m", -3.0),
        ("+3 m", 3.0),
        (".5 m", 0.5),
        ("5. m", 5.0),
        ("1.5e-3 m", 1.5e-3),
        ("2E3 m", 2000.0),
        ("7m", 7.0),
        ("  7   m ", 7.0),
        ("0 m", 0.0),
    ],
)
def test_numbers_may_be_written_in_the_usual_ways(text, expected):
    assert quantity_to_si(text, "m") == expected


@pytest.mark.parametrize(
    "value", [0.1 / 3, 4378.170881161911, 5e-324, 1.7976931348623157e308, 2**-40 + 2**-90]
)
def test_an_si_number_written_with_its_unit_reads_back_to_the_last_bit(value):
    assert quantity_to_si(f"{value!r} N*s/m^2", "N*s/m^2") == value


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("6 lbf", "m"),
        ("6 in", "N"),
        ("25 lbf", "N/m"),
        ("27 lbf*s/in", "N*s/m^2"),  # as Table 1 prints the damping; it does not balance
        ("25 lb/in", "N/m"),  # a pound is a mass
        ("3 in", "m^2"),
    ],
)
def test_a_wrong_dimension_is_refused(text, unit):
    with pytest.raises(ValueError) as caught:
        quantity_to_si(text, unit)
    assert str(caught.value) == f"found '{text}', expected a quantity that converts to {unit}"


@pytest.mark.parametrize("text", ["6", "6.5e3", "in", "", "  ", "six in", "- 6 in", "1 000"])
def test_a_number_and_a_unit_are_both_required(text):
    with pytest.raises(ValueError, match="expected a quantity that converts to m"):
        quantity_to_si(text, "m")


@pytest.mark.parametrize(
    "text",
    [
        "6 furlings",
        "6 in foo",
        "6 in 7",
        "6 m*9",
        "6 in*0",
        "6 in/0",
        "0x10 in",
        "6 in - 3 in",
        "6 in**9**9**9",  # an exponent tower must not be evaluated
        "6 in**(9**9**9)",
        "6 in^99999999",
    ],
)
def test_an_unknown_unit_or_trailing_garbage_is_refused(text):
    with pytest.raises(ValueError, match=r"(unknown|not a quantity); expected a quantity that"):
        quantity_to_si(text, "m")


@pytest.mark.parametrize("text", ["nan in", "NaN m", "inf in", "-inf m", "Infinity m", "1e999 m"])
def test_a_number_that_is_not_finite_is_refused(text):
    with pytest.raises(ValueError, match="expected a quantity that converts to m"):
        quantity_to_si(text, "m")


def test_a_conversion_that_overflows_is_refused():
    # 1e308 km is 1e311 m, beyond the largest double, 1.8e308.
    with pytest.raises(ValueError, match="is finite"):
        quantity_to_si("1e308 km", "m")
    assert math.isfinite(quantity_to_si("1e308 m", "m"))


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').getcwd()",
        "6 __import__('os')",
        "6 in; import os",
        "6 lambda: 1",
        "6 m if True else 1",
        "6 [m]",
        "6 m\n__class__",
    ],
)
def test_code_is_not_a_quantity(text):
    with pytest.raises(ValueError, match="found "):
        quantity_to_si(text, "m")
