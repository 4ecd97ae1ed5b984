"""The thesis, number by number: the page is as its records say, and whole."""

import re

import thesis_page
from helpers.recorded import recorded_run

from tetra_drake.files import read_json


def test_the_page_is_current_and_leaves_nothing_of_the_thesis_out():
    text = thesis_page.PAGE.read_text(encoding="utf-8")
    run, simulated = recorded_run("thesis"), read_json(thesis_page.NUMBERS, "")
    assert thesis_page.page(run, simulated) + "\n" == text
    assert "**no**" not in text, "a setting is not the thesis's"
    for kind, count in (("Fig.", 23), ("Eq.", 10)):
        found = re.findall(rf"^\| {kind}\xa0(\d+)", text, re.M)
        assert list(map(int, found)) == list(range(1, count + 1))
    assert set(re.findall(r"Table.(\d)", text)) == set("12345678")
