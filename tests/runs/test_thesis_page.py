"""The thesis, number by number: the page is as its records say, and whole."""

import re

import thesis_page

TEXT = thesis_page.PAGE.read_text(encoding="utf-8")


def test_the_page_leaves_nothing_of_the_thesis_out() -> None:
    assert "**not**" not in TEXT, "a setting is not the thesis's"
    for kind, count in (("Fig.", 23), ("Eq.", 10)):
        found = re.findall(rf"^- \*\*{kind}\xa0(\d+)", TEXT, re.M)
        assert list(map(int, found)) == list(range(1, count + 1))
    assert set(re.findall(r"Table.(\d)", TEXT)) == set("12345678")
