"""The thesis, number by number: the page is as its records say, and whole."""

import re

import pytest
import thesis_page
from helpers.recorded import recorded_run

from tetra_drake.files import read_json

OURS = "\0"
"""Stands for what the recorded trials have."""

TEXT = thesis_page.PAGE.read_text(encoding="utf-8")
SIMULATED = read_json(thesis_page.NUMBERS, "")


class Trials(dict[str, object]):
    """The numbers of trials that are not read."""

    def __missing__(self, name: str) -> object:
        return Trials() if name == "pair" else OURS


@pytest.mark.slow
def test_the_page_is_current() -> None:
    assert thesis_page.page(recorded_run("thesis"), SIMULATED) == TEXT


def test_the_page_is_current_but_for_the_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(thesis_page, "trials_numbers", lambda run: Trials())
    monkeypatch.setattr(thesis_page, "load_run", lambda path: None)
    number = thesis_page.fixed
    monkeypatch.setattr(
        thesis_page, "fixed", lambda x, *digits: OURS if x == OURS else number(x, *digits)
    )
    made = thesis_page.page(None, SIMULATED).splitlines()
    assert 20 < sum(OURS in line for line in made) < 35
    for ours, line in zip(made, TEXT.splitlines(), strict=True):
        assert re.fullmatch(re.escape(ours).replace(re.escape(OURS), ".*"), line)


def test_the_page_leaves_nothing_of_the_thesis_out() -> None:
    assert "**not**" not in TEXT, "a setting is not the thesis's"
    for kind, count in (("Fig.", 23), ("Eq.", 10)):
        found = re.findall(rf"^- \*\*{kind}\xa0(\d+)", TEXT, re.M)
        assert list(map(int, found)) == list(range(1, count + 1))
    assert set(re.findall(r"Table.(\d)", TEXT)) == set("12345678")
