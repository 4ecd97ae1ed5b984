"""The paper: it is as its records say, in the form that the journal wants, and cites entries."""

import re

import paper
import pytest

TEXT = paper.PAGE.read_text(encoding="utf-8")
ENTRIES = (paper.PAGE.parent / "paper.bib").read_text(encoding="utf-8")


def test_what_is_cited_is_in_the_bibliography_and_nothing_else():
    cited = set(re.findall(r"(?<![\w.])@([a-z]+\d*)", TEXT))
    assert cited == set(re.findall(r"^@\w+\{(\w+),$", ENTRIES, re.M))
    assert {"matsuoka1985", "drake", "tadiparthi2019", "goyal2019", "ma2022"} <= cited


@pytest.mark.parametrize("entry", ENTRIES.split("\n@")[1:])
def test_an_entry_of_the_bibliography_leads_to_its_source(entry):
    fields = dict(re.findall(r"^  (\w+) = \{(.*)\},?$", entry, re.M))
    assert {"author", "title", "year"} <= fields.keys()
    assert {"doi", "url", "school"} & fields.keys()
    assert re.fullmatch(r"10\.\d{4,5}/\S+", fields.get("doi", "10.0000/none"))
