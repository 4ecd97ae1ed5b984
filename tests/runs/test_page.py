"""The renderer of pages: numbers, tables, and what is missing."""

import page
import pytest


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


def test_a_number_that_is_not_given_is_refused(rendered, tmp_path, refused):
    with refused(tmp_path / "one.md.jinja", "", "'x' is undefined"):
        rendered("{{ x }}")
