"""The renderer of pages: numbers, tables, and what is missing."""

import math

import page
import pytest

from tetra_drake.formatting import TextTable


@pytest.fixture
def rendered(tmp_path, monkeypatch):
    """A page from the text of a template and numbers."""

    def render(text, **numbers):
        (tmp_path / "one.md.jinja").write_text(text)
        return page.rendered("one.md", **numbers)

    monkeypatch.setattr(page, "TEMPLATES", tmp_path)
    page._environment.cache_clear()
    yield render
    page._environment.cache_clear()


def test_rows_of_a_table_are_those_of_a_text_table(rendered):
    rows = [["a b", "1 to 2"], ["c", "3 (2–4)"]]
    lines = ["| a b | c d |", "| --- | ---: |", "{% for x, y in rows %}", "| {{ x }} | {{ y }} |"]
    text = "\n".join([*lines, "{% endfor %}", ""])
    assert rendered(text, rows=rows) == TextTable(["a b", "c d"], rows).markdown() + "\n"


def test_numbers_have_their_digits_and_none_is_a_dash(rendered):
    text = "{{ x | fixed(1) }}, {{ s | percent }}, {{ [x, 1, 3] | over }}, "
    text += "{{ rows | median('k') | fixed }}"
    rows = [{"k": 1.0}, {"k": 4.0}]
    assert rendered(text, x=2.25, s=0.5, rows=rows) == "2.2, 50 %, 2.25 (1.00 to 3.00), 2.50"
    assert rendered(text, x=math.nan, s=math.nan, rows=[]) == "-, -, - (1.00 to 3.00), -"


def test_a_number_that_is_not_given_is_refused(rendered, tmp_path, refused):
    with refused(tmp_path / "one.md.jinja", "", "'x' is undefined"):
        rendered("{{ x }}")
