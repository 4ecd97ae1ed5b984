"""The places of tables in a page; what they hold is compared with the pages of all runs."""

import pytest
import tables

BEGIN, END = "<!-- table {}: made by runs/tables.py -->\n", "<!-- end -->\n"
FIRST, SECOND = BEGIN.format("one"), BEGIN.format("two")
PAGE = f"# Title\n\n{FIRST}old\n\nolder\n{END}\ntext\n{SECOND}{END}"


def test_tables_replace_what_stands_between_their_markers():
    expected = f"# Title\n\n{FIRST}\n| 1 |\n\n{END}\ntext\n{SECOND}\n| 2 |\n\n{END}"
    make = {"one": "| 1 |", "two": "| 2 |"}.__getitem__
    assert tables.filled(PAGE, make) == expected
    assert tables.filled(expected, make) == expected
    for page in (PAGE.rsplit(END, 1)[0], PAGE.replace(END, "", 1)):
        with pytest.raises(ValueError, match="table"):
            tables.filled(page, str)
