import math

import pytest

from tetra_drake.formatting import duration, fixed, listed, markdown_table, signed


@pytest.mark.parametrize(
    ("write", "value", "text"),
    [
        (fixed, 1.234, "1.23"),
        (fixed, -123.5, "-123.50"),
        (fixed, -0.004, "0.00"),
        (fixed, math.nan, "-"),
        (fixed, math.inf, "-"),
        (signed, 1.234, "+1.23"),
        (signed, -123.5, "-123.50"),
        (signed, -0.004, "0.00"),
        (signed, math.nan, "-"),
        (duration, 0.4, "0:00:00"),
        (duration, 59.6, "0:01:00"),
        (duration, 3723.0, "1:02:03"),
        (duration, math.nan, "-"),
        (listed, [], "none"),
        (listed, [1], "1"),
        (listed, ["a", "b", "c"], "a, b and c"),
    ],
)
def test_values_as_text(write, value, text):
    assert write(value) == text


def test_markdown_tables_align_numbers_to_the_right():
    table = "| name | in |\n| --- | ---: |\n| a | 1.00 |"
    assert markdown_table(["name", "in"], [["a", "1.00"]]) == table
