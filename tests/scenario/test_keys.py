"""The page of all keys."""

import re

import pytest

from tetra_drake.scenario.keys import PAGE, keys_page
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.metrics import METRICS
from tetra_drake.settings.refusals import TAG


@pytest.fixture(scope="module")
def rows() -> dict[str, list[str]]:
    """The cells of each row of the page by its key."""
    text = PAGE.read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.startswith("| `")]
    cells = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]
    return {key.strip("`"): rest for key, *rest in cells}


def test_the_page_is_as_the_kinds_say():
    written = PAGE.read_text(encoding="utf-8")
    assert written == keys_page(), "write it: python -m tetra_drake.scenario.keys"


def test_each_key_and_each_metric_is_explained(rows):
    for key in load_scenario("robust").values():
        if TAG not in key and not key.startswith(("objective", "disturbances.spreads")):
            assert key in rows, key
    assert METRICS.keys() <= rows.keys()
    assert [key for key, cells in rows.items() if not cells[-1]] == []
