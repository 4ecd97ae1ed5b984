"""The paper: it is as its records say, in the form that the journal wants, and cites entries."""

import re

import paper
import pytest

from tetra_drake.scenario.yaml_text import parse_yaml

TEXT = paper.PAGE.read_text(encoding="utf-8")
ENTRIES = (paper.PAGE.parent / "paper.bib").read_text(encoding="utf-8")


def test_the_paper_is_as_its_records_say():
    assert paper.paper() == TEXT


@pytest.mark.parametrize("text", ["", "- 1", "version: 1.0", "date-released: soon"])
def test_a_citation_without_a_day_is_refused(text, tmp_path, refused):
    citation = tmp_path / "CITATION.cff"
    citation.write_text(text)
    with refused(citation, "date-released", "expected a day"):
        paper.released(citation)


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


def test_the_paper_has_the_sections_and_the_length_that_the_journal_asks_for():
    _, front, body = TEXT.split("---\n", 2)
    settings = parse_yaml(front, "paper.md")
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= settings.keys()
    sections = re.findall(r"^# (.*)$", body, re.M)
    wanted = ["Summary", "Statement of need", "State of the field", "Software design"]
    assert sections[:4] == wanted and sections[-1] == "References"
    assert 750 < len(body.split()) < 1750
