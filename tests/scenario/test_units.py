"""Text with units becomes SI numbers; anything else is refused."""

import pytest

from tetra_drake.scenario.units import INCH, POUND_FORCE, customary, quantity_to_si, shown

# Exact by definition: the international inch, the avoirdupois pound (0.45359237 kg) and
# standard gravity (9.80665 m/s^2), whose product is the pound-force.
IN = 0.0254
LBF = 0.45359237 * 9.80665


def test_displayed_units_have_their_exact_definitions():
    assert pytest.approx((IN, LBF), rel=1e-15) == (INCH, POUND_FORCE)


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("25 lbf/in", "N/m", 25 * LBF / IN),
        ("27 lbf*s/in^2", "N*s/m^2", 27 * LBF / IN**2),
        ("0.72 s/in", "s/m", 0.72 / IN),
        ("2.7 g/cm^3", "kg/m^3", 2.7e-3 / 1e-6),
        ("0.5 ms", "s", 0.5e-3),
        ("-3 m", "m", -3.0),
        ("5. m", "m", 5.0),
        ("1.5e-3 m", "m", 1.5e-3),
        ("  7   m ", "m", 7.0),
    ],
)
def test_quantities_convert_by_the_exact_definitions(text, unit, expected):
    assert quantity_to_si(text, unit) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    "value", [0.1 / 3, 4378.170881161911, 5e-324, 1.7976931348623157e308, 2**-40 + 2**-90]
)
def test_an_si_number_written_with_its_unit_reads_back_to_the_last_bit(value):
    assert quantity_to_si(f"{value!r} N*s/m^2", "N*s/m^2") == value


@pytest.mark.parametrize(
    ("unit", "read"),
    [
        *(("m", "in"), ("N", "lbf"), ("rad", "deg"), ("m/s", "in/s"), ("N/s", "lbf/s")),
        *(("N*s/m", "lbf*s/in"), ("1/m", "/in"), ("s/m", "s/in"), ("1/rad", "/deg")),
        *(("s", "s"), ("J", "J"), ("kg/m", "kg/m")),
    ],
)
def test_people_read_inches_pounds_force_and_degrees_of_the_same_size(unit, read):
    size, name = customary(unit)
    assert name == read
    assert size == pytest.approx(quantity_to_si(f"1 {name}", unit), rel=1e-14)
    assert shown(2.5 * size, unit) == f"2.5 {read}"


def test_numbers_without_a_unit_stay_bare():
    assert (customary(""), shown(0.25, "")) == ((1.0, ""), "0.25")


DIMENSION = ["6 lbf", "3 in^2", "25 lb/in", "27 lbf*s/in"]
"""Not of length; a pound is a mass, and Table 1 prints a damping whose unit does not balance."""
INCOMPLETE = ["6", "6.5e3", "in", "", "  ", "six in", "- 6 in", "1 000"]
GARBAGE = ["6 furlings", "6 in foo", "6 in 7", "6 m*9", "6 in/0", "0x10 in", "6 in - 3 in"]
TOWERS = ["6 in**9**9**9", "6 in**(9**9**9)", "6 in^99999999"]  # must not be evaluated
NOT_FINITE = ["nan in", "inf in", "-inf m", "Infinity m"]
CODE = ["__import__('os').getcwd()", "6 in; import os", "6 lambda: 1", "6 [m]", "6 m\n__class__"]


@pytest.mark.parametrize("text", DIMENSION + INCOMPLETE + GARBAGE + TOWERS + NOT_FINITE + CODE)
def test_anything_else_is_refused_with_what_was_found(text):
    with pytest.raises(ValueError) as caught:
        quantity_to_si(text, "m")
    assert str(caught.value).startswith(f"found '{text}'")
