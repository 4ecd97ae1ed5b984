"""Numbers and tables as text."""

from pathlib import Path

import pytest
import yaml

from tetra_drake import formatting
from tetra_drake.formatting import TextTable

ROWS = yaml.safe_load(Path(__file__).with_name("formatting.yaml").read_text("utf-8"))


@pytest.mark.parametrize(("write", "values", "text"), ROWS)
def test_values_as_text(write, values, text):
    assert getattr(formatting, write)(*values) == text


def test_a_table_aligns_numbers_to_the_right():
    table = TextTable(["name", "in"], [["a", "1.00"], ["long name", "10.00"]])
    assert table.text() == "name          in\na           1.00\nlong name  10.00"
    rule = "| --- | ---: |"
    assert table.markdown() == f"| name | in |\n{rule}\n| a | 1.00 |\n| long name | 10.00 |"
    assert TextTable(["name", "in"], []).text() == "name  in"
    broken = TextTable(["a word", "m"], [["a word", "5 (4–6)"]]).markdown()
    assert broken.splitlines()[-1] == "| a word | 5\u00a0(4–\u20606) |", "numbers stay on one line"
