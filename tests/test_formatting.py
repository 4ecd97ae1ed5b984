import math

import pytest

from tetra_drake.formatting import (
    TextTable,
    duration,
    fixed,
    listed,
    percents,
    ranged,
    rounded,
    signed,
)


@pytest.mark.parametrize(
    ("write", "value", "text"),
    [
        (fixed, 1.234, "1.23"),
        (fixed, -0.004, "0.00"),
        (rounded, 1050.4, "1050"),
        (rounded, -0.05119, "-0.0512"),
        (rounded, math.nan, "-"),
        (signed, 1.234, "+1.23"),
        (duration, 3723.0, "1:02:03"),
        (listed, ["a", "b", "c"], "a, b and c"),
    ],
)
def test_values_as_text(write, value, text):
    assert write(value) == text


def test_a_table_aligns_numbers_to_the_right():
    table = TextTable(["name", "in"], [["a", "1.00"], ["long name", "10.00"]])
    assert table.text() == "name          in\na           1.00\nlong name  10.00"
    rule = "| --- | ---: |"
    assert table.markdown() == f"| name | in |\n{rule}\n| a | 1.00 |\n| long name | 10.00 |"
    assert TextTable(["name", "in"], []).text() == "name  in"
    broken = TextTable(["a word", "m"], [["a word", "5 (4–6)"]]).markdown()
    assert broken.splitlines()[-1] == "| a word | 5\u00a0(4–\u20606) |", "numbers stay on one line"


def test_a_range_without_width_or_ends_is_not_shown():
    assert percents(1.0, 0.91, 1.0) == "100 % (91 to 100)"
    assert ranged(2.0, 1.0, 3.0) == "2.00 (1.00 to 3.00)"
    assert ranged(2.0, math.nan, math.nan) == ranged(2.0, 2.0, 2.0) == "2.00"
