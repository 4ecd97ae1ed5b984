import math

import pytest

from tetra_drake.formatting import duration, fixed, listed, markdown_table, signed


@pytest.mark.parametrize(
    ("value", "plain", "with_sign"),
    [
        (1.234, "1.23", "+1.23"),
        (-1.235e2, "-123.50", "-123.50"),
        (-0.004, "0.00", "0.00"),
        (math.nan, "-", "-"),
        (math.inf, "-", "-"),
    ],
)
def test_numbers_have_two_decimals(value: float, plain: str, with_sign: str) -> None:
    assert (fixed(value), signed(value)) == (plain, with_sign)


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.4, "0:00:00"), (59.6, "0:01:00"), (3723.0, "1:02:03"), (math.nan, "-")]
)
def test_durations_are_rounded_to_seconds(seconds: float, text: str) -> None:
    assert duration(seconds) == text


@pytest.mark.parametrize(
    ("items", "text"), [([], "none"), ([1], "1"), (["a", "b", "c"], "a, b and c")]
)
def test_lists(items: list[object], text: str) -> None:
    assert listed(items) == text


def test_markdown_tables_align_numbers_to_the_right() -> None:
    assert markdown_table(["name", "in"], [["a", "1.00"]]) == (
        "| name | in |\n| --- | ---: |\n| a | 1.00 |"
    )
